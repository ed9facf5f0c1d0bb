"""Selection from a stream, one toss at a time (METHOD 1.7, 2.5): what all selectors share, and the exact one for the trace.

The trace is a sum over tosses, so the k largest seen so far are the k largest of the stream: a heap of size k gives exactly
what ranking the whole pool gives, ties by id included, in any order of arrival.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from heapq import heappush, heapreplace
from typing import Protocol

from contact_curation.errors import InvalidValueError
from contact_curation.information.criteria.modular import NORMALISATIONS, toss_trace
from contact_curation.information.pool import check_comparable
from contact_curation.information.record import TossInformation


@dataclass(frozen=True)
class Change:
    """What an offer did to the selected set.

    Attributes:
        added: ids that are selected now and were not before.
        removed: ids that were selected before and are not now.
    """

    added: tuple[str, ...] = ()
    removed: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.added or self.removed)


NO_CHANGE = Change()


class Selector(Protocol):
    """Keeps the best tosses of a stream. An id that was offered before changes nothing."""

    def offer(self, info: TossInformation) -> Change:
        """Look at one toss; say what changed.

        Raises:
            InvalidValueError: it was scored at another theta than the tosses before.
        """

    @property
    def selected(self) -> tuple[TossInformation, ...]:
        """The tosses kept now."""

    @property
    def seen(self) -> int:
        """How many different tosses were offered."""


class Seen:
    """Which ids were offered, and that all tosses were scored at one theta. Ids are kept, information is not."""

    def __init__(self) -> None:
        self._ids: set[str] = set()
        self._first: TossInformation | None = None

    def __len__(self) -> int:
        return len(self._ids)

    def is_new(self, info: TossInformation) -> bool:
        """Whether this id comes for the first time; raises InvalidValueError on a toss scored at another theta."""
        if self._first is None:
            self._first = info
        check_comparable(self._first, info)
        known = info.toss_id in self._ids
        self._ids.add(info.toss_id)
        return not known


class TraceHeap:
    """The k tosses of the largest trace; O(log k) a toss."""

    def __init__(self, top: int, normalisation: str = "sum") -> None:
        """Keep `top` tosses by the trace of the Fisher sum, mean or coherent matrix.

        Raises:
            InvalidValueError: `top` is below 1, or there is no such normalisation.
        """
        self._top = checked_top(top)
        if normalisation not in NORMALISATIONS:
            raise InvalidValueError("normalisation", normalisation, f"one of {', '.join(NORMALISATIONS)}")
        self._normalisation = normalisation
        self._heap: list[_Member] = []
        self._seen = Seen()

    def offer(self, info: TossInformation) -> Change:
        """Look at one toss; say what changed.

        Raises:
            InvalidValueError: it was scored at another theta than the tosses before.
            NotScoredError: the mean is wanted of a toss without a scored transition.
        """
        member = _Member(toss_trace(info, self._normalisation), info)
        if not self._seen.is_new(info):
            return NO_CHANGE
        if len(self._heap) < self._top:
            heappush(self._heap, member)
            return Change(added=(info.toss_id,))
        if not self._heap[0] < member:
            return NO_CHANGE
        evicted = heapreplace(self._heap, member)
        return Change(added=(info.toss_id,), removed=(evicted.info.toss_id,))

    @property
    def selected(self) -> tuple[TossInformation, ...]:
        """The tosses kept now, best first."""
        return tuple(member.info for member in sorted(self._heap, reverse=True))

    @property
    def seen(self) -> int:
        """How many different tosses were offered."""
        return len(self._seen)


def difference(before: Sequence[TossInformation], after: Sequence[TossInformation]) -> Change:
    """The change from one selected set to another."""
    if after is before:
        return NO_CHANGE
    old = {info.toss_id for info in before}
    new = {info.toss_id for info in after}
    return Change(
        added=tuple(info.toss_id for info in after if info.toss_id not in old),
        removed=tuple(info.toss_id for info in before if info.toss_id not in new),
    )


def checked_top(top: int) -> int:
    """`top`, if that many tosses can be kept; InvalidValueError otherwise."""
    if top < 1:
        raise InvalidValueError("top", top, "at least 1 toss to keep")
    return top


@dataclass(frozen=True, eq=False)
class _Member:
    """A kept toss; a smaller trace, or the same trace and a larger id, is less."""

    score: float
    info: TossInformation

    def __lt__(self, other: "_Member") -> bool:
        return (self.score, other.info.toss_id) < (other.score, self.info.toss_id)
