"""Scores recordings toss by toss: each is read, checked, scored and released; one or two kB per toss stay in memory.

Recordings are worked on one after the other or, several of them, in processes. A recording is scored in batches of its own, so
that the result is the same for any number of processes, and its factors go to disk when it is done. A bound on the influence of
single transitions is a quantile over the whole pool: then the tosses wait in an index, perhaps a temporary one, until all
losses are known.
"""

import os
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import batched
from pathlib import Path

import numpy as np

from contact_curation.errors import ContactCurationError, InvalidValueError
from contact_curation.files import temporary_folder
from contact_curation.geometry.quaternions import Array
from contact_curation.information.network.config import Device, NetworkConfig
from contact_curation.information.network.model_scorer import TossScorer, scorer_of_model
from contact_curation.information.network.score_folder import ScoreFolder
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import Scorer, ScoringConfig
from contact_curation.learning.evaluation.held_out import HeldOutRule
from contact_curation.motion.toss import Toss
from contact_curation.pipeline.division import HeldOutTosses, held_out_tosses
from contact_curation.pipeline.reading import InputReader, Reading, ReadingConfig
from contact_curation.pipeline.recordings.index import IndexedTosses, RecordingIndex, RecordingReader, Scores, digest_of_scores
from contact_curation.pipeline.theta import NetworkTheta, Theta
from contact_curation.pipeline.tosses import EachOnce, Recording, copies_in_words
from contact_curation.pipeline.workers import Advance, Broken, Engine, unheard
from contact_curation.storage.parameters_file import Parameters
from contact_curation.storage.stores.factor_spool import FactorSpool

BATCH = 64
"""Tosses scored in one call: enough to keep every thread busy, 1 MB of states."""

BOUND_QUANTILE = 0.985
"""Losses above this quantile of the pool's count as this much (method.md 2.1: 98 to 99 %)."""

NOTHING_HELD_OUT = HeldOutRule()

type Source = Path | Recording
"""A recording, to be read or already read."""


@dataclass(frozen=True, eq=False)
class PoolConfig:
    """How recordings become a scored pool.

    Attributes:
        reading: how recordings become tosses.
        thetas: parameter particles, at least one.
        scoring: how tosses are scored.
        bound_influence: whether the bound on losses is taken from the pool.
        network: how they are scored for a network.
        score_folder: takes the exact scores for networks; None to do without them.
        device: where networks are evaluated.

    Raises:
        InvalidValueError: a device for a polytope.
    """

    reading: ReadingConfig
    thetas: tuple[Theta, ...]
    scoring: ScoringConfig
    bound_influence: bool = False
    network: NetworkConfig = field(default_factory=NetworkConfig)
    score_folder: ScoreFolder | None = None
    device: Device = field(default_factory=Device)

    def __post_init__(self) -> None:
        if not self.device.is_cpu and any(isinstance(theta, Parameters) for theta in self.thetas):
            raise InvalidValueError("device", self.device.name, "cpu: the kernel scores polytopes, without PyTorch")

    def scorers(self, bounds: Sequence[float], jobs: int) -> tuple[TossScorer, ...]:
        """One per theta, each with its own bound on losses; `jobs` processes share the processors and the device."""
        loss = replace(self.scoring.loss, threads=max(1, (os.cpu_count() or 1) // jobs))
        configs = [replace(self.scoring, influence_bound=bound, loss=loss) for bound in bounds]
        return tuple(self._scorer(theta, config, jobs) for theta, config in zip(self.thetas, configs, strict=True))

    def _scorer(self, theta: Theta, config: ScoringConfig, jobs: int) -> TossScorer:
        if isinstance(theta, Parameters):
            return Scorer(theta.geometry, theta.body, config)
        import torch  # takes over a second to import

        torch.set_num_threads(1)  # on busy cores threads wait for each other many times as long as they work
        return scorer_of_model(theta.model(), config, self.network, self.score_folder, self.device, jobs)

    @property
    def form(self) -> str | None:
        """How a polytope is parameterised; None for a network without one."""
        theta = self.thetas[0]
        return self.scoring.form.value if isinstance(theta, Parameters) else theta.settings.get("form")

    @property
    def of_weights(self) -> bool:
        """Whether the weights of networks are scored."""
        return isinstance(self.thetas[0], NetworkTheta) and not self.network.physical_only

    @property
    def fixed_bounds(self) -> tuple[float, ...]:
        return (self.scoring.influence_bound,) * len(self.thetas)


@dataclass(frozen=True, eq=False)
class ScoredInput:
    """One recording, read and scored.

    Attributes:
        reading: what was found in it.
        scores: by toss id, of the tosses that passed the gates.
    """

    reading: Reading
    scores: dict[str, Scores]

    def without(self, reasons: Mapping[str, str]) -> "ScoredInput":
        """The same, but tosses that have a reason, by id, are rejected for it."""
        scores = {toss_id: one for toss_id, one in self.scores.items() if toss_id not in reasons}
        return ScoredInput(self.reading.without(reasons), scores) if reasons else self


@dataclass(frozen=True, eq=False)
class _Losses:
    """One recording, read and not scored yet.

    Attributes:
        reading: what was found in it.
        losses: of the transitions, by toss one array per theta.
    """

    reading: Reading
    losses: dict[str, tuple[Array, ...]]


@dataclass(frozen=True, eq=False)
class ScoredPool:
    """All recordings in the order they were given.

    Attributes:
        inputs: one each.
        bounds: on losses, one per theta; inf where there is none.
        warnings: about held-out tosses that nobody has, one line each.
    """

    inputs: tuple[ScoredInput, ...]
    bounds: tuple[float, ...]
    warnings: tuple[str, ...] = ()


def copies_scored(inputs: Sequence[ScoredInput]) -> tuple[str, ...]:
    """A line where some scored tosses are copies of others, or none."""
    scored = ((toss_id, scores[0]) for one in inputs for toss_id, scores in one.scores.items())
    return copies_in_words(
        (toss_id, info.transitions, info.centroid) for toss_id, info in scored if isinstance(info, TossInformation)
    )


def score_pool(
    sources: Sequence[Source],
    config: PoolConfig,
    engine: Engine,
    advance: Advance,
    spool: FactorSpool,
    index: RecordingIndex | None = None,
    held_out: HeldOutRule = NOTHING_HELD_OUT,
) -> ScoredPool:
    """Reads and scores recordings.

    Args:
        sources: at least one.
        config: how.
        engine: schedules the recordings.
        advance: told how many tosses more are done.
        spool: takes the factors; they can be read until it is closed.
        index: what was read and scored before; takes what is read and scored now, recording by recording.
        held_out: rejects tosses after they were scored, so that another rule scores nothing again; bounds are without them.

    Raises:
        InvalidValueError: the rule holds out none of the tosses.
    """
    if not config.bound_influence:
        scored = _scored_by(engine, sources, config, config.fixed_bounds, advance, spool, index)
        found = _held_out(held_out, [one.reading for one in scored], sources, config, engine, index)
        return ScoredPool(tuple(one.without(found.reasons) for one in scored), config.fixed_bounds, found.warnings)
    with temporary_folder("rank") as folder:
        index = index or RecordingIndex(folder).made()  # so that nothing is read twice
        work = partial(_losses_of, config, engine.jobs, index)
        read = dict(engine.as_done(work, sources, advance))
        waiting = [_whole(read[place], source, _Losses) for place, source in enumerate(sources)]
        found = _held_out(held_out, [one.reading for one in waiting], sources, config, engine, index)
        bounds = _bounds(waiting, found.reasons, len(config.thetas))
        scored = _scored_by(engine, sources, config, bounds, advance, spool, index)
        return ScoredPool(tuple(one.without(found.reasons) for one in scored), bounds, found.warnings)


def _held_out(
    rule: HeldOutRule,
    readings: Sequence[Reading],
    sources: Sequence[Source],
    config: PoolConfig,
    engine: Engine,
    index: RecordingIndex | None,
) -> HeldOutTosses:
    """The held-out tosses; recordings with possible duplicates of them are read once more, from the index if it has them."""

    def motions(places: Mapping[str, int]) -> dict[str, Toss]:
        wanted = sorted(set(places.values()))
        work = partial(_tosses_of, config.reading, index, frozenset(places))
        found: dict[str, Toss] = {}
        for number, result in engine.as_done(work, [sources[place] for place in wanted], unheard):
            if isinstance(result, Broken):
                raise ContactCurationError(f"{sources[wanted[number]]}: not compared with the held-out tosses: {result.why}")
            found |= {toss_id: toss for toss_id, toss in result.items() if places[toss_id] == wanted[number]}
        return found

    return held_out_tosses(readings, rule, motions)


def _tosses_of(
    config: ReadingConfig, index: RecordingIndex | None, ids: frozenset[str], source: Source, advance: Advance
) -> dict[str, Toss]:
    return {toss.toss_id: toss for toss in _opened(source, config, index).tosses() if toss.toss_id in ids}


def _scored_by(
    engine: Engine,
    sources: Sequence[Source],
    config: PoolConfig,
    bounds: tuple[float, ...],
    advance: Advance,
    spool: FactorSpool,
    index: RecordingIndex | None,
) -> tuple[ScoredInput, ...]:
    """The recordings in their order: those scored before as the index has them, the others as the engine does them."""
    digests = _digests(sources, config, bounds) if index else [""] * len(sources)
    found: dict[int, ScoredInput] = {}
    for place, digest in enumerate(digests):
        if index and digest and (known := index.scores(digest)):
            found[place] = _spooled(ScoredInput(*known), spool)
            advance(len(known[1]))
    left = [place for place in range(len(sources)) if place not in found]
    work = partial(_score_input, config, engine.jobs, bounds, index)
    for number, result in engine.as_done(work, [sources[place] for place in left], advance):
        place = left[number]
        scored = _whole(result, sources[place], ScoredInput)
        if index and digests[place] and scored.reading.complete:
            index.keep_scores(digests[place], scored.reading, scored.scores)
        found[place] = _spooled(scored, spool)
    return tuple(found[place] for place in range(len(sources)))


def _digests(sources: Sequence[Source], config: PoolConfig, bounds: Sequence[float]) -> list[str]:
    """Of the scores of each recording in an index; empty where they are not to be kept there.

    Exact scores of networks lie in a folder of their own, which a toss that is not scored again would be missing in.
    """
    if config.score_folder is not None:
        return [""] * len(sources)
    versions = [scorer.version for scorer in config.scorers(bounds, jobs=1)]
    scoring = replace(config.scoring, loss=replace(config.scoring.loss, threads=1))
    rules = (versions, config.form, scoring, config.network, list(bounds))
    return ["" if isinstance(source, Recording) else digest_of_scores(source, config.reading, rules) for source in sources]


def _whole[Result: (ScoredInput, _Losses)](result: Result | Broken, source: Source, kind: type[Result]) -> Result:
    """The result; one without tosses for a recording whose worker died."""
    if not isinstance(result, Broken):
        return result
    path = source.reading().path if isinstance(source, Recording) else str(source)
    return kind(Reading(path, "", (), (f"{path}: {result.why}",), complete=False), {})


def _spooled(scored: ScoredInput, spool: FactorSpool) -> ScoredInput:
    scores = {
        toss_id: tuple(spool.with_factor_on_disk(one) if isinstance(one, TossInformation) else one for one in by_theta)
        for toss_id, by_theta in scored.scores.items()
    }
    return replace(scored, scores=scores)


def _opened(
    source: Source, config: ReadingConfig, index: RecordingIndex | None
) -> InputReader | RecordingReader | IndexedTosses | Recording:
    if isinstance(source, Recording):
        return source
    return index.reader(source, config) if index else InputReader(source, config)


def _score_input(
    config: PoolConfig, jobs: int, bounds: Sequence[float], index: RecordingIndex | None, source: Source, advance: Advance
) -> ScoredInput:
    scorers = config.scorers(bounds, jobs)
    reader = _opened(source, config.reading, index)
    scores: dict[str, Scores] = {}
    for found in _while_read(reader.tosses(), partial(_scored, scorers)):
        scores |= found
        advance(len(found))
    return ScoredInput(reader.reading(), scores)


def _losses_of(config: PoolConfig, jobs: int, index: RecordingIndex | None, source: Source, advance: Advance) -> _Losses:
    scorers = config.scorers(config.fixed_bounds, jobs)
    reader = _opened(source, config.reading, index)
    losses: dict[str, tuple[Array, ...]] = {}
    for found in _while_read(reader.tosses(), partial(_losses_by_toss, scorers)):
        losses |= found
        advance(len(found))
    return _Losses(reader.reading(), losses)


def _while_read[Result](tosses: Iterable[Toss], work: Callable[[Sequence[Toss]], Result]) -> Iterator[Result]:
    """The results for batches of tosses, in their order; the next batch is read while the kernel works on the one before."""
    with ThreadPoolExecutor(1) as thread:
        before: Future[Result] | None = None
        for batch in batched(tosses, BATCH):
            following = thread.submit(work, batch)
            if before is not None:
                yield before.result()
            before = following
        if before is not None:
            yield before.result()


def _scored(scorers: Sequence[TossScorer], tosses: Sequence[Toss]) -> dict[str, Scores]:
    by_theta = [scorer.score(tosses) for scorer in scorers]
    return {toss.toss_id: scores for toss, scores in zip(tosses, zip(*by_theta, strict=True), strict=True)}


def _losses_by_toss(scorers: Sequence[TossScorer], tosses: Sequence[Toss]) -> dict[str, tuple[Array, ...]]:
    by_toss = zip(*(scorer.losses(tosses) for scorer in scorers), strict=True)
    return dict(zip((toss.toss_id for toss in tosses), by_toss, strict=True))


def _bounds(waiting: Sequence[_Losses], held_out: Collection[str], thetas: int) -> tuple[float, ...]:
    """The bounds on losses, one per theta, that a pool's own losses suggest; inf where there are none."""
    once = EachOnce()
    for one in waiting:
        once.add(one.reading)
    taken = [
        (waiting[each.recording], toss_id)
        for toss_id, each in once.taken.items()
        if not (each.seen.reasons or toss_id in held_out)
    ]
    known = [one.losses[toss_id] for one, toss_id in taken]
    together = [np.concatenate([np.zeros(0), *(losses[k] for losses in known)]) for k in range(thetas)]
    return tuple(float(np.quantile(losses, BOUND_QUANTILE)) if losses.size else np.inf for losses in together)
