"""Free fall, seen in the heights of the last few frames of a stream."""

from dataclasses import dataclass

from contact_curation.motion.toss import NANOSECONDS

MEMORY = 6
"""So many last frames give back the state of a `FallDetector`."""


@dataclass(slots=True)
class FallDetector:
    """Vertical velocity and acceleration after frame n of a run without gaps, by the rules of `smoothing`.

    The median of three looks one frame ahead, so both lag by one frame.

    Attributes:
        frames: taken in so far, counted up to three.
        stamps_ns: of frames n and n - 1.
        height: of frame n [m].
        quotients: difference quotients of frames n and n - 1 [m/s].
        velocity: of frame n - 1 [m/s].
        accelerations: of frames n - 1 and n - 2 [m/s^2].
    """

    frames: int = 0
    stamps_ns: tuple[int, int] = (0, 0)
    height: float = 0.0
    quotients: tuple[float, float] = (0.0, 0.0)
    velocity: float = 0.0
    accelerations: tuple[float, float] = (0.0, 0.0)

    def push(self, stamp_ns: int, height: float) -> None:
        """Takes in frame n."""
        last_ns, older_ns = self.stamps_ns
        if self.frames:
            quotient = (height - self.height) / (stamp_ns - last_ns) * NANOSECONDS
            last, older = self.quotients
            if self.frames == 1:  # the first difference of a run is repeated
                last, self.velocity = quotient, quotient
            else:
                velocity = max(min(last, older), min(max(last, older), quotient))
                acceleration = (velocity - self.velocity) / (last_ns - older_ns) * NANOSECONDS
                self.velocity, self.accelerations = velocity, (acceleration, self.accelerations[0])
            self.quotients = (quotient, last)
        self.frames, self.stamps_ns, self.height = min(self.frames + 1, 3), (stamp_ns, last_ns), height

    def falls(self, gravity: float, tolerance: float, mean_tolerance: float) -> bool:
        """Whether frames n - 2 and n - 1 are in free fall.

        Args:
            gravity: [m/s^2].
            tolerance: each acceleration is under -gravity plus this [m/s^2].
            mean_tolerance: their mean is within this of -gravity [m/s^2].
        """
        later, earlier = self.accelerations
        highest = tolerance - gravity
        return later < highest and earlier < highest and abs(0.5 * (later + earlier) + gravity) < mean_tolerance
