"""When, by the log times of a recording, a toss happened, with as much around it as cutting it again takes.

Tosses are known by header stamps, messages are recorded by log times, and the two may be years apart. So the log times of the
poses are noted with their stamps while the recording is read, and a toss's stamps are looked up there.
"""

from array import array
from bisect import bisect_right
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from contact_curation.storage.bags.records import BagMessage
from contact_curation.storage.inputs.pose_messages import stamp_ns_of


class Window(NamedTuple):
    """Log times, both ends included [ns]."""

    first_ns: int
    last_ns: int

    def wider(self, by_ns: int) -> "Window":
        return Window(self.first_ns - by_ns, self.last_ns + by_ns)


class Places(NamedTuple):
    """Messages by their place among those of the body's topic, both ends included."""

    low: int
    high: int


class Windows:
    """Windows, joined where they overlap."""

    def __init__(self, windows: Iterable[Window]) -> None:
        self._joined: list[Window] = []
        for one in sorted(windows):
            if self._joined and one.first_ns <= self._joined[-1].last_ns:
                before = self._joined.pop()
                one = Window(before.first_ns, max(before.last_ns, one.last_ns))
            self._joined.append(one)
        self._starts = [one.first_ns for one in self._joined]

    def holds(self, log_time_ns: int) -> bool:
        """Whether a time is in one of them."""
        place = bisect_right(self._starts, log_time_ns) - 1
        return place >= 0 and log_time_ns <= self._joined[place].last_ns

    def over(self, log_time_ns: int) -> bool:
        """Whether all of them end before a time."""
        return not self._joined or self._joined[-1].last_ns < log_time_ns


class PoseTimes:
    """Stamps and log times of the messages of one topic, in the order in which they are read."""

    def __init__(self) -> None:
        self._stamps, self._logs = array("q"), array("q")

    def __len__(self) -> int:
        return len(self._stamps)

    def note(self, message: BagMessage) -> None:
        """Takes in a message; one without a stamp is passed over."""
        stamp_ns = _stamp_of(message.message)
        if stamp_ns is not None:
            self._stamps.append(stamp_ns)
            self._logs.append(message.log_time_ns)

    def places(self, first_ns: int, last_ns: int, end: int) -> Places | None:
        """Where the poses of a toss are.

        Args:
            first_ns: its first stamp.
            last_ns: its last stamp.
            end: how many messages had been read when it was complete.

        Returns:
            None where no message has such stamps.
        """
        stamps = np.frombuffer(self._stamps, dtype=np.int64)[:end]
        starts = np.flatnonzero(stamps == first_ns)
        if not len(starts):  # of a message with several transforms only the first one's stamp is noted
            starts = np.flatnonzero(stamps <= first_ns)
        if not len(starts):
            return None
        low = int(starts[-1])
        inside = np.flatnonzero((stamps[low:] >= first_ns) & (stamps[low:] <= last_ns))
        return Places(low, low + int(inside.max(initial=0)))

    def with_margins(self, places: Places, before_ns: int, after_ns: int) -> Places:
        """The places with as much around them, by the stamps."""
        stamps = np.frombuffer(self._stamps, dtype=np.int64)
        low, high = places
        first_ns, last_ns = int(stamps[low]), int(stamps[high])
        while low > 0 and first_ns - before_ns <= stamps[low - 1] <= last_ns:
            low -= 1
        while high + 1 < len(stamps) and first_ns <= stamps[high + 1] <= last_ns + after_ns:
            high += 1
        return Places(low, high)

    def window(self, places: Places) -> Window:
        """The log times of some messages."""
        logs = np.frombuffer(self._logs, dtype=np.int64)[places.low : places.high + 1]
        return Window(int(logs.min()), int(logs.max()))


def _stamp_of(message: Any) -> int | None:
    """Of the header, or of the first transform."""
    try:
        return stamp_ns_of(message.header if hasattr(message, "header") else message.transforms[0].header)
    except (AttributeError, IndexError, TypeError, ValueError):
        return None
