"""Networks evaluated on a device: the same numbers in any chunks, within the memory, and nothing left on the CPU."""

import weakref
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves

import contact_curation as cc
from contact_curation.contact.evaluation import Estimator
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.model import Model, Rows
from contact_curation.errors import InvalidValueError
from contact_curation.information.curation import curate_particles
from contact_curation.information.network.config import CPU, GPU_MEMORY_MB, Device
from contact_curation.information.network.forward_pass import ForwardPass, forward_pass
from contact_curation.information.network.score_folder import ScoreFolder
from contact_curation.information.network.scoring import NetworkScorer
from contact_curation.information.pool import pool_of
from contact_curation.information.ranker import RankingConfig
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import ScoringConfig
from contact_curation.motion.toss import Toss
from contact_curation.pipeline.ranking import RankConfig, rank_tosses
from contact_curation.pipeline.reading import ReadingConfig
from contact_curation.pipeline.scoring import PoolConfig
from contact_curation.pipeline.theta import described_polytope, theta_of
from contact_curation.pipeline.workers import LocalEngine
from test.contact.cases import CUBE
from test.information.network.pretended_device import NAME, PretendedDevice
from test.information.network_cases import NETWORKS, network, tosses


def impact_of(toss: Toss, frames: int = 14) -> Toss:
    """The frames of a toss in the middle of which its velocity changes most."""
    middle = int(np.abs(np.diff(toss.linear_velocities[:, 2])).argmax())
    kept = slice(max(0, middle - frames // 2), middle + frames // 2)
    arrays = {each.name: value for each in fields(toss) if isinstance(value := getattr(toss, each.name), np.ndarray)}
    shorter: dict[str, Any] = {name: value[kept] for name, value in arrays.items()}
    return replace(toss, **shorter)


IMPACTS = tuple(impact_of(toss) for toss in tosses()[:3])
FAST = [one if one == "deepvertex" else pytest.param(one, marks=pytest.mark.slow) for one in NETWORKS]
ESTIMATORS = [ScoringConfig(estimator=one, influence_bound=0.5) for one in Estimator]


def scorer_of(kind: str, config: ScoringConfig, device: Device | None = None, folder: Path | None = None) -> NetworkScorer:
    return NetworkScorer(network(kind), config, None, ScoreFolder(folder) if folder else None, device)


def memory_for(transitions: int, kind: str) -> Device:
    """The CPU with memory for at least so many transitions together."""
    return Device(memory_mb=1 + transitions * scorer_of(kind, ScoringConfig()).bytes_each // 10**6)


def scored(scorer: NetworkScorer, given: tuple[Toss, ...]) -> list[TossInformation]:
    found = scorer.score(given)
    assert all(isinstance(info, TossInformation) for info in found)
    return [info for info in found if isinstance(info, TossInformation)]


def assert_alike(found: list[TossInformation], expected: list[TossInformation], share: float) -> None:
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one.block_traces, other.block_traces, rtol=share)
        np.testing.assert_allclose(one.score_sum, other.score_sum, atol=share * np.abs(other.score_sum).max())
        np.testing.assert_allclose(one.mean_loss, other.mean_loss, rtol=share)
        gram, expected_gram = (info.factor.astype(float) @ info.factor.T.astype(float) for info in (one, other))
        np.testing.assert_allclose(gram, expected_gram, atol=1e-5 * np.trace(expected_gram))  # factors are float32
        assert (one.transitions, one.not_scored, one.blocks) == (other.transitions, other.not_scored, other.blocks)


@pytest.mark.slow
@pytest.mark.parametrize("transitions", [1, 17, 1000])
@pytest.mark.parametrize("config", ESTIMATORS, ids=lambda config: config.estimator.value)
@pytest.mark.parametrize("kind", FAST)
def test_tosses_in_pieces_and_together_are_scored_as_each_by_itself(
    kind: str, config: ScoringConfig, transitions: int, tmp_path: Path
) -> None:
    folders = [tmp_path / name for name in ("apart", "chunked")]
    for folder in folders:
        folder.mkdir()
    apart = scorer_of(kind, config, None, folders[0])
    chunked = scorer_of(kind, config, memory_for(transitions, kind), folders[1])
    assert_alike(scored(chunked, IMPACTS), scored(apart, IMPACTS), 1e-9)
    for one, other in zip(chunked.losses(IMPACTS), apart.losses(IMPACTS), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9)
    digests = [toss.digest() for toss in IMPACTS]
    grams = [ScoreFolder(folder).gram(digests, apart.version) for folder in folders]
    np.testing.assert_allclose(grams[1], grams[0], atol=1e-6 * np.abs(grams[0]).max())


def test_each_forward_pass_takes_no_more_transitions_than_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    sizes: list[int] = []

    def counted(model: Model, rows: Rows, config: LossConfig) -> ForwardPass:
        sizes.append(len(rows.dt))
        return forward_pass(model, rows, config)

    scorer = scorer_of("end_to_end", ScoringConfig(), memory_for(20, "end_to_end"))
    most = scorer.device.memory * 10**6 // scorer.bytes_each
    monkeypatch.setattr("contact_curation.information.network.scoring.forward_pass", counted)
    scored(scorer, IMPACTS)
    assert 20 <= most < 26
    assert sizes == [13 if most < 26 else 26] * 3


class LargestMemory(TorchDispatchMode):  # type: ignore[no-untyped-call]
    """Counts the bytes of all tensors that live at the same time."""

    def __init__(self) -> None:
        super().__init__()  # type: ignore[no-untyped-call]
        self.now = self.largest = 0
        self._known: dict[int, int] = {}

    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        found = func(*args, **(kwargs or {}))
        for storage in (value.untyped_storage() for value in tree_leaves(found) if isinstance(value, torch.Tensor)):
            if storage._cdata not in self._known:
                self._known[storage._cdata] = storage.nbytes()
                self.now += storage.nbytes()
                weakref.finalize(storage, self._freed, storage._cdata)
        self.largest = max(self.largest, self.now)
        return found

    def _freed(self, key: int) -> None:
        self.now -= self._known.pop(key, 0)


@pytest.mark.parametrize("config", ESTIMATORS, ids=lambda config: config.estimator.value)
@pytest.mark.parametrize("kind", FAST)
def test_what_a_transition_needs_is_no_more_than_estimated(kind: str, config: ScoringConfig) -> None:
    scorer = scorer_of(kind, config, Device(memory_mb=1000))
    estimated = scorer.bytes_each  # the sketch is made with it
    with LargestMemory() as memory:
        scored(scorer, IMPACTS)
    assert 0.1 * estimated < memory.largest / (len(IMPACTS) * (IMPACTS[0].frames - 1)) < 0.75 * estimated


@pytest.mark.parametrize("config", ESTIMATORS, ids=lambda config: config.estimator.value)
@pytest.mark.parametrize("kind", FAST)
def test_nothing_is_left_on_the_cpu(kind: str, config: ScoringConfig) -> None:
    device = Device(memory_mb=100)
    object.__setattr__(device, "name", NAME)
    with PretendedDevice():  # type: ignore[no-untyped-call]
        scorer = scorer_of(kind, config, device)
        assert {value.device.type for value in scorer.model.state_dict().values()} == {NAME}
        found = scored(scorer, IMPACTS)
    assert_alike(found, scored(scorer_of(kind, config, Device(memory_mb=100)), IMPACTS), 1e-12)


def test_a_pretended_device_refuses_what_a_gpu_refuses() -> None:
    with PretendedDevice():  # type: ignore[no-untyped-call]
        there, here = torch.ones(2, device=NAME), torch.ones(2)
        assert (there + 1.0).cpu().tolist() == [2.0, 2.0]
        with pytest.raises(RuntimeError, match="tensors of the CPU"):
            there + here
        with pytest.raises(RuntimeError, match="numpy"):
            there.numpy()


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no GPU")
@pytest.mark.parametrize("config", ESTIMATORS, ids=lambda config: config.estimator.value)
@pytest.mark.parametrize("kind", NETWORKS)
def test_a_gpu_gives_the_traces_to_1e_6_and_the_same_selections(kind: str, config: ScoringConfig) -> None:
    here, there = (scored(scorer_of(kind, config, Device(name)), tosses()) for name in (CPU, "cuda"))
    assert_alike(there, here, 1e-6)
    for criterion in ("representative", "trace", "log-det"):
        chosen = [
            curate_particles([pool_of(infos)], RankingConfig(criterion, top=3)).ranking.ids[:3] for infos in (here, there)
        ]
        assert set(chosen[0]) == set(chosen[1])


@pytest.fixture
def gpu() -> Device:
    """The config of a GPU, wherever this runs."""
    made = Device()
    object.__setattr__(made, "name", "cuda")
    return made


def test_a_gpu_takes_tosses_together_and_the_cpu_one_at_a_time(gpu: Device) -> None:
    assert (Device().memory, Device(memory_mb=7).memory, gpu.memory) == (0, 7, GPU_MEMORY_MB)


@pytest.mark.parametrize(
    ("name", "memory", "line"),
    [
        (
            "cuda:99",
            None,
            r"^device: found cuda:99, expected one of cpu.* \(PyTorch \S+ finds \w+ CUDA devices; see nvidia-smi\)$",
        ),
        ("tpu", None, "^device: found tpu, expected cpu, cuda or cuda:N$"),
        ("cpu", -1, "^device memory: found -1, expected at least 0 MB$"),
    ],
)
def test_a_device_that_is_not_there_is_refused(name: str, memory: int | None, line: str) -> None:
    with pytest.raises(InvalidValueError, match=line):
        Device(name, memory)


@pytest.mark.parametrize("work", [cc.rank, cc.score])
def test_the_library_refuses_it_before_it_reads(work: Callable[..., object]) -> None:
    with pytest.raises(InvalidValueError, match=r"^device: found cuda:99, expected one of cpu"):
        work("nowhere.mcap", body=CUBE, device="cuda:99")


def test_a_polytope_is_scored_on_the_cpu(gpu: Device) -> None:
    with pytest.raises(InvalidValueError, match=r"^device: found cuda, expected cpu: the kernel scores polytopes"):
        PoolConfig(ReadingConfig(CUBE), (described_polytope(CUBE),), ScoringConfig(), device=gpu)


def test_ray_has_no_gpu_for_its_tasks(gpu: Device) -> None:
    pool = PoolConfig(ReadingConfig(CUBE), (theta_of(network("deepvertex")),), ScoringConfig(), device=gpu)
    with pytest.raises(InvalidValueError, match=r"^device: found cuda, expected cpu with --engine ray"):
        rank_tosses([], RankConfig(pool, engine=LocalEngine()))
