"""A swing that releases well though the gripper opens at an uncertain moment: the body goes steadily for a while.

From `window` before the planned release to `window` after it the held body keeps the planned velocity and angular velocity. So
the body leaves with the right twist whenever in this time the gripper lets go. Joints follow by the resolved rate,

    q' = J+ (xi - J q'_before) + q'_before

with the Jacobian J of the held body and its twist xi; of the motions that give the twist it is the nearest to the step before.
Outside of the window each joint's speed is a cubic polynomial of time that meets the window with equal speed and acceleration;
all joints take the same time.
"""

from dataclasses import dataclass

import mujoco
import numpy as np

from contact_curation.configs import check_positive
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.simulation.arm.limits import JointLimits
from contact_curation.simulation.arm.model import HELD
from contact_curation.simulation.arm.path import JointPath
from contact_curation.simulation.arm.postures import Candidate
from contact_curation.simulation.arm.throw_motion import STEP


@dataclass(frozen=True)
class SteadyConfig:
    """How long the body goes steadily, and how hard joints speed up to that.

    Attributes:
        window: steady time on either side of the planned release [s].
        share: share of the joints' acceleration limits that swings use.
        longest: longest time for speeding up [s].
    """

    window: float = 0.03
    share: float = 0.9
    longest: float = 1.5

    def __post_init__(self) -> None:
        check_positive(self, ("window", "longest"), "steady.")
        if not 0.0 < self.share <= 1.0:
            raise InvalidValueError("steady.share", self.share, "a share in (0, 1]")


@dataclass(frozen=True, eq=False)
class SteadySwing:
    """Swings of one arm.

    Attributes:
        limits: of its joints.
        config: how it swings.
    """

    limits: JointLimits
    config: SteadyConfig

    def way(self, speeds: Array) -> Array:
        """How far each joint moves from rest to release speeds (N, J), about, (N, J) [rad]."""
        total = 1.5 * (np.abs(speeds) / (self.config.share * self.limits.acceleration)).max(axis=-1, keepdims=True)
        return np.asarray(speeds * (self.config.window + 0.5 * total))

    def paths(self, model: mujoco.MjModel, data: mujoco.MjData, candidate: Candidate) -> tuple[JointPath, JointPath]:
        """The path from rest to the release, and the one from there to rest, of the arm with the body in its gripper."""
        after = _steady(model, data, candidate.joints, candidate.speeds, self.config.window)
        before = _reversed(_steady(model, data, candidate.joints, -candidate.speeds, self.config.window))
        ramp_up = _reversed(self._slowing(before.positions[0], -before.speeds[0], before.accelerations[0]))
        ramp_down = self._slowing(after.positions[-1], after.speeds[-1], after.accelerations[-1])
        return JointPath.joined(ramp_up, before), JointPath.joined(after, ramp_down)

    def _slowing(self, joints: Array, speeds: Array, accelerations: Array) -> JointPath:
        """The path from a posture (J,) passed with speeds and accelerations (J,) to rest, as short as the limits allow."""
        allowed = self.config.share * self.limits.acceleration
        for total in np.arange(max(float((np.abs(speeds) / allowed).max()), 0.01), self.config.longest, 0.01):
            path = _ramp(joints, speeds, accelerations, float(total))
            if (np.abs(path.accelerations) <= allowed).all():
                break
        return path


def _steady(model: mujoco.MjModel, data: mujoco.MjData, joints: Array, speeds: Array, window: float) -> JointPath:
    """The path from a posture (J,) passed with speeds (J,) on which the held body keeps its twist."""
    held, jacobian = model.body(HELD).id, np.zeros((6, model.nv))

    def jacobian_at(posture: Array) -> Array:
        data.qpos[:] = posture
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_jacBody(model, data, jacobian[:3], jacobian[3:], held)
        return jacobian

    twist = jacobian_at(joints) @ speeds
    positions, rates = [joints], [speeds]
    for _ in range(int(np.ceil(window / STEP))):
        middle = jacobian_at(positions[-1] + 0.5 * STEP * rates[-1])
        rate = rates[-1] + np.linalg.lstsq(middle, twist - middle @ rates[-1], rcond=1e-6)[0]
        positions.append(positions[-1] + STEP * rate)
        end = jacobian_at(positions[-1])
        rates.append(rate + np.linalg.lstsq(end, twist - end @ rate, rcond=1e-6)[0])
    return JointPath(np.array(positions), np.array(rates), np.gradient(np.array(rates), STEP, axis=0, edge_order=2))


def _ramp(joints: Array, speeds: Array, accelerations: Array, total: float) -> JointPath:
    """Speeds that fall to zero in a time [s] as cubic polynomials."""
    count = int(np.ceil(total / STEP))
    total = count * STEP
    s = np.linspace(0.0, 1.0, count + 1)[:, None]
    gain = total * accelerations
    return JointPath(
        joints + total * (speeds * (s - s**3 + 0.5 * s**4) + gain * (0.5 * s**2 - 2.0 / 3.0 * s**3 + 0.25 * s**4)),
        speeds * (1.0 - 3.0 * s**2 + 2.0 * s**3) + gain * (s - 2.0 * s**2 + s**3),
        speeds / total * (6.0 * s**2 - 6.0 * s) + accelerations * (1.0 - 4.0 * s + 3.0 * s**2),
    )


def _reversed(path: JointPath) -> JointPath:
    """The same path backwards in time."""
    return JointPath(path.positions[::-1], -path.speeds[::-1], path.accelerations[::-1])
