"""Steady time that passes only while someone works: what a watchdog of simulated motion has to count.

A process that gets no processor moves nothing; when it wakes up, its own silence is no failed heartbeat. So the one who works
ticks, and of the time between two ticks no more than a share counts. The clock never jumps and never goes back.
"""

import threading
from collections.abc import Callable


class AwakeClock:
    """May be asked from any thread; one thread ticks.

    Args:
        steady: a steady clock [s].
        longest: what counts of the time between two ticks at most [s].
    """

    def __init__(self, steady: Callable[[], float], longest: float) -> None:
        self._steady, self._longest = steady, longest
        self._lock = threading.Lock()
        self._passed, self._ticked = 0.0, steady()

    def now(self) -> float:
        """Time that has passed since it was made [s]."""
        with self._lock:
            return self._passed + min(self._steady() - self._ticked, self._longest)

    def tick(self) -> float:
        """Work goes on; gives the time."""
        with self._lock:
            steady = self._steady()
            self._passed += min(steady - self._ticked, self._longest)
            self._ticked = steady
            return self._passed
