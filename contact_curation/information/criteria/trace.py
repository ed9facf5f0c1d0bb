"""trace: tr F of the Fisher sum, mean or coherent matrix: the paper's ranking (method.md 1.5, 1.7).

The trace is a sum over tosses, so that the best set is simply the top k, and the k largest seen so far are the k largest of a
stream: a heap of size k gives exactly what ranking the whole pool gives, ties by id included, in any order of arrival.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from heapq import heappush, heapreplace

import numpy as np

from contact_curation.errors import NotScoredError, UnknownNameError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.criteria.criterion import Criterion, Explanation, RankingConfig, register
from contact_curation.information.criteria.explanation import by_log_det, place_by
from contact_curation.information.diagnostics import block_shares, dominance_warnings
from contact_curation.information.pool import Pool
from contact_curation.information.ranking import Selection, mean_over_particles, modular_selection
from contact_curation.information.record import TossInformation
from contact_curation.information.streaming import Seen, checked_top

NORMALISATIONS = ("sum", "mean", "coherent")


def toss_trace(info: TossInformation, normalisation: str = "sum") -> float:
    """Trace of a toss's Fisher sum, mean or coherent matrix.

    Raises:
        NotScoredError: the mean is wanted of a toss without a scored transition.
        InvalidValueError: the normalisation is none of `NORMALISATIONS`.
    """
    if normalisation == "sum":
        return info.trace
    if normalisation == "coherent":
        return float(info.score_sum @ info.score_sum)
    if normalisation != "mean":
        raise UnknownNameError("normalisation", normalisation, NORMALISATIONS)
    scored = info.transitions - info.not_scored
    if scored < 1:
        raise NotScoredError(info.toss_id, f"none of its {info.transitions} transitions has a certified impulse")
    return info.trace / scored


def traces(pool: Pool, normalisation: str = "sum") -> Array:
    """Traces (K,) of the tosses of a pool; errors as in `toss_trace`."""
    return np.array([toss_trace(info, normalisation) for info in pool.infos])


class TraceHeap:
    """The k tosses of the largest trace; O(log k) a toss."""

    def __init__(self, top: int, normalisation: str = "sum") -> None:
        """Select `top` tosses by the trace of the Fisher sum, mean or coherent matrix.

        Raises:
            InvalidValueError: `top` is below 1, or there is no such normalisation.
        """
        self._top = checked_top(top)
        if normalisation not in NORMALISATIONS:
            raise UnknownNameError("normalisation", normalisation, NORMALISATIONS)
        self._normalisation = normalisation
        self._heap: list[_Member] = []
        self._seen = Seen()

    def offer(self, info: TossInformation) -> None:
        """Look at one toss.

        Raises:
            InvalidValueError: it was scored at another theta than the tosses before.
            NotScoredError: the mean is wanted of a toss without a scored transition.
        """
        member = _Member(toss_trace(info, self._normalisation), info)
        if not self._seen.is_new(info):
            return
        if len(self._heap) < self._top:
            heappush(self._heap, member)
        elif self._heap[0] < member:
            heapreplace(self._heap, member)

    @property
    def selected(self) -> tuple[TossInformation, ...]:
        """The tosses selected now, best first."""
        return tuple(member.info for member in sorted(self._heap, reverse=True))

    @property
    def seen(self) -> int:
        """How many different tosses were offered."""
        return len(self._seen)


@dataclass(frozen=True, eq=False)
class _Member:
    """A selected toss; a smaller trace, or the same trace and a larger id, is less."""

    score: float
    info: TossInformation

    def __lt__(self, other: "_Member") -> bool:
        return (self.score, other.info.toss_id) < (other.score, self.info.toss_id)


def _select(pools: Sequence[Pool], config: RankingConfig) -> Selection:
    scores = mean_over_particles([traces(pool, config.normalisation) for pool in pools])
    selection = modular_selection(scores, config.top, exact=len(pools) == 1)
    return replace(selection, diagnostics=dominance_warnings(block_shares(pools[0].infos)))


def _stream(first: Sequence[TossInformation], config: RankingConfig) -> TraceHeap:
    heap = TraceHeap(config.top, config.normalisation)
    for info in first:
        heap.offer(info)
    return heap


def _explain(pool: Pool, selected: Mapping[str, float], config: RankingConfig) -> Explanation:
    smallest = min(selected.values())
    what = "trace" if config.normalisation == "sum" else f"{config.normalisation} trace"
    return by_log_det(pool, selected, config, place_by(TRACE.name), lambda gain: f"not selected: {what} below {smallest:.3g}")


TRACE = register(
    Criterion(
        "trace",
        "trace of the toss's Fisher matrix",
        "characteristic units",
        _select,
        stream=_stream,
        choices={"normalisation": NORMALISATIONS},
        explain=_explain,
    )
)
