"""`save_buffer` writes where the curator's owner allows it, and replaces what it may replace."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import rclpy
from contact_curation_msgs.srv import SaveBuffer
from rclpy.executors import SingleThreadedExecutor

from contact_curation.nodes.curator import Curator
from contact_curation.session.free_domain import free_domain
from contact_curation.storage.manifest.file import read_manifest
from test.graph.parts.offline import scored
from test.simulated import simulated_tosses

TOSSES = 2


@contextmanager
def curator(folder: Path, *parameters: str) -> Iterator[Curator]:
    """A curator that has ranked some tosses; it is not spun."""
    words = [word for one in (f"store:={folder}/buffer.sqlite", *parameters) for word in ("-p", one)]
    with free_domain() as domain:
        rclpy.init(args=["--ros-args", *words], domain_id=domain)
        try:
            node = Curator()
            for place, information in enumerate(scored(simulated_tosses(TOSSES, seed=3))):
                node._stage.add(information, place, "board")
            node._curate()
            yield node
            node.close()
            node.destroy_node()
        finally:
            rclpy.try_shutdown()


def saved(node: Curator, path: Path | str) -> Any:
    return node._save(SaveBuffer.Request(path=str(path)), SaveBuffer.Response())


@pytest.fixture(autouse=True)
def this_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")


def test_a_manifest_is_written_below_the_folder_of_the_store_and_nowhere_else(tmp_path: Path) -> None:
    own = tmp_path / "own"
    own.mkdir()
    (own / "out").symlink_to(tmp_path)
    with curator(own) as node:
        for path in ("../kept.csv", tmp_path / "kept.csv", "out/kept.csv", "", "."):
            answer = saved(node, path)
            assert (answer.success, f"expected a file below {own}" in answer.message) == (False, True)
        assert set(tmp_path.iterdir()) == {own}
        assert saved(node, "kept.csv").path == str(own / "kept.csv")
    assert len(read_manifest(own / "kept.csv").selected) == TOSSES


def test_nothing_is_replaced_unless_the_curator_was_started_so_and_then_earlier_manifests_alone(tmp_path: Path) -> None:
    (tmp_path / "notes.csv").write_text("years of work")
    (tmp_path / "new.provenance.json").write_text("years of work")
    with curator(tmp_path) as node:
        assert saved(node, "kept.csv").success
        for taken in ("kept.csv", "notes.csv", "new.csv"):
            answer = saved(node, taken)
            assert (answer.success, "expected a new name, or a curator with save_overwrites:=true" in answer.message) == (
                False,
                True,
            )
    with curator(tmp_path, "save_overwrites:=true") as node:
        assert saved(node, "kept.csv").success
        assert not saved(node, "notes.csv").success
        assert not saved(node, "new.csv").success
    assert (tmp_path / "notes.csv").read_text() == (tmp_path / "new.provenance.json").read_text() == "years of work"


def test_another_folder_can_be_allowed(tmp_path: Path) -> None:
    allowed = tmp_path / "allowed"
    allowed.mkdir()
    with curator(tmp_path, f"save_folder:={allowed}") as node:
        assert saved(node, "kept.json").path == str(allowed / "kept.json")
        assert not saved(node, tmp_path / "kept.json").success


def _wait(event: threading.Event) -> None:
    event.wait()


def test_other_callbacks_run_while_a_manifest_waits_for_the_worker(tmp_path: Path) -> None:
    with curator(tmp_path) as node:
        executor, go_on = SingleThreadedExecutor(), threading.Event()
        executor.add_node(node)
        node._worker.do(partial(_wait, go_on))
        asked = executor.create_task(node._asked_to_save, SaveBuffer.Request(path="kept.csv"), SaveBuffer.Response())
        for _ in range(5):  # nothing in it waits for the worker
            executor.spin_once(timeout_sec=0.0)
        assert not asked.done()
        go_on.set()
        executor.spin_until_future_complete(asked, 10.0)
        assert asked.result().success
        executor.shutdown()


def test_a_name_that_no_file_can_have_is_refused_and_the_curator_goes_on(tmp_path: Path) -> None:
    for parameters in ((), ("save_overwrites:=true",)):
        folder = tmp_path / str(len(parameters))
        folder.mkdir()
        with curator(folder, *parameters) as node:
            answer = saved(node, f"{'x' * 300}.csv")
            assert (answer.success, "expected a name that a file can have" in answer.message) == (False, True)
            assert saved(node, "kept.csv").success
