"""How much of the joints' limits a motion uses."""

from dataclasses import dataclass

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.simulation.arm.limits import JOINTS, JointLimits


@dataclass(frozen=True, eq=False)
class Peaks:
    """The largest shares of the joints' limits that were used, (7,) each."""

    torque: Array
    speed: Array
    position: Array


class LimitUse:
    """Remembers the largest shares that were used.

    Args:
        limits: of the joints.
    """

    def __init__(self, limits: JointLimits) -> None:
        self._limits = limits
        self._middle, self._half = 0.5 * (limits.highest + limits.lowest), 0.5 * (limits.highest - limits.lowest)
        self.forget()

    def forget(self) -> None:
        """Begins anew."""
        self._torque, self._speed, self._position = np.zeros((3, JOINTS))

    def note(self, torques: Array, joints: Array, speeds: Array) -> None:
        """Takes in torques [N m], places [rad] and speeds [rad/s] (7,) of a step."""
        self._torque = np.maximum(self._torque, np.abs(torques) / self._limits.torque)
        self._speed = np.maximum(self._speed, self._limits.speed_use(joints, speeds))
        self._position = np.maximum(self._position, np.abs(joints - self._middle) / self._half)

    @property
    def peaks(self) -> Peaks:
        """So far."""
        return Peaks(self._torque.copy(), self._speed.copy(), self._position.copy())
