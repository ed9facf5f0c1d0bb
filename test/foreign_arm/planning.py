"""Plans of throws by the two arms, and where the held body is along them."""

import mujoco
import numpy as np

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.geometry.quaternions import Array
from contact_curation.simulation.arm.departure import DepartureConfig
from contact_curation.simulation.arm.described import DescribedArm, DescribedArmConfig
from contact_curation.simulation.arm.model import HELD, put_into_gripper
from contact_curation.simulation.arm.path import JointPath, RampConfig
from contact_curation.simulation.arm.postures import SearchConfig
from contact_curation.simulation.arm.steady_swing import SteadyConfig, SteadySwing
from contact_curation.simulation.arm.throw_motion import ArmPlanner, ThrowMotion

STEADY = SteadyConfig(window=0.03)


def planner_of(config: DescribedArmConfig, refined: int = 10) -> ArmPlanner:
    arm = DescribedArm(config)
    acceleration = float(arm.limits.acceleration.min())
    ramp = RampConfig(acceleration=0.6 * acceleration, moving_acceleration=0.4 * acceleration)
    swing = SteadySwing(arm.limits, STEADY)
    search = SearchConfig(table=20_000, refined=refined)
    return ArmPlanner(CONTACTNETS_CUBE, arm, swing, ramp, search, DepartureConfig(opening=0.06))


def body_along(planner: ArmPlanner, motion: ThrowMotion, path: JointPath) -> tuple[Array, Array]:
    """Places (N, 3) and rotations (N, 3, 3) of the held body."""
    model = planner.arm.planning_model(CONTACTNETS_CUBE)
    put_into_gripper(model, motion.grip.position, motion.grip.orientation_wxyz)
    data, places, turns = mujoco.MjData(model), [], []
    for posture in path.positions:
        data.qpos[:] = posture
        mujoco.mj_kinematics(model, data)
        places.append(data.body(HELD).xpos.copy())
        turns.append(data.body(HELD).xmat.reshape(3, 3).copy())
    return np.array(places), np.array(turns)
