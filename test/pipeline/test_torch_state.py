"""What a user of `import contact_curation as cc` has set in PyTorch changes no result, and is as it was afterwards."""

import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from threading import Event, Thread

import pytest
import torch

import contact_curation as cc
from contact_curation.contact.models.torch_state import own_torch


@pytest.fixture(scope="module")
def few(golden_bag: Path) -> cc.Tosses:
    tosses = cc.read(golden_bag)
    return tosses.only(tosses.ids[:2])


def results(few: cc.Tosses, folder: Path) -> list[bytes]:
    path, model = folder / "m.safetensors", cc.train(few, "deep", steps=1)
    model.save(path, overwrite=True)
    loaded, scores, evaluation = cc.load_model(path), cc.score(few, model=path), cc.evaluate(model, few)
    polytope = cc.train(few, steps=1)
    polytope.learned_body()
    cc.evaluate(polytope, few)
    assert polytope.restitution is None
    return [model.data, repr(loaded.model.tensors()).encode(), scores.scores.tobytes(), repr(evaluation.document()).encode()]


@contextmanager
def default_type(kind: torch.dtype) -> Iterator[None]:
    torch.set_default_dtype(kind)
    try:
        yield
    finally:
        torch.set_default_dtype(torch.float32)


def state() -> tuple[object, ...]:
    modes = torch.is_grad_enabled(), torch.is_inference_mode_enabled()
    return *modes, torch.get_default_dtype(), torch.get_default_device(), torch.get_num_threads()


MODES: tuple[Callable[[], AbstractContextManager[object]], ...] = (
    torch.no_grad,
    torch.inference_mode,
    lambda: torch.device("meta"),
    lambda: default_type(torch.float64),
    lambda: default_type(torch.bfloat16),
)


@pytest.mark.slow
def test_modes_and_defaults_of_the_user_change_no_byte_and_stay(few: cc.Tosses, tmp_path: Path) -> None:
    usual = results(few, tmp_path)
    for mode in MODES:
        with mode():
            before = state()
            assert results(few, tmp_path) == usual, before
            assert state() == before


@pytest.mark.parametrize("mode", MODES)
def test_computations_have_gradients_in_single_precision_on_the_cpu(mode: Callable[[], AbstractContextManager[object]]) -> None:
    with mode():
        before = state()
        with own_torch(), own_torch():
            assert state() == (True, False, torch.float32, torch.device("cpu"), 1)
        assert state() == before


def test_calls_that_overlap_in_threads_give_back_the_number_of_threads() -> None:
    before, entered, left = torch.get_num_threads(), Event(), Event()
    torch.set_num_threads(3)
    found: list[int] = []

    def longer() -> None:
        with own_torch():
            entered.set()
            left.wait(10.0)
            found.append(torch.get_num_threads())
        found.append(torch.get_num_threads())

    thread, fresh = Thread(target=longer), Thread(target=lambda: found.append(torch.get_num_threads()))
    try:
        with own_torch():
            thread.start()
            entered.wait(10.0)
        found.append(torch.get_num_threads())
        left.set()
        thread.join()
        fresh.start()
        fresh.join()
        assert found == [3, 1, 3, 3]
    finally:
        torch.set_num_threads(before)


FORKED = """
import multiprocessing, sys, torch
import contact_curation as cc
tosses = cc.read(sys.argv[1])
few = tosses.only(tosses.ids[:2])
torch.set_num_threads(2)
usual = cc.train(few, "deep", steps=1).data
torch.ones(1000, 1000) @ torch.ones(1000, 1000)  # starts threads, which a forked process does not have
context = multiprocessing.get_context("fork")
child = context.Process(target=lambda: sys.exit(cc.train(few, "deep", steps=1).data != usual))
child.start()
child.join(30)
print(child.exitcode)
child.kill()
"""


@pytest.mark.slow
def test_a_forked_process_trains_where_its_parent_has_used_torch(golden_bag: Path) -> None:
    done = subprocess.run([sys.executable, "-c", FORKED, str(golden_bag)], capture_output=True, text=True, check=False)
    assert done.stdout == "0\n", done.stderr
