"""A stored toss as the tracker saw it: with the stamps that its velocities were made with, on the board they were made on.

The velocities tell the yaw up to quarter turns. The throw tells the rest: turned back, every public toss leaves within 12
degrees of an axis of the board, as from one machine at one side of it, so each is turned on until it leaves along x.
"""

from dataclasses import dataclass, replace

import numpy as np

from contact_curation.geometry import quaternions
from contact_curation.motion.recovered_timing import RecoveredTiming, recover_timing
from contact_curation.motion.toss import NANOSECONDS, Toss

SHORTEST = 3
"""Frames: shorter tosses hold no median of known steps only."""

QUARTER = 0.5 * np.pi


@dataclass(frozen=True, eq=False)
class RestoredToss:
    """What a file's toss was before it was turned and lost its stamps.

    Attributes:
        toss: T frames; the first stamp is zero, and all are rounded to nanoseconds, which moves a velocity by up to 1.5e-7 of
            itself. `frame_period` stays nominal.
        yaw: the file's toss is this one turned by it about the vertical [rad].
        timing: how it was found; None of a toss too short for it, which is left as it was.
    """

    toss: Toss
    yaw: float = 0.0
    timing: RecoveredTiming | None = None

    @property
    def timed_steps(self) -> int:
        """How many periods are certain."""
        return 0 if self.timing is None else int(np.count_nonzero(self.timing.anchored))


def restored(toss: Toss) -> RestoredToss:
    """The toss with its own stamps on the tracker's board; as it was where its velocities were not made as the public ones."""
    if toss.frames < SHORTEST:
        return RestoredToss(toss)
    timing = recover_timing(
        toss.positions, toss.orientations_wxyz, toss.linear_velocities, toss.angular_velocities, toss.frame_period
    )
    if not timing.found:
        return RestoredToss(toss, timing=timing)
    seconds = np.concatenate([[0.0], np.cumsum(timing.periods[1:])])
    heading = float(np.arctan2(toss.linear_velocities[0, 1], toss.linear_velocities[0, 0]))
    yaw = timing.yaw + QUARTER * round((heading - timing.yaw) / QUARTER)
    back = quaternions.exp(np.array([0.0, 0.0, -yaw]))
    turned = replace(
        toss,
        stamps_ns=np.round(seconds * NANOSECONDS).astype(np.int64),
        positions=quaternions.rotate(back, toss.positions),
        orientations_wxyz=quaternions.multiply(back, toss.orientations_wxyz),
        linear_velocities=quaternions.rotate(back, toss.linear_velocities),
    )
    return RestoredToss(turned, yaw, timing)
