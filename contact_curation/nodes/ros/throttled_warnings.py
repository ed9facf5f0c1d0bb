"""Counts faulty messages by kind, and logs each kind at most once per period."""

from collections import Counter

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from contact_curation.errors import CONTROLS
from contact_curation.motion.toss import NANOSECONDS

PAUSE = 30.0
"""Time until the same kind of fault is logged again, on the steady clock [s]."""


class ThrottledWarnings:
    """Counts faults by kind, and logs them through `node`."""

    def __init__(self, node: Node) -> None:
        self._logger = node.get_logger()
        self._counts: Counter[str] = Counter()
        self._said: dict[str, int] = {}
        self._clock = Clock(clock_type=ClockType.STEADY_TIME)

    @property
    def counts(self) -> dict[str, int]:
        """Number of faults of each kind."""
        return dict(self._counts)

    def note(self, kind: str, what: str, *, dropped: bool = True) -> None:
        """Counts a fault, and logs it unless its kind was logged within the last period.

        Args:
            kind: name under which it is counted.
            what: what was found, in one line.
            dropped: whether something that came is dropped for it, as the line then says.
        """
        self._counts[kind] += 1
        last, now = self._said.get(kind), self._clock.now().nanoseconds
        if last is None or now - last >= PAUSE * NANOSECONDS:
            self._said[kind] = now
            again = f" ({self._counts[kind]} times so far)" if last is not None else ""
            self._logger.warning(f"{kind}: {what}{again}{'; dropped' if dropped else ''}".translate(CONTROLS))
