"""Published joint limits of a Franka Research 3, the shares of them that a motion uses, and the reaction to a collision.

Sources: positions, speeds and torques from franka_description (robots/fr3/joint_limits.yaml); accelerations, rates of torques,
and the speed limits near the ends of a joint's range from libfranka for the FR3 (include/franka/rate_limiting.h of 2023:
kMaxJointAcceleration, kMaxTorqueRate, computeUpperLimitsJointVelocity) and "Limits for Franka Research 3" of Franka's control
interface documentation. The limit of the jerk (5000 rad/s^3) is not checked: our ramps of tens of milliseconds stay far below.

An external torque is one that the arm's model does not explain. With the measured speeds q', it is

    outside = M dq'/dt + bias - motors

averaged over a few milliseconds; it includes the joints' friction. If it is too large, the arm gives way: an arm that kept
following its path would push with its full torque (Haddadin, De Luca, Albu-Schaeffer, Robot Collisions: A Survey on Detection,
Isolation, and Identification, IEEE T-RO 33(6), 2017).
"""

from dataclasses import dataclass

import numpy as np

from contact_curation.configs import check_positive
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array

JOINTS = 7


@dataclass(frozen=True, eq=False)
class JointLimits:
    """Limits of an arm's J joints, each (J,).

    Near an end of its range a joint must be able to brake before that end: speed <= sqrt(2 * braking * distance) - slack.

    Attributes:
        lowest: position [rad].
        highest: position [rad].
        speed: [rad/s].
        acceleration: [rad/s^2].
        torque: [N m].
        torque_rate: how fast torques may change [N m/s].
        braking: deceleration assumed by the speed limit near an end [rad/s^2].
        slack: speed that is subtracted from that limit [rad/s].
        brake_end_low: position near the lower end from which the braking distance is measured [rad].
        brake_end_high: position near the upper end from which the braking distance is measured [rad].
    """

    lowest: Array
    highest: Array
    speed: Array
    acceleration: Array
    torque: Array
    torque_rate: Array
    braking: Array
    slack: Array
    brake_end_low: Array
    brake_end_high: Array

    def __post_init__(self) -> None:
        count = len(self.lowest)
        for name in self.__dataclass_fields__:
            values = np.asarray(getattr(self, name), dtype=float)
            if values.shape != (count,) or not np.isfinite(values).all():
                raise InvalidValueError(f"joint limits {name}", np.array2string(values), f"{count} finite numbers")
            object.__setattr__(self, name, values)

    def fastest(self, positions: Array) -> tuple[Array, Array]:
        """The lowest and the highest allowed speeds (..., J) [rad/s] at positions (..., J) [rad]."""
        down = np.sqrt(np.maximum(2.0 * self.braking * (positions - self.brake_end_low), 0.0)) - self.slack
        up = np.sqrt(np.maximum(2.0 * self.braking * (self.brake_end_high - positions), 0.0)) - self.slack
        return -np.clip(down, 0.0, self.speed), np.clip(up, 0.0, self.speed)

    def speed_use(self, positions: Array, speeds: Array) -> Array:
        """The used shares (..., J) of the speed limits; above 1 the limit is violated, infinite where no speed is allowed."""
        low, high = self.fastest(positions)
        allowed = np.where(speeds < 0.0, -low, high)
        idle = np.abs(speeds) < 1e-9
        with np.errstate(divide="ignore"):
            return np.where(idle, 0.0, np.abs(speeds) / np.where(idle, 1.0, allowed))


FR3_LIMITS = JointLimits(
    lowest=np.array([-2.7437, -1.7837, -2.9007, -3.0421, -2.8065, 0.5445, -3.0159]),
    highest=np.array([2.7437, 1.7837, 2.9007, -0.1518, 2.8065, 4.5169, 3.0159]),
    speed=np.array([2.62, 2.62, 2.62, 2.62, 5.26, 4.18, 5.26]),
    acceleration=np.full(JOINTS, 10.0),
    torque=np.array([87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0]),
    torque_rate=np.full(JOINTS, 1000.0),
    braking=np.array([6.0, 2.585, 3.5, 4.0, 17.0, 5.5, 17.0]),
    slack=np.array([0.30, 0.20, 0.20, 0.30, 0.35, 0.35, 0.35]),
    brake_end_low=np.array([-2.7501, -1.7918, -2.9065, -3.0481, -2.8101, 0.54092, -3.0196]),
    brake_end_high=np.array([2.7501, 1.7918, 2.9065, -0.1458, 2.8101, 4.5205, 3.0196]),
)
"""Limits of a Franka Research 3."""


@dataclass(frozen=True, eq=False)
class Peaks:
    """The largest used shares of the joints' limits, (7,) each."""

    torque: Array
    speed: Array
    position: Array


class LimitUse:
    """Records the largest used shares of the limits.

    Args:
        limits: limits of the joints.
    """

    def __init__(self, limits: JointLimits) -> None:
        self._limits = limits
        self._middle, self._half = 0.5 * (limits.highest + limits.lowest), 0.5 * (limits.highest - limits.lowest)
        self.forget()

    def forget(self) -> None:
        """Starts from zero."""
        self._torque, self._speed, self._position = np.zeros((3, JOINTS))

    def note(self, torques: Array, joints: Array, speeds: Array) -> None:
        """Records the torques [N m], positions [rad] and speeds [rad/s], each (7,), of a step."""
        self._torque = np.maximum(self._torque, np.abs(torques) / self._limits.torque)
        self._speed = np.maximum(self._speed, self._limits.speed_use(joints, speeds))
        self._position = np.maximum(self._position, np.abs(joints - self._middle) / self._half)

    @property
    def peaks(self) -> Peaks:
        """The largest shares of the limits so far."""
        return Peaks(self._torque.copy(), self._speed.copy(), self._position.copy())


@dataclass(frozen=True)
class ReflexConfig:
    """When the arm gives way.

    Attributes:
        share: external torque at which the arm stops, as a share of a joint's torque limit; the joints' friction is at most a
            twentieth of that limit.
        time: time over which the external torque is averaged [s].
    """

    share: float = 0.1
    time: float = 0.005

    def __post_init__(self) -> None:
        check_positive(self, ("share", "time"), "reflex.")


class CollisionReflex:
    """Detects collisions of an arm from its external torques, step by step.

    Args:
        limits: (J,) torque limits of the motors [N m].
        config: when the arm gives way.
    """

    def __init__(self, limits: Array, config: ReflexConfig) -> None:
        self._largest, self._config = config.share * limits, config
        self._outside = np.zeros_like(limits)

    def feels(self, outside: Array, step: float) -> bool:
        """Averages the external torques (J,) [N m] of a step [s]; returns whether the average has become too large."""
        self._outside = self._outside + step / (self._config.time + step) * (outside - self._outside)
        return bool((np.abs(self._outside) > self._largest).any())

    def forget(self) -> None:
        """Starts from zero."""
        self._outside = np.zeros_like(self._outside)
