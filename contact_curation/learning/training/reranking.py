"""Selects tosses again during training: the most informative tosses at one theta need not be so at another (method.md 2.4).

A selection is repeated after every n epochs, as in the paper, at each optimum of an exact training, or when it is stale. To
find out, a small fixed sample of the pool, the monitored tosses, is scored and ranked at the current theta, and the ranking is
compared with theirs at the theta of the last selection. The whole pool is scored only when their ranks have changed.

Each selection starts from an empty set. Greedy picks take little time beside scoring, so a start from the previous selection
would save little, and this way a selection depends on theta alone, and not on the steps that led to it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from hashlib import sha256

import numpy as np

from contact_curation.configs import set_whole_numbers
from contact_curation.contact.models.model import Model
from contact_curation.errors import InvalidValueError
from contact_curation.information.pool import pool_of
from contact_curation.information.ranker import RankingConfig, moved_by_theta, rank_particles
from contact_curation.information.ranking import RankedToss, Ranking, spearman, top_overlap
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import NotScored
from contact_curation.motion.toss import Toss

type TossScorer = Callable[[Model, Sequence[Toss]], Sequence[TossInformation | NotScored]]
"""The information of each toss about a model as it is now, in the order given."""

EXACT_SELECTIONS = 3
"""Selections in a training to the optimum: one at the initial parameters, then at the fit to the last set."""


class Trigger(StrEnum):
    """Why a selection was made: it was the first, epochs had passed, the last one was stale, or an optimum was reached."""

    FIRST = "first"
    EPOCHS = "epochs"
    STALE = "stale"
    OPTIMUM = "optimum"


@dataclass(frozen=True)
class StalenessConfig:
    """When a selection is stale: the ranks of the monitored tosses have changed since.

    Attributes:
        tosses: number of monitored tosses.
        spearman: the selection is stale when the rank correlation with the last ranking is lower than this.
        overlap: it is also stale when the share of monitored tosses that stayed among the best is lower than this.
        steps: gradient steps between two checks.
    """

    tosses: int = 32
    spearman: float = 0.9
    overlap: float = 0.8
    steps: int = 50

    def __post_init__(self) -> None:
        set_whole_numbers(self, ("tosses",), 2, prefix="staleness.")
        set_whole_numbers(self, ("steps",), 1, prefix="staleness.")
        if not -1.0 <= self.spearman <= 1.0:
            raise InvalidValueError("staleness.spearman", self.spearman, "a number from -1 to 1")
        if not 0.0 <= self.overlap <= 1.0:
            raise InvalidValueError("staleness.overlap", self.overlap, "a number from 0 to 1")


@dataclass(frozen=True)
class RerankingConfig:
    """How to select, and when to select again; with neither `epochs` nor `staleness` the first selection stays.

    Attributes:
        ranking: how tosses are ranked, and how many are selected.
        epochs: passes over the selected tosses between two selections; None for no limit.
        staleness: when to select again because ranks have changed; None for never.
    """

    ranking: RankingConfig = field(default_factory=RankingConfig)
    epochs: int | None = None
    staleness: StalenessConfig | None = None

    def __post_init__(self) -> None:
        if self.epochs is not None and self.epochs < 1:
            raise InvalidValueError("epochs between selections", self.epochs, "at least 1")


@dataclass(frozen=True)
class Selected:
    """A selection, and why it was made.

    Attributes:
        gradient_steps: taken until then.
        epochs: complete passes until then.
        trigger: why.
        toss_ids: ids, best first.
        monitored: ids of the monitored tosses, best first.
        spearman: rank correlation of the monitored tosses with the previous selection; NaN at the first.
        overlap: share of the best monitored tosses that are still among the best; NaN at the first.
        retained: share of the selected tosses that were selected before; NaN at the first.
        not_scored: ids of tosses that could not be ranked.
    """

    gradient_steps: int
    epochs: int
    trigger: Trigger
    toss_ids: tuple[str, ...]
    monitored: tuple[str, ...]
    spearman: float = np.nan
    overlap: float = np.nan
    retained: float = np.nan
    not_scored: tuple[str, ...] = ()


class Reranking:
    """Selects from a pool, and remembers what it selected last.

    Args:
        tosses: the pool, at least one.
        scorer: gives the information of tosses about a model.
        config: how to rank, and when to select again.
        selected: the last selection, to go on from a checkpoint.
    """

    def __init__(
        self, tosses: Sequence[Toss], scorer: TossScorer, config: RerankingConfig, selected: Selected | None = None
    ) -> None:
        self._tosses = tuple(tosses)
        self._scorer = scorer
        self._config = config
        self._monitored = _monitored(self._tosses, config.staleness or StalenessConfig())
        share = config.ranking.top / max(len(self._tosses), 1)
        self._monitored_top = min(len(self._monitored), max(round(share * len(self._monitored)), len(self._monitored) // 4, 1))
        self.selected = selected

    def select(self, model: Model, gradient_steps: int = 0, epochs: int = 0, trigger: Trigger = Trigger.FIRST) -> Selected:
        """Selects from the whole pool at a model's theta.

        Raises:
            InvalidValueError: no toss could be scored.
        """
        infos, not_scored = self._scored(model, self._tosses)
        ranking = rank_particles([pool_of(infos)], self._config.ranking)
        monitored_ids = {toss.toss_id for toss in self._monitored}
        monitored = self._monitored_ranking([info for info in infos if info.toss_id in monitored_ids])
        moved = self._moved(monitored)
        before = self.selected.toss_ids if self.selected else ()
        toss_ids = ranking.selected_ids
        retained = len(set(toss_ids) & set(before)) / len(toss_ids) if before else np.nan
        self.selected = Selected(
            gradient_steps, epochs, trigger, toss_ids, monitored, moved[0], moved[1], retained, tuple(not_scored)
        )
        return self.selected

    def quiet_steps(self, gradient_steps: int, steps_of_epoch: int) -> int:
        """How many steps from the `gradient_steps` taken to the next occasion, if any; `steps_of_epoch` end the epoch."""
        staleness = self._config.staleness
        return steps_of_epoch if staleness is None else min(steps_of_epoch, staleness.steps - gradient_steps % staleness.steps)

    def consider(self, model: Model, gradient_steps: int, epochs: int) -> Selected | None:
        """Selects again if there is an occasion; None if the last selection stays.

        Call it whenever `quiet_steps` have been taken. It scores the monitored tosses when they are due.

        Raises:
            InvalidValueError: as in `select`; or nothing was selected yet.
        """
        trigger = self._occasion(model, gradient_steps, epochs)
        return self.select(model, gradient_steps, epochs, trigger) if trigger else None

    def at_optimum(self, model: Model, gradient_steps: int, epochs: int) -> Selected | None:
        """Selects again at the optimum of the last selection, once; None if no theta moves the criterion.

        Raises:
            InvalidValueError: as in `select`.
        """
        known = self.selected is not None and gradient_steps == self.selected.gradient_steps
        if known or not moved_by_theta(self._config.ranking.criterion):
            return None
        return self.select(model, gradient_steps, epochs, Trigger.OPTIMUM)

    def _occasion(self, model: Model, gradient_steps: int, epochs: int) -> Trigger | None:
        last, staleness = self.selected, self._config.staleness
        if last is None:
            raise InvalidValueError("selection", "none", "a first one before another is considered")
        if not moved_by_theta(self._config.ranking.criterion) or gradient_steps == last.gradient_steps:
            return None
        if self._config.epochs is not None and epochs - last.epochs >= self._config.epochs:
            return Trigger.EPOCHS
        if staleness is None or gradient_steps % staleness.steps:
            return None
        infos, _ = self._scored(model, self._monitored)
        correlation, overlap = self._moved(self._monitored_ranking(infos))
        return Trigger.STALE if not (correlation >= staleness.spearman and overlap >= staleness.overlap) else None

    def _scored(self, model: Model, tosses: Sequence[Toss]) -> tuple[list[TossInformation], list[str]]:
        scores = self._scorer(model, tosses)
        infos = [one for one in scores if isinstance(one, TossInformation)]
        return infos, [one.toss_id for one in scores if isinstance(one, NotScored)]

    def _monitored_ranking(self, infos: Sequence[TossInformation]) -> tuple[str, ...]:
        """The monitored tosses that could be scored, best first."""
        alone = replace(self._config.ranking, top=self._monitored_top, certificate_steps=0)
        return rank_particles([pool_of(infos)], alone).ids if infos else ()

    def _moved(self, monitored: tuple[str, ...]) -> tuple[float, float]:
        """Rank correlation and overlap with the monitored tosses of the last selection; NaN without a common pair."""
        before = self.selected.monitored if self.selected else ()
        if len(set(before) & set(monitored)) < 2:
            return np.nan, np.nan
        one, other = _as_ranking(before), _as_ranking(monitored)
        return spearman(one, other), top_overlap(one, other, min(self._monitored_top, len(before), len(monitored)))


def _monitored(tosses: Sequence[Toss], config: StalenessConfig) -> tuple[Toss, ...]:
    """The tosses with the smallest digests of their ids: a pseudo-random sample that does not depend on their order."""
    return tuple(sorted(tosses, key=lambda toss: sha256(toss.toss_id.encode()).digest())[: config.tosses])


def _as_ranking(ids: Sequence[str]) -> Ranking:
    return Ranking("", tuple(RankedToss(toss_id, place, np.nan, np.nan, False) for place, toss_id in enumerate(ids, start=1)))
