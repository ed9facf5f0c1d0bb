"""A ranking: every toss of a pool, the kept ones first, each with the evidence for its place."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.information.criteria.certificate import Certificate
from contact_curation.information.criteria.ties import descending
from contact_curation.information.pool import Indices


class RankedToss(NamedTuple):
    """One toss of a ranking.

    Attributes:
        toss_id: the toss.
        rank: its place, from 1.
        score: what the criterion says of the toss alone.
        marginal_gain: what it added when it was picked; for a toss that is not kept, what it would add to the kept ones.
        kept: whether it is one of the top k.
    """

    toss_id: str
    rank: int
    score: float
    marginal_gain: float
    kept: bool


@dataclass(frozen=True)
class Ranking:
    """All tosses, best first: the kept ones in the order of their selection, then the others by what they would still add.

    Attributes:
        criterion: its name.
        entries: one per toss.
        certificate: proven bounds on the kept set's D-efficiency; log-det only.
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
    def kept_ids(self) -> tuple[str, ...]:
        """The ids of the top k, best first."""
        return tuple(entry.toss_id for entry in self.entries if entry.kept)


@dataclass(frozen=True, eq=False)
class Selection:
    """What a criterion says of a pool of K tosses; indices are places in the pool.

    Attributes:
        order: (K,) all tosses, best first; the first k are kept.
        scores: (K,) what the criterion says of each toss alone, in the order of the pool.
        gains: (K,) marginal gains as in `RankedToss`, in the order of the pool.
        kept: k.
        certificate: see `Ranking`.
        diagnostics: see `Ranking`.
    """

    order: Indices
    scores: Array
    gains: Array
    kept: int
    certificate: Certificate | None = None
    diagnostics: tuple[str, ...] = ()


def modular_selection(scores: Array, top: int, *, exact: bool = False) -> Selection:
    """The selection of a criterion that is a sum of scores (K,) over tosses (Algorithm 1, METHOD 1.7).

    Args:
        scores: (K,) in the order of the pool.
        top: how many tosses to keep.
        exact: only equal scores tie, as for scores that do not depend on how tosses are batched.
    """
    order = descending(scores, 0.0, 0.0) if exact else descending(scores)
    return Selection(order, scores, scores, min(top, scores.size))


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
        final_gains: (K,) what each toss would add to the kept ones; not read for the picks.
        certificate: see `Ranking`.
        diagnostics: see `Ranking`.
    """
    others = descending(final_gains)
    order = np.concatenate([picks, others[~np.isin(others, picks)]])
    gains = final_gains.copy()
    gains[picks] = pick_gains
    return Selection(order, scores, gains, picks.size, certificate, diagnostics)


def ranking_of(criterion: str, ids: Sequence[str], selection: Selection) -> Ranking:
    """The ranking that a selection from the tosses `ids` amounts to."""
    scores, gains = selection.scores.tolist(), selection.gains.tolist()
    places = enumerate(selection.order.tolist(), start=1)
    entries = tuple(RankedToss(ids[i], rank, scores[i], gains[i], rank <= selection.kept) for rank, i in places)
    return Ranking(criterion, entries, selection.certificate, selection.diagnostics)
