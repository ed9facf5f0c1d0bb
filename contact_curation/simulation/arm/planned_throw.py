"""A throw as an arm's controller and a tracker are asked about it: one path of the joints, and where the body is on it."""

from dataclasses import dataclass, replace

import mujoco
import numpy as np

from contact_curation.contact.body import Body
from contact_curation.design.throw import Throw
from contact_curation.geometry.poses import Pose
from contact_curation.geometry.quaternions import Array
from contact_curation.simulation.arm.departure import DepartureConfig
from contact_curation.simulation.arm.described import DescribedArm, DescribedArmConfig
from contact_curation.simulation.arm.model import HELD, put_into_gripper
from contact_curation.simulation.arm.path import JointPath, RampConfig
from contact_curation.simulation.arm.postures import DEFAULT_SEARCH, SearchConfig
from contact_curation.simulation.arm.safety import path_out_of_limits
from contact_curation.simulation.arm.steady_swing import SteadyConfig, SteadySwing
from contact_curation.simulation.arm.throw_motion import STEP, ArmPlanner, Refused, within_margin

HAND_EVERY = 4
"""Samples of the path between two places of the hand."""

SWING, MOVING = 0.6, 0.4
"""Shares of the smallest acceleration limit in sudden ramps and between postures."""

SINKING = 0.4
"""Largest downward acceleration of the held body before the swing, of gravity: trackers may be noisy."""

OPENING = 0.06
"""Rate at which arm and released body must part [m/s]: the arm goes on steadily after the release."""


@dataclass(frozen=True, eq=False)
class PlannedThrow:
    """A throw's plan. Times are after its beginning.

    Attributes:
        throw: as commanded.
        path: from home through the release back home, in samples every `STEP`.
        release: when the body is to leave [s].
        hand_times: (M,) [s].
        hand: (M, 3) places of the held body on the board then [m], as if it were never released.
        grip: the held body in the flange's frame.
        held: the held body on the board at the beginning.
    """

    throw: Throw
    path: JointPath
    release: float
    hand_times: Array
    hand: Array
    grip: Pose
    held: Pose

    @property
    def duration(self) -> float:
        """Of the whole path [s]."""
        return (len(self.path) - 1) * STEP


def described_planner(
    body: Body, config: DescribedArmConfig, steady: SteadyConfig, search: SearchConfig = DEFAULT_SEARCH
) -> ArmPlanner:
    """Plans throws of a body by an arm that is known by its description."""
    arm = DescribedArm(config)
    least = float(arm.limits.acceleration.min())
    ramp = within_margin(RampConfig(acceleration=SWING * least, moving_acceleration=MOVING * least), arm)
    swing = SteadySwing(arm.limits, replace(steady, share=min(steady.share, arm.margin)))
    departure = DepartureConfig(opening=OPENING)
    return ArmPlanner(body, arm, swing, ramp, search, departure, SINKING * body.gravity)


def way_home(planner: ArmPlanner, posture: Array) -> JointPath | str:
    """The slow way home from rest at a posture (J,) [rad], or in one line why there is none."""
    found = planner.homeward(posture)
    return found if isinstance(found, JointPath) else f"the way home: {found}; bring the arm home by hand"


def planned_throw(planner: ArmPlanner, throw: Throw) -> PlannedThrow | str:
    """The plan of a throw, or in one line why there is none: the limit, the table or the obstacle that forbids it."""
    if throw.body != planner.body.name:
        return f"body: found {throw.body}, expected {planner.body.name}"
    motion = planner.plan(throw)
    if isinstance(motion, Refused):
        return str(motion)
    path = JointPath.joined(motion.approach, motion.swing, motion.stopping, motion.returning)
    against = path_out_of_limits(path, planner.arm.limits)
    if against is not None:
        return against
    model = planner.arm.planning_model(planner.body)
    put_into_gripper(model, motion.grip.position, motion.grip.orientation_wxyz)
    data, rows = mujoco.MjData(model), np.arange(0, len(path), HAND_EVERY)
    hand = np.empty((len(rows), 3))
    for number, row in reversed([*enumerate(rows)]):  # the beginning comes last
        data.qpos[:] = path.positions[row]
        mujoco.mj_kinematics(model, data)
        hand[number] = data.body(HELD).xpos
    held = Pose(data.body(HELD).xpos.copy(), data.body(HELD).xquat.copy())
    release = (len(motion.approach) + len(motion.swing) - 2) * STEP
    return PlannedThrow(throw, path, release, np.asarray(STEP * rows, dtype=float), hand, motion.grip, held)
