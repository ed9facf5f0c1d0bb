"""Plans of throws by the two arms, and where the held body is along them."""

import mujoco
import numpy as np

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.geometry.quaternions import Array
from contact_curation.simulation.arm.described import DescribedArmConfig
from contact_curation.simulation.arm.model import HELD, put_into_gripper
from contact_curation.simulation.arm.path import JointPath
from contact_curation.simulation.arm.planned_throw import described_planner
from contact_curation.simulation.arm.postures import SearchConfig
from contact_curation.simulation.arm.steady_swing import SteadyConfig
from contact_curation.simulation.arm.throw_motion import ArmPlanner, ThrowMotion

STEADY = SteadyConfig(window=0.03)


def planner_of(config: DescribedArmConfig, refined: int = 10) -> ArmPlanner:
    return described_planner(CONTACTNETS_CUBE, config, STEADY, SearchConfig(table=20_000, refined=refined))


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
