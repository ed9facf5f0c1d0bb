"""A stored toss as the tracker saw it: with the stamps that its velocities were made with, on the board they were made on."""

from dataclasses import dataclass, replace

import numpy as np

from contact_curation.geometry import quaternions
from contact_curation.motion.recovered_timing import RecoveredTiming, recover_timing
from contact_curation.motion.toss import NANOSECONDS, Toss

SHORTEST = 3
"""Frames: shorter tosses hold no median of known steps only."""


@dataclass(frozen=True, eq=False)
class RestoredToss:
    """What a file's toss was before it was turned and lost its stamps.

    Attributes:
        toss: T frames; the first stamp is zero, and all are rounded to nanoseconds, which moves a velocity by up to 1.5e-7 of
            itself.
        timing: how it was found; None of a toss too short for it, which is left as it was.
    """

    toss: Toss
    timing: RecoveredTiming | None

    @property
    def timed_steps(self) -> int:
        """How many periods are certain."""
        return 0 if self.timing is None else int(np.count_nonzero(self.timing.anchored))


def restored(toss: Toss) -> RestoredToss:
    """The toss with its own stamps, turned back by its yaw; `frame_period` stays nominal."""
    if toss.frames < SHORTEST:
        return RestoredToss(toss, None)
    timing = recover_timing(
        toss.positions, toss.orientations_wxyz, toss.linear_velocities, toss.angular_velocities, toss.frame_period
    )
    seconds = np.concatenate([[0.0], np.cumsum(timing.periods[1:])])
    back = quaternions.exp(np.array([0.0, 0.0, -timing.yaw]))
    return RestoredToss(
        replace(
            toss,
            stamps_ns=np.round(seconds * NANOSECONDS).astype(np.int64),
            positions=quaternions.rotate(back, toss.positions),
            orientations_wxyz=quaternions.multiply(back, toss.orientations_wxyz),
            linear_velocities=quaternions.rotate(back, toss.linear_velocities),
        ),
        timing,
    )
