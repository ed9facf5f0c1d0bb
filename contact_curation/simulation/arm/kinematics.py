"""Forward kinematics of the arm's pad for many postures at once, from the published Denavit-Hartenberg parameters.

Craig's form: joint i is at Rx(alpha) Tx(a) Rz(q) Tz(d) relative to the previous joint. Sources: Franka's control interface
documentation ("Denavit-Hartenberg parameters"; the same for Emika Panda and Research 3) and franka_description,
robots/fer/kinematics.yaml. The MuJoCo model is built from the same numbers in another way; a test compares the two.
"""

from dataclasses import dataclass

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.simulation.arm.limits import JOINTS

LINK_OFFSETS = np.array([0.0, 0.0, 0.0, 0.0825, -0.0825, 0.0, 0.088])
"""a [m]: distance along the x axis of the previous joint."""

LINK_TWISTS = np.pi / 2.0 * np.array([0.0, -1.0, 1.0, 1.0, -1.0, 1.0, 1.0])
"""alpha [rad]: angle about the x axis of the previous joint."""

LINK_LENGTHS = np.array([0.333, 0.0, 0.316, 0.0, 0.384, 0.0, 0.0])
"""d [m]: distance along the joint's own z axis."""

FLANGE = 0.107
"""Distance from the last joint to the flange, along its z axis [m]."""


@dataclass(frozen=True, eq=False)
class Postures:
    """Postures with poses and Jacobians of the pad, in the frame of the arm's base.

    Attributes:
        joints: (N, 7) joint angles [rad].
        places: (N, 3) positions of the pad [m].
        frames: (N, 3, 3) axes of the pad as columns; the last one points away from the arm.
        jacobians: (N, 6, 7) velocity [m/s] and angular velocity [rad/s] of the pad per joint speed [rad/s].
    """

    joints: Array
    places: Array
    frames: Array
    jacobians: Array

    def __len__(self) -> int:
        return len(self.joints)


def postures_of(joints: Array, tool_length: float) -> Postures:
    """Computes poses and Jacobians of the pad for postures (N, 7) [rad], with a tool of `tool_length` [m] on the flange."""
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
    """Rotation matrices (N, 3, 3) about z by angles (N,) [rad]."""
    cos, sin = np.cos(angles), np.sin(angles)
    zero, one = np.zeros_like(cos), np.ones_like(cos)
    return np.stack([cos, -sin, zero, sin, cos, zero, zero, zero, one], axis=-1).reshape(*cos.shape, 3, 3)


def _about_x(angle: float) -> Array:
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, cos, -sin], [0.0, sin, cos]])
