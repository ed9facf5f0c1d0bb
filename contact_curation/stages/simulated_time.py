"""The clocks of the simulated arm: stamps that never go back, a watchdog's time, and the pace of the simulation.

A stamp is given only when a file says that time up to it is used, so that a node that starts again goes on behind every stamp
it has ever given. So that this does not take a write for each, time is reserved ahead, a block at a time; an orderly end gives
back what is left of it.
"""

import threading
from collections.abc import Callable
from pathlib import Path

from contact_curation.motion.toss import NANOSECONDS
from contact_curation.simulation.arm.throw_motion import FRAME_PERIOD
from contact_curation.stages.records import UsedTime, read_record, write_record

BLOCK = 60 * NANOSECONDS
"""Of simulated time, reserved at once [ns]."""

LAG = 0.5
"""A simulation that is later than this does not try to catch up [s]."""


class SimulatedTime:
    """Stamps of one run, behind those of the runs before it.

    Args:
        path: of the file that remembers; None for none.
        epoch_ns: at which time begins, unless an earlier run got further.

    Raises:
        UnreadableInputError: the file is there and holds something else.
        InvalidValueError: the file cannot be written there.
    """

    def __init__(self, path: Path | None, epoch_ns: int) -> None:
        self._path = path
        used = None if path is None else read_record(path, UsedTime)
        self._begin_ns = max(epoch_ns, 0 if used is None else used.used_until_ns)
        self._next_ns = self._reserved_ns = self._begin_ns
        self.stamp_ns(0.0)

    def stamp_ns(self, seconds: float) -> int:
        """The stamp of a time since this run began."""
        stamp = self._begin_ns + round(seconds * NANOSECONDS)
        if stamp >= self._reserved_ns:
            self._reserved_ns = stamp + BLOCK
            self._write(self._reserved_ns)
        self._next_ns = max(self._next_ns, stamp + 1)
        return stamp

    def close(self) -> None:
        """Gives back what was reserved and not used."""
        self._write(self._next_ns)

    def _write(self, used_until_ns: int) -> None:
        if self._path is not None:
            write_record(self._path, UsedTime(used_until_ns))


class AwakeClock:
    """Steady time that passes only while someone works: what a watchdog of simulated motion has to count.

    A process that gets no processor moves nothing; when it wakes up, its own silence is no failed heartbeat. So the one who
    works ticks, and of the time between two ticks no more than a share counts. The clock never jumps and never goes back. It
    may be asked from any thread; one thread ticks.

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


class RateLimiter:
    """How long a simulation has to wait so that it runs at a rate.

    Args:
        rate: simulated seconds per second; 0: as fast as possible.
    """

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._began: tuple[float, float] | None = None

    @property
    def unlimited(self) -> bool:
        """Whether it runs as fast as possible."""
        return self._rate == 0.0

    def set_rate(self, rate: float) -> None:
        """Goes on at another rate; may be called from any thread."""
        self._rate, self._began = rate, None

    def ahead(self, simulated: float, steady: float) -> float:
        """How long to wait after a frame [s]; not positive: not at all.

        Args:
            simulated: time of the frame [s].
            steady: a steady clock [s].
        """
        rate, began = self._rate, self._began
        if rate == 0.0:
            return 0.0
        ahead = 0.0 if began is None else began[0] + (simulated - began[1]) / rate - steady
        if began is None or ahead < -LAG:
            self._began = (steady, simulated)
        return ahead


class Ticks:
    """Which frames of the simulation /clock is published with.

    Args:
        hertz: rate of /clock in simulated time; 0 for none.
    """

    def __init__(self, hertz: float) -> None:
        self.any = hertz > 0.0
        self._every = max(round(1.0 / (FRAME_PERIOD * hertz)), 1) if self.any else 0
        self._frames = 0

    def count(self) -> None:
        """A frame has passed."""
        self._frames += 1

    @property
    def due(self) -> bool:
        """Whether /clock is published with the newest frame."""
        return self.any and self._frames % self._every == 0
