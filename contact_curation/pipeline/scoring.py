"""Scores recordings toss by toss: each is read, checked, scored and released; one or two kB per toss stay in memory.

Recordings are worked on one after the other or, several of them, in processes. A recording is scored in batches of its own, so
that the result is the same for any number of processes, and its factors go to disk when it is done. A bound on the influence of
single transitions is a quantile over the whole pool: then the tosses wait in temporary stores until all losses are known.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import batched
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.information.network.config import NetworkConfig
from contact_curation.information.network.model_scorer import TossScorer, scorer_of_model
from contact_curation.information.network.score_folder import ScoreFolder
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import NotScored, Scorer, ScoringConfig
from contact_curation.motion.toss import Toss
from contact_curation.pipeline.reading import InputReader, Reading, ReadingConfig
from contact_curation.pipeline.theta import NetworkTheta, Theta
from contact_curation.pipeline.tosses import EachOnce, Recording
from contact_curation.pipeline.workers import Advance, each
from contact_curation.storage.parameters_file import Parameters
from contact_curation.storage.stores.factor_spool import FactorSpool
from contact_curation.storage.stores.tosses import TossStore

BATCH = 64
"""Tosses scored in one call: enough to keep every thread busy, 1 MB of states."""

BOUND_QUANTILE = 0.985
"""Losses above this quantile of the pool's count as this much (method.md 2.1: 98 to 99 %)."""

Scores = tuple[TossInformation | NotScored, ...]
"""The information of one toss, once per theta."""


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
    """

    reading: ReadingConfig
    thetas: tuple[Theta, ...]
    scoring: ScoringConfig
    bound_influence: bool = False
    network: NetworkConfig = field(default_factory=NetworkConfig)
    score_folder: ScoreFolder | None = None

    def scorers(self, bounds: Sequence[float], jobs: int) -> tuple[TossScorer, ...]:
        """One per theta, each with its own bound on losses; the processors are shared between `jobs` processes."""
        loss = replace(self.scoring.loss, threads=max(1, (os.cpu_count() or 1) // jobs))
        configs = [replace(self.scoring, influence_bound=bound, loss=loss) for bound in bounds]
        return tuple(self._scorer(theta, config) for theta, config in zip(self.thetas, configs, strict=True))

    def _scorer(self, theta: Theta, config: ScoringConfig) -> TossScorer:
        if isinstance(theta, Parameters):
            return Scorer(theta.geometry, theta.body, config)
        import torch  # takes over a second to import

        torch.set_num_threads(1)  # on busy cores threads wait for each other many times as long as they work
        return scorer_of_model(theta.model(), config, self.network, self.score_folder)

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


@dataclass(frozen=True, eq=False)
class ScoredPool:
    """All recordings in the order they were given.

    Attributes:
        inputs: one each.
        bounds: on losses, one per theta; inf where there is none.
    """

    inputs: tuple[ScoredInput, ...]
    bounds: tuple[float, ...]


def score_pool(sources: Sequence[Source], config: PoolConfig, jobs: int, advance: Advance, spool: FactorSpool) -> ScoredPool:
    """Reads and scores recordings.

    Args:
        sources: at least one.
        config: how.
        jobs: how many processes; with one, everything happens in this one.
        advance: told how many tosses more are done.
        spool: takes the factors; they can be read until it is closed.
    """
    if not config.bound_influence:
        scored = each(partial(_score_input, config, jobs), sources, jobs, advance)
        return ScoredPool(tuple(_spooled(one, spool) for one in scored), config.fixed_bounds)
    with TemporaryDirectory(prefix="contact-curation-") as folder:
        places = [(source, Path(folder) / f"{place}.sqlite") for place, source in enumerate(sources)]
        waiting = tuple(each(partial(_store_input, config, jobs), places, jobs, advance))
        bounds = _bounds(waiting, len(config.thetas))
        scored = each(partial(_score_waiting, config, jobs, bounds), waiting, jobs, advance)
        return ScoredPool(tuple(_spooled(one, spool) for one in scored), bounds)


def _spooled(scored: ScoredInput, spool: FactorSpool) -> ScoredInput:
    scores = {
        toss_id: tuple(spool.with_factor_on_disk(one) if isinstance(one, TossInformation) else one for one in by_theta)
        for toss_id, by_theta in scored.scores.items()
    }
    return replace(scored, scores=scores)


@dataclass(frozen=True, eq=False)
class _Waiting:
    """A recording whose tosses are stored until the bounds are known.

    Attributes:
        reading: what was found in it.
        store: where its tosses are.
        losses: of their transitions, by toss one array per theta.
    """

    reading: Reading
    store: Path
    losses: dict[str, tuple[Array, ...]]


def _opened(source: Source, config: ReadingConfig) -> InputReader | Recording:
    return source if isinstance(source, Recording) else InputReader(source, config)


def _score_input(config: PoolConfig, jobs: int, source: Source, advance: Advance) -> ScoredInput:
    scorers = config.scorers(config.fixed_bounds, jobs)
    reader = _opened(source, config.reading)
    scores: dict[str, Scores] = {}
    for tosses in batched(reader.tosses(), BATCH):
        scores.update(_scored(scorers, tosses))
        advance(len(tosses))
    return ScoredInput(reader.reading(), scores)


def _store_input(config: PoolConfig, jobs: int, place: tuple[Source, Path], advance: Advance) -> _Waiting:
    source, store_path = place
    scorers = config.scorers(config.fixed_bounds, jobs)
    reader = _opened(source, config.reading)
    losses: dict[str, tuple[Array, ...]] = {}
    with TossStore(store_path) as store:
        for tosses in batched(reader.tosses(), BATCH):
            with store.transaction():
                for toss in tosses:
                    store.add(toss)
            by_toss = zip(*(scorer.losses(tosses) for scorer in scorers), strict=True)
            losses |= dict(zip((toss.toss_id for toss in tosses), by_toss, strict=True))
            advance(len(tosses))
    return _Waiting(reader.reading(), store_path, losses)


def _score_waiting(
    config: PoolConfig, jobs: int, bounds: tuple[float, ...], waiting: _Waiting, advance: Advance
) -> ScoredInput:
    scorers = config.scorers(bounds, jobs)
    scores: dict[str, Scores] = {}
    with TossStore(waiting.store) as store:
        sequence = 0
        while stored := store.after(sequence, BATCH):
            scores.update(_scored(scorers, [one.toss for one in stored]))
            sequence = stored[-1].sequence
            advance(len(stored))
    return ScoredInput(waiting.reading, scores)


def _scored(scorers: Sequence[TossScorer], tosses: Sequence[Toss]) -> dict[str, Scores]:
    by_theta = [scorer.score(tosses) for scorer in scorers]
    return {toss.toss_id: scores for toss, scores in zip(tosses, zip(*by_theta, strict=True), strict=True)}


def _bounds(waiting: Sequence[_Waiting], thetas: int) -> tuple[float, ...]:
    """The bounds on losses, one per theta, that a pool's own losses suggest; inf where there are none."""
    once = EachOnce()
    for one in waiting:
        once.add(one.reading)
    taken = [(waiting[each.recording], toss_id) for toss_id, each in once.taken.items() if not each.seen.reasons]
    known = [one.losses[toss_id] for one, toss_id in taken]
    together = [np.concatenate([np.zeros(0), *(losses[k] for losses in known)]) for k in range(thetas)]
    return tuple(float(np.quantile(losses, BOUND_QUANTILE)) if losses.size else np.inf for losses in together)
