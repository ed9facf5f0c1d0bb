"""The state of the simulated arm and body at a frame, and the phase of the arm's motion."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array


class Phase(StrEnum):
    """Phase of the arm's motion."""

    RESTING = "resting"
    MOVING = "moving"
    THROWING = "throwing"
    RELEASED = "released"
    STOPPING = "stopping"
    STOPPED = "stopped"
    RETURNING = "returning"


@dataclass(frozen=True, eq=False)
class ArmFrame:
    """The state of arm and body at one frame.

    Attributes:
        time: simulated time [s].
        phase: phase of the arm's motion.
        progress: progress of the motion, 0 to 1.
        joints: (7,) joint angles [rad].
        speeds: (7,) joint speeds [rad/s].
        torques: (7,) motor torques [N m].
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
        """Velocity [m/s] and angular velocity [rad/s] (6,) in the body's frame."""
        back = quaternions.conjugate(self.body[3:7])
        return np.concatenate([quaternions.rotate(back, self.body[7:10]), self.body[10:]])
