"""How much poses scatter from frame to frame, told by themselves: most frames rest or fly, and there nothing pushes sideways.

sigma = median |p_k - 2 p_k-1 + p_k-2| / (0.6745 sqrt(6))        over x and y on the board
"""

from collections import deque
from math import ceil, sqrt
from statistics import median

from contact_curation.geometry.scalars import Vector

RIG_NOISE = 2.2e-5
"""Of the real rig's positions, standard deviation per axis [m] (METHOD 3); segmenter and gates have their bounds for it."""

KEPT = 4096
"""So many last numbers count."""

FEWEST = 100
"""Fewer say nothing."""

LOUD = 1.6
"""Times what was told; from there on tosses are lost (benchmarks/tracker_noise.py)."""

EVEN = 1.2
"""Successive steps of time that differ by a larger factor are left out."""


class PoseNoise:
    """Follows one body's poses in the board's frame."""

    def __init__(self) -> None:
        self._last: tuple[int, float, float] | None = None
        self._step: tuple[int, float, float] | None = None
        self._bent: deque[float] = deque(maxlen=KEPT)

    def push(self, stamp_ns: int, position: Vector) -> None:
        """Takes in the next pose, with a later stamp."""
        x, y, _ = position
        if self._last is not None:
            then, old_x, old_y = self._last
            step = stamp_ns - then, x - old_x, y - old_y
            if self._step is not None and max(step[0], self._step[0]) <= EVEN * min(step[0], self._step[0]):
                self._bent += (abs(step[1] - self._step[1]), abs(step[2] - self._step[2]))
            self._step = step
        self._last = stamp_ns, x, y

    def reset(self) -> None:
        """The next pose has nothing to do with the last one."""
        self._last = self._step = None

    def complaint(self, told: float, name: str) -> str:
        """One line where poses scatter by much more than was told, in multiples of `RIG_NOISE`, by what has this name."""
        if self.multiple <= LOUD * told:
            return ""
        found, expected = (f"{1e3 * RIG_NOISE * multiple:.2g} mm" for multiple in (self.multiple, told))
        remedy = f"say {name}={ceil(self.multiple)}, or tosses are lost"
        return f"found poses that scatter by {found} from frame to frame, expected {expected}: {remedy}"

    @property
    def multiple(self) -> float:
        """Of `RIG_NOISE`; 0 before there is enough to say."""
        return median(self._bent) / (0.6745 * sqrt(6.0) * RIG_NOISE) if len(self._bent) >= FEWEST else 0.0
