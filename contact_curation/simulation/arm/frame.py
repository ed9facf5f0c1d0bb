"""The simulated arm and body once per frame, and what the arm is doing."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array


class Phase(StrEnum):
    """What the arm is doing."""

    RESTING = "resting"
    MOVING = "moving"
    THROWING = "throwing"
    RELEASED = "released"
    STOPPING = "stopping"
    STOPPED = "stopped"
    RETURNING = "returning"


@dataclass(frozen=True, eq=False)
class ArmFrame:
    """The world once per frame.

    Attributes:
        time: simulated [s].
        phase: phase of the arm.
        progress: progress of the motion, 0 to 1.
        joints: (7,) [rad].
        speeds: (7,) [rad/s].
        torques: (7,) that the motors gave [N m].
        body: (13,) state in SI units, in the board's frame.
        free: whether the body has left the gripper.
    """

    time: float
    phase: Phase
    progress: float
    joints: Array
    speeds: Array
    torques: Array
    body: Array
    free: bool

    @property
    def twist_in_body(self) -> Array:
        """(6,) velocity and angular velocity in the body's own frame."""
        back = quaternions.conjugate(self.body[3:7])
        return np.concatenate([quaternions.rotate(back, self.body[7:10]), self.body[10:]])
