"""A ranking: every toss of a pool, the selected ones first, each with the evidence for its place; and how alike two are."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from contact_curation.configs import whole_number
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.numbers import numbers
from contact_curation.geometry.quaternions import Array
from contact_curation.information.pool import Indices
from contact_curation.information.ties import descending


@dataclass(frozen=True)
class Certificate:
    """Proven lower bounds on the D-efficiency of a selected set, from 0 to 1; the prior counts on both sides.

    Attributes:
        kiefer_wolfowitz: against every weighting and repetition of the pool's tosses with total weight k.
        subset: against every set of k different tosses; never below the other.
    """

    kiefer_wolfowitz: float
    subset: float


class RankedToss(NamedTuple):
    """One toss of a ranking.

    Attributes:
        toss_id: the toss.
        rank: its place, from 1.
        score: what the criterion says of the toss alone.
        marginal_gain: what it added when it was picked; for one that is not selected, what it would add to those that are.
        selected: whether it is one of the top k.
    """

    toss_id: str
    rank: int
    score: float
    marginal_gain: float
    selected: bool


@dataclass(frozen=True)
class Ranking:
    """All tosses, best first: the selected ones in the order of their selection, then the others by what they would still add.

    Attributes:
        criterion: its name.
        entries: one per toss.
        certificate: proven bounds on the selected set's D-efficiency; log-det only.
        diagnostics: sentences about what to be careful with.
    """

    criterion: str
    entries: tuple[RankedToss, ...]
    certificate: Certificate | None = None
    diagnostics: tuple[str, ...] = ()

    @cached_property
    def ids(self) -> tuple[str, ...]:
        """All ids, best first."""
        return tuple(entry.toss_id for entry in self.entries)

    @cached_property
    def selected_ids(self) -> tuple[str, ...]:
        """The ids of the top k, best first."""
        return tuple(entry.toss_id for entry in self.entries if entry.selected)


@dataclass(frozen=True, eq=False)
class Selection:
    """What a criterion says of a pool of K tosses; indices are places in the pool.

    Attributes:
        order: (K,) all tosses, best first; the first k are selected.
        scores: (K,) what the criterion says of each toss alone, in the order of the pool; finite.
        gains: (K,) finite marginal gains as in `RankedToss`, in the order of the pool.
        count: k, how many are selected.
        certificate: see `Ranking`.
        diagnostics: see `Ranking`.
    """

    order: Indices
    scores: Array
    gains: Array
    count: int
    certificate: Certificate | None = None
    diagnostics: tuple[str, ...] = ()


def modular_selection(scores: Array, top: int, *, exact: bool = False) -> Selection:
    """The selection of a criterion that is a sum of scores (K,) over tosses (Algorithm 1, method.md 1.7).

    Args:
        scores: (K,) in the order of the pool.
        top: how many tosses to select.
        exact: only equal scores tie, as for scores that do not depend on how tosses are batched.
    """
    scores = np.asarray(scores, dtype=np.float64)
    order = descending(scores, 0.0, 0.0) if exact else descending(scores)
    return Selection(order, scores, scores, min(top, scores.size))


def mean_over_particles(scores: Sequence[Array]) -> Array:
    """Scores (K,): as they are for one particle, otherwise the mean of those divided by their mean over the tosses.

    Their units differ from one theta to another (method.md 2.4).
    """
    if len(scores) == 1:
        return scores[0]
    return np.asarray(np.mean([each / (float(each.mean()) or 1.0) for each in scores], axis=0))


def greedy_selection(
    picks: Indices,
    pick_gains: Array,
    scores: Array,
    final_gains: Array,
    certificate: Certificate | None = None,
    diagnostics: tuple[str, ...] = (),
) -> Selection:
    """The selection of a criterion that picked tosses one by one.

    Args:
        picks: (k,) in the order of selection.
        pick_gains: (k,) what each added when it was picked.
        scores: (K,) in the order of the pool.
        final_gains: (K,) what each toss would add to the selected ones; not read for the picks.
        certificate: see `Ranking`.
        diagnostics: see `Ranking`.
    """
    gains = np.array(final_gains, dtype=np.float64)
    others = descending(gains)
    order = np.concatenate([picks, others[~np.isin(others, picks)]])
    gains[picks] = pick_gains
    return Selection(order, scores, gains, picks.size, certificate, diagnostics)


def ranking_of(criterion: str, ids: Sequence[str], selection: Selection, top: int) -> Ranking:
    """The ranking that a selection of at most `top` of the tosses `ids` amounts to.

    Raises:
        InvalidValueError: it is no such selection, as of a criterion of one's own: a score or gain that is not finite, not one
            for each toss, a toss twice in the order or not at all, or none or too many selected.
    """
    scores = _one_for_each_toss(selection.scores, f"scores by criterion {criterion}", ids)
    gains = _one_for_each_toss(selection.gains, f"gains by criterion {criterion}", ids)
    order = numbers(f"order by criterion {criterion}", selection.order).ravel().tolist()
    if sorted(order) != list(range(len(ids))):
        found = f"{len(order)} places, {len(set(order))} different"
        raise InvalidValueError(f"order by criterion {criterion}", found, f"each place from 0 to {len(ids) - 1} once")
    count = whole_number(f"count by criterion {criterion}", selection.count, 1, min(top, len(ids)))
    places = enumerate(map(int, order), start=1)
    entries = tuple(RankedToss(ids[i], rank, scores[i], gains[i], rank <= count) for rank, i in places)
    return Ranking(criterion, entries, selection.certificate, selection.diagnostics)


def _one_for_each_toss(values: Array, name: str, ids: Sequence[str]) -> list[float]:
    values = numbers(name, values)
    if values.shape != (len(ids),):
        raise InvalidValueError(name, f"shape {values.shape}", f"({len(ids)},), one for each toss")
    listed: list[float] = values.tolist()
    for toss_id, value in zip(ids, listed, strict=True):
        if not math.isfinite(value):
            raise InvalidValueError(f"{name} of toss {toss_id}", value, "a finite number")
    return listed


def spearman(one: Ranking, other: Ranking) -> float:
    """Spearman's rank correlation of two rankings (method.md 2.4), from -1 to 1, over the tosses in both.

    Raises:
        InvalidValueError: they share fewer than two tosses.
    """
    from scipy.stats import spearmanr  # takes a second to import

    places = {entry.toss_id: entry.rank for entry in other.entries}
    pairs = [(entry.rank, places[entry.toss_id]) for entry in one.entries if entry.toss_id in places]
    if len(pairs) < 2:
        raise InvalidValueError("tosses in both rankings", len(pairs), "at least 2")
    return float(spearmanr(*np.transpose(pairs)).statistic)


def top_overlap(one: Ranking, other: Ranking, top: int) -> float:
    """Share of the first `top` tosses that the two have in common, from 0 to 1.

    Raises:
        InvalidValueError: `top` is below 1, or a ranking is shorter than that.
    """
    shortest = min(len(one.ids), len(other.ids))
    if not 1 <= top <= shortest:
        raise InvalidValueError("top", top, f"1 to {shortest}, the length of the shorter ranking")
    return len(set(one.ids[:top]) & set(other.ids[:top])) / top
