"""A throw as an arm's controller and a tracker are asked about it: one path of the joints, and where the body is on it."""

from dataclasses import dataclass

import mujoco
import numpy as np

from contact_curation.design.throw import Throw
from contact_curation.geometry.quaternions import Array
from contact_curation.simulation.arm.model import HELD, put_into_gripper
from contact_curation.simulation.arm.path import JointPath
from contact_curation.simulation.arm.safety import path_out_of_limits
from contact_curation.simulation.arm.throw_motion import STEP, ArmPlanner, Refused

HAND_EVERY = 4
"""Samples of the path between two places of the hand."""


@dataclass(frozen=True, eq=False)
class PlannedThrow:
    """A throw's plan. Times are after its beginning.

    Attributes:
        throw: as commanded.
        path: from home through the release back home, in samples every `STEP`.
        release: when the body is to leave [s].
        hand_times: (M,) [s].
        hand: (M, 3) places of the held body on the board then [m], as if it were never released.
    """

    throw: Throw
    path: JointPath
    release: float
    hand_times: Array
    hand: Array

    @property
    def duration(self) -> float:
        """Of the whole path [s]."""
        return (len(self.path) - 1) * STEP


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
    for number, row in enumerate(rows):
        data.qpos[:] = path.positions[row]
        mujoco.mj_kinematics(model, data)
        hand[number] = data.body(HELD).xpos
    release = (len(motion.approach) + len(motion.swing) - 2) * STEP
    return PlannedThrow(throw, path, release, np.asarray(STEP * rows, dtype=float), hand)
