"""How much poses scatter from frame to frame, by their third differences: who carries a body changes slowly how he pushes it.

    sigma = median |p_k - 3 p_k-1 + 3 p_k-2 - p_k-3| / (0.6745 sqrt(20))        over x and y on the board

Differences of exactly nothing are left out: they are poses that were sent twice, or rounded.
"""

from collections import deque
from math import radians, sqrt
from statistics import median

from contact_curation.geometry.scalars import Vector

RIG_NOISE = 2.2e-5
"""Of the real rig's positions, standard deviation per axis [m] (method.md 3); segmenter and gates have their bounds for it."""

RIG_TURN = radians(0.024)
"""Of its orientations, likewise [rad]."""

KEPT = 16384
"""So many last differences count."""

FEWEST = 100
"""Fewer say nothing."""

EVEN = 1.2
"""Successive steps of time that differ by a larger factor are left out."""

LOUD = 1.6
"""Times what was expected; from there on tosses are lost (benchmarks/data/tracker_noise.py)."""

MOST = 8.0
"""With more, tosses are lost whatever is expected."""

SLOWEST = 0.02
"""A longer median step says nothing, since the body's own motion is all that is seen [s]."""


class PoseNoise:
    """Follows one body's poses in the board's frame."""

    def __init__(self) -> None:
        self._last: deque[tuple[int, float, float]] = deque(maxlen=4)
        self._bent: deque[float] = deque(maxlen=KEPT)
        self._steps: deque[int] = deque(maxlen=FEWEST)

    def push(self, stamp_ns: int, position: Vector) -> None:
        """Takes in the next pose, with a later stamp."""
        self._last.append((stamp_ns, position[0], position[1]))
        if len(self._last) < 4:
            return
        (s0, x0, y0), (s1, x1, y1), (s2, x2, y2), (s3, x3, y3) = self._last
        self._steps.append(s3 - s2)
        if max(s3 - s2, s2 - s1, s1 - s0) <= EVEN * min(s3 - s2, s2 - s1, s1 - s0):
            self._bent += (bent for bent in (abs(x3 - x0 + 3.0 * (x1 - x2)), abs(y3 - y0 + 3.0 * (y1 - y2))) if bent)

    def reset(self) -> None:
        """The next pose has nothing to do with the last one."""
        self._last.clear()

    @property
    def multiple(self) -> float:
        """Of `RIG_NOISE`; 0 where there is too little to say, or poses come too slowly to."""
        if len(self._bent) < FEWEST or median(self._steps) > SLOWEST * 1e9:
            return 0.0
        return median(self._bent) / (0.6745 * sqrt(20.0) * RIG_NOISE)

    def warning(self, expected_noise: float) -> str:
        """One line where poses scatter by much more than was expected, in multiples of `RIG_NOISE`; else nothing."""
        multiple = self.multiple
        if multiple <= LOUD * expected_noise:
            return ""
        found, expected = (f"{1e3 * RIG_NOISE * each:.2g} mm" for each in (multiple, expected_noise))
        noisy = f"found positions that scatter by {found} from frame to frame, expected {expected}"
        remedy = f"say segmenter.tracker_noise={multiple:.1f}" if multiple <= MOST else "smooth them, or take fewer a second"
        return f"{noisy}: tosses may be lost; {remedy}"
