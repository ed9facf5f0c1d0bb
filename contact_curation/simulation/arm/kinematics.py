"""Where the pad of the arm is, for many postures at once, from the published Denavit-Hartenberg parameters.

Craig's form: joint i stands at Rx(alpha) Tx(a) Rz(q) Tz(d) of the one before. Sources: Franka's control interface documentation
("Denavit-Hartenberg parameters"; the same for Emika Panda and Research 3) and franka_description, robots/fer/kinematics.yaml.
The MuJoCo model is built from the same numbers in another way, and a test holds both together.
"""

from dataclasses import dataclass

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.simulation.arm.limits import JOINTS

LINK_OFFSETS = np.array([0.0, 0.0, 0.0, 0.0825, -0.0825, 0.0, 0.088])
"""a [m]: along the x axis of the joint before."""

LINK_TWISTS = np.pi / 2.0 * np.array([0.0, -1.0, 1.0, 1.0, -1.0, 1.0, 1.0])
"""alpha [rad]: about the x axis of the joint before."""

LINK_LENGTHS = np.array([0.333, 0.0, 0.316, 0.0, 0.384, 0.0, 0.0])
"""d [m]: along the joint's own z axis."""

FLANGE = 0.107
"""Distance from the last joint to the flange, along its z axis [m]."""


@dataclass(frozen=True, eq=False)
class Postures:
    """Postures with what they give, in the frame of the arm's base.

    Attributes:
        joints: (N, 7) [rad].
        places: (N, 3) of the pad [m].
        frames: (N, 3, 3) axes of the pad as columns; the last points away from the arm.
        jacobians: (N, 6, 7) velocity [m/s] and angular velocity [rad/s] of the pad per joint speed.
    """

    joints: Array
    places: Array
    frames: Array
    jacobians: Array

    def __len__(self) -> int:
        return len(self.joints)


def postures_of(joints: Array, tool_length: float) -> Postures:
    """What postures (N, 7) give, with a tool of a length [m] on the flange."""
    count = len(joints)
    frame, place = np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3))
    axes, origins = np.empty((count, JOINTS, 3)), np.empty((count, JOINTS, 3))
    for joint in range(JOINTS):
        place = place + LINK_OFFSETS[joint] * frame[:, :, 0]
        frame = frame @ _about_x(LINK_TWISTS[joint])
        place = place + LINK_LENGTHS[joint] * frame[:, :, 2]
        axes[:, joint], origins[:, joint] = frame[:, :, 2], place
        frame = frame @ about_z(joints[:, joint])
    place = place + (FLANGE + tool_length) * frame[:, :, 2]
    linear = np.cross(axes, place[:, None] - origins)
    return Postures(joints, place, frame, np.concatenate([linear, axes], axis=2).transpose(0, 2, 1))


def about_z(angles: Array) -> Array:
    """Rotations (N, 3, 3) about z by angles (N,)."""
    cos, sin = np.cos(angles), np.sin(angles)
    zero, one = np.zeros_like(cos), np.ones_like(cos)
    return np.stack([cos, -sin, zero, sin, cos, zero, zero, zero, one], axis=-1).reshape(*cos.shape, 3, 3)


def _about_x(angle: float) -> Array:
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, cos, -sin], [0.0, sin, cos]])
