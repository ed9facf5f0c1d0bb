"""Throws planned for two arms by their descriptions alone, and how much depends on when exactly the gripper opens.

    python -m benchmarks.design.described_arms [--throws 50] [--seed 0]

Draws throws like ContactNets', at 0.6 times the speed and 0.3 times the spin (both arms turn joints by at most 180 deg/s),
until so many are feasible. Of each it compares the held body's motion from 30 ms before to 30 ms after the planned release
with the throw.
"""

import argparse
import time
from dataclasses import replace

import mujoco
import numpy as np

from benchmarks.design.arm_throws import published_throws
from contact_curation.simulation.arm.model import HELD, put_into_gripper
from contact_curation.simulation.arm.path import JointPath
from contact_curation.simulation.arm.safety import path_out_of_limits
from contact_curation.simulation.arm.throw_motion import STEP, ArmPlanner, ThrowMotion
from test.foreign_arm.arms import ARMS
from test.foreign_arm.planning import STEADY, body_along, planner_of


def opposing_joints(planner: ArmPlanner, motion: ThrowMotion) -> float:
    """The sum of the joints' parts of the release speed, without their signs, over that speed."""
    model = planner.arm.planning_model(planner.body)
    put_into_gripper(model, motion.grip.position, motion.grip.orientation_wxyz)
    data, jacobian = mujoco.MjData(model), np.zeros((3, model.nv))
    data.qpos[:] = motion.candidate.joints
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_jacBody(model, data, jacobian, None, model.body(HELD).id)
    parts, wanted = jacobian * motion.candidate.speeds, motion.throw.linear_velocity
    return float(np.abs(wanted @ parts).sum() / (wanted @ wanted))


def main() -> None:
    """Runs it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--throws", type=int, default=50, help="feasible throws for each arm")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    for name, config in ARMS.items():
        planner, asked, beyond, began = planner_of(config), 0, 0, time.process_time()
        motions: list[ThrowMotion] = []
        for throw in published_throws(20 * arguments.throws, arguments.seed):
            slower = replace(throw, linear_velocity=0.6 * throw.linear_velocity, angular_velocity=0.3 * throw.angular_velocity)
            found, asked = planner.plan(slower), asked + 1
            motions += [found] if isinstance(found, ThrowMotion) else []
            if len(motions) == arguments.throws:
                break
        took = time.process_time() - began
        speeds, places, used = [], [], []
        for motion in motions:
            path = JointPath.joined(motion.swing, motion.stopping)
            positions, _ = body_along(planner, motion, path)
            row, reach = len(motion.swing) - 1, int(STEADY.window / STEP)
            rows = np.arange(row - reach + 1, row + reach)
            velocities = (positions[rows + 1] - positions[rows - 1]) / (2.0 * STEP)
            wanted = motion.throw.linear_velocity
            speeds.append(100.0 * float(np.abs(np.linalg.norm(velocities, axis=1) / np.linalg.norm(wanted) - 1.0).max()))
            places.append(1e3 * float(np.linalg.norm(positions[row] - motion.throw.position)))
            whole = JointPath.joined(motion.approach, motion.swing, motion.stopping, motion.returning)
            beyond += path_out_of_limits(whole, planner.arm.limits) is not None
            used.append(float(planner.arm.limits.speed_use(whole.positions, whole.speeds).max()))
        print(f"{name}: {len(motions)} of {asked} throws are feasible; {1e3 * took / asked:.0f} ms to tell and plan one")
        print(
            f"    released 30 ms early to 30 ms late: speed off by at most {max(speeds):.2f} %; "
            f"planned place off by at most {max(places):.3f} mm"
        )
        opposing = [opposing_joints(planner, motion) for motion in motions]
        print(
            f"    if each joint is 1 % too fast or too slow, the speed is off by at most {np.median(opposing):.2f} % in the "
            f"median throw, {max(opposing):.2f} % in the worst"
        )
        print(f"    motions beyond a limit: {beyond}; largest share of a speed limit {max(used):.3f}")


if __name__ == "__main__":
    main()
