"""When a recorded message is due: the recording's time runs at a rate, stands still, or jumps.

Times of the steady clock are passed in, in nanoseconds; nothing here waits.
"""

import threading

from contact_curation.errors import InvalidValueError


class Pace:
    """Maps recorded time to the steady clock; may be used from several threads.

    Args:
        rate: recorded seconds a second.
        paused: whether it stands still at first.
    """

    def __init__(self, rate: float, paused: bool) -> None:
        self._lock = threading.Lock()
        self._rate = checked_rate(rate)
        self._paused = paused
        self._recorded_ns = 0
        self._steady_ns = 0
        self._begun = False

    @property
    def begun(self) -> bool:
        """Whether there is a recorded time yet."""
        return self._begun

    @property
    def paused(self) -> bool:
        """Whether it stands still."""
        return self._paused

    def begin(self, recorded_ns: int, steady_ns: int) -> None:
        """Jumps to a recorded time."""
        with self._lock:
            self._recorded_ns, self._steady_ns, self._begun = recorded_ns, steady_ns, True

    def pause(self, paused: bool, steady_ns: int) -> None:
        """Stands still, or goes on from where it stood."""
        with self._lock:
            self._recorded_ns, self._steady_ns = self._now(steady_ns), steady_ns
            self._paused = paused

    def set_rate(self, rate: float, steady_ns: int) -> None:
        """Goes on at another rate.

        Raises:
            InvalidValueError: the rate is not positive.
        """
        with self._lock:
            self._recorded_ns, self._steady_ns = self._now(steady_ns), steady_ns
            self._rate = checked_rate(rate)

    def now(self, steady_ns: int) -> int:
        """Recorded time [ns]."""
        with self._lock:
            return self._now(steady_ns)

    def wait_ns(self, recorded_ns: int, steady_ns: int) -> float:
        """How long until a recorded time, by the steady clock; infinite while it stands still; not positive: it is due."""
        with self._lock:
            ahead = recorded_ns - self._now(steady_ns)
            if ahead > 0 and self._paused:
                return float("inf")
            return ahead / self._rate

    def _now(self, steady_ns: int) -> int:
        return self._recorded_ns + (0 if self._paused else int((steady_ns - self._steady_ns) * self._rate))


def checked_rate(rate: float) -> float:
    """The rate, if time can run at it."""
    if not 0.0 < rate < float("inf"):
        raise InvalidValueError("rate", rate, "a positive number")
    return rate
