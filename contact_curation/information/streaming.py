"""Selection from a stream, one toss at a time (method.md 1.7, 2.5): what the selectors of all criteria share."""

from typing import Protocol

from contact_curation.errors import InvalidValueError
from contact_curation.information.pool import check_comparable
from contact_curation.information.record import TossInformation


class Selector(Protocol):
    """Selects the best tosses of a stream. An id that was offered before changes nothing."""

    def offer(self, info: TossInformation) -> None:
        """Look at one toss.

        Raises:
            InvalidValueError: it was scored at another theta than the tosses before.
        """

    @property
    def selected(self) -> tuple[TossInformation, ...]:
        """The tosses selected now."""

    @property
    def seen(self) -> int:
        """How many different tosses were offered."""


class Seen:
    """Which ids were offered, and that all tosses were scored at one theta. Ids are remembered, information is not."""

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


def checked_top(top: int) -> int:
    """`top`, if that many tosses can be selected; InvalidValueError otherwise."""
    if top < 1:
        raise InvalidValueError("top", top, "at least 1 toss to keep")
    return top
