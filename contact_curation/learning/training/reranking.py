"""The selection is made again while theta is learned: what teaches most at one theta need not at another (method.md 2.4).

Again after every n epochs, as the paper does, at each optimum of an exact training, or when canaries say so: a few tosses,
always the same ones, are scored and ranked at the current theta, and compared with their ranking at the theta of the last
selection. Only when their places have moved is the whole pool scored.

Each selection is made from nothing. A greedy pick takes a small part of the time that scoring does, so to start from
the tosses selected before would save little; and as it is, a selection depends on theta alone, not on how theta was reached.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from hashlib import sha256

import numpy as np

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
"""Of a training to the optimum: at the initial parameters, then at those that the last set taught."""


class Trigger(StrEnum):
    """Why a selection was made: the first one; so many epochs have passed; the canaries have moved; an optimum was reached."""

    FIRST = "first"
    EPOCHS = "epochs"
    CANARY = "canary"
    OPTIMUM = "optimum"


@dataclass(frozen=True)
class StalenessConfig:
    """When a selection is stale.

    Attributes:
        tosses: how many canaries there are.
        spearman: the selection is made again when their places correlate by less.
        overlap: or when less of their first ones are the same.
        steps: gradient steps between two looks at them.
    """

    tosses: int = 32
    spearman: float = 0.9
    overlap: float = 0.8
    steps: int = 50

    def __post_init__(self) -> None:
        if self.tosses < 2:
            raise InvalidValueError("canary.tosses", self.tosses, "at least 2")
        if self.steps < 1:
            raise InvalidValueError("canary.steps", self.steps, "at least 1")
        if not -1.0 <= self.spearman <= 1.0:
            raise InvalidValueError("canary.spearman", self.spearman, "a number from -1 to 1")
        if not 0.0 <= self.overlap <= 1.0:
            raise InvalidValueError("canary.overlap", self.overlap, "a number from 0 to 1")


@dataclass(frozen=True)
class RerankingConfig:
    """What is selected, and when again; without an occasion the first selection stays.

    Attributes:
        ranking: how tosses are ranked, and how many are selected.
        epochs: so many passes over the selected tosses; None for no such occasion.
        canary: None for no such occasion.
    """

    ranking: RankingConfig = field(default_factory=RankingConfig)
    epochs: int | None = None
    canary: StalenessConfig | None = None

    def __post_init__(self) -> None:
        if self.epochs is not None and self.epochs < 1:
            raise InvalidValueError("epochs between selections", self.epochs, "at least 1")


@dataclass(frozen=True)
class Selected:
    """What was selected, and why.

    Attributes:
        gradient_steps: taken until then.
        epochs: complete passes until then.
        trigger: why.
        toss_ids: ids, best first.
        canaries: ids of the canaries, best first.
        spearman: correlation of the canaries' places with those at the selection before; NaN at the first.
        overlap: share of their first ones that are the same; NaN likewise.
        retained: share of the selected tosses that were selected before; NaN likewise.
        not_scored: ids of tosses that could not be ranked.
    """

    gradient_steps: int
    epochs: int
    trigger: Trigger
    toss_ids: tuple[str, ...]
    canaries: tuple[str, ...]
    spearman: float = np.nan
    overlap: float = np.nan
    retained: float = np.nan
    not_scored: tuple[str, ...] = ()


class Reranking:
    """Selects from a pool, and remembers what it selected last.

    Args:
        tosses: the pool, at least one.
        scorer: what they teach.
        config: how they are ranked, and when again.
        selected: the last selection of another one with the same arguments, to go on from there.
    """

    def __init__(
        self, tosses: Sequence[Toss], scorer: TossScorer, config: RerankingConfig, selected: Selected | None = None
    ) -> None:
        self._tosses = tuple(tosses)
        self._scorer = scorer
        self._config = config
        self._canaries = _canaries(self._tosses, config.canary or StalenessConfig())
        share = config.ranking.top / max(len(self._tosses), 1)
        self._canary_top = min(len(self._canaries), max(round(share * len(self._canaries)), len(self._canaries) // 4, 1))
        self.selected = selected

    def select(self, model: Model, gradient_steps: int = 0, epochs: int = 0, trigger: Trigger = Trigger.FIRST) -> Selected:
        """Selects from the whole pool at a model's theta.

        Raises:
            InvalidValueError: no toss could be scored.
        """
        infos, not_scored = self._scored(model, self._tosses)
        ranking = rank_particles([pool_of(infos)], self._config.ranking)
        canary_ids = {toss.toss_id for toss in self._canaries}
        canaries = self._canary_ranking([info for info in infos if info.toss_id in canary_ids])
        moved = self._moved(canaries)
        before = self.selected.toss_ids if self.selected else ()
        toss_ids = ranking.selected_ids
        retained = len(set(toss_ids) & set(before)) / len(toss_ids) if before else np.nan
        self.selected = Selected(
            gradient_steps, epochs, trigger, toss_ids, canaries, moved[0], moved[1], retained, tuple(not_scored)
        )
        return self.selected

    def quiet_steps(self, gradient_steps: int, steps_of_epoch: int) -> int:
        """How many steps from the `gradient_steps` taken to the next occasion, if any; `steps_of_epoch` end the epoch."""
        canary = self._config.canary
        return steps_of_epoch if canary is None else min(steps_of_epoch, canary.steps - gradient_steps % canary.steps)

    def consider(self, model: Model, gradient_steps: int, epochs: int) -> Selected | None:
        """Selects again if there is an occasion; None if the last selection stays.

        Call it whenever `quiet_steps` have been taken: it looks at the canaries when that is due, and else costs nothing.

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
        last, canary = self.selected, self._config.canary
        if last is None:
            raise InvalidValueError("selection", "none", "a first one before another is considered")
        if not moved_by_theta(self._config.ranking.criterion) or gradient_steps == last.gradient_steps:
            return None
        if self._config.epochs is not None and epochs - last.epochs >= self._config.epochs:
            return Trigger.EPOCHS
        if canary is None or gradient_steps % canary.steps:
            return None
        infos, _ = self._scored(model, self._canaries)
        correlation, overlap = self._moved(self._canary_ranking(infos))
        return Trigger.CANARY if not (correlation >= canary.spearman and overlap >= canary.overlap) else None

    def _scored(self, model: Model, tosses: Sequence[Toss]) -> tuple[list[TossInformation], list[str]]:
        scores = self._scorer(model, tosses)
        infos = [one for one in scores if isinstance(one, TossInformation)]
        return infos, [one.toss_id for one in scores if isinstance(one, NotScored)]

    def _canary_ranking(self, infos: Sequence[TossInformation]) -> tuple[str, ...]:
        """The canaries that were scored, best first."""
        alone = replace(self._config.ranking, top=self._canary_top, certificate_steps=0)
        return rank_particles([pool_of(infos)], alone).ids if infos else ()

    def _moved(self, canaries: tuple[str, ...]) -> tuple[float, float]:
        """Spearman correlation and overlap with the canaries of the last selection; NaN where there are none to compare."""
        before = self.selected.canaries if self.selected else ()
        if len(set(before) & set(canaries)) < 2:
            return np.nan, np.nan
        one, other = _as_ranking(before), _as_ranking(canaries)
        return spearman(one, other), top_overlap(one, other, min(self._canary_top, len(before), len(canaries)))


def _canaries(tosses: Sequence[Toss], config: StalenessConfig) -> tuple[Toss, ...]:
    """Those with the smallest digests of their ids: as good as random, and the same in any order."""
    return tuple(sorted(tosses, key=lambda toss: sha256(toss.toss_id.encode()).digest())[: config.tosses])


def _as_ranking(ids: Sequence[str]) -> Ranking:
    return Ranking("", tuple(RankedToss(toss_id, place, np.nan, np.nan, False) for place, toss_id in enumerate(ids, start=1)))
