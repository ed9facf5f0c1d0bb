"""Throws planned for arms that are known by their description alone: a UR5e as URDF, an xArm7 as MJCF."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from contact_curation.design.throw import Throw
from contact_curation.errors import ContactCurationError
from contact_curation.geometry.quaternions import IDENTITY, Array
from contact_curation.simulation.arm.described import DescribedArm, read_arm
from contact_curation.simulation.arm.path import JointPath
from contact_curation.simulation.arm.planned_throw import PlannedThrow, planned_throw
from contact_curation.simulation.arm.postures import least_speeds
from contact_curation.simulation.arm.safety import path_out_of_limits
from contact_curation.simulation.arm.throw_motion import STEP, ArmPlanner, Refused, ThrowMotion
from test.foreign_arm.arms import ARMS, UR5E, XARM7, throw
from test.foreign_arm.planning import STEADY, body_along, planner_of

SLOW = Throw("slow", "cube", np.array([-0.3, 0.0, 0.17]), IDENTITY, np.array([0.6, 0.0, 0.1]), np.array([0.0, 1.0, 0.0]))


@pytest.fixture(scope="module", params=ARMS)
def planner(request: pytest.FixtureRequest) -> ArmPlanner:
    return planner_of(ARMS[request.param])


@pytest.fixture(scope="module")
def motion(planner: ArmPlanner) -> ThrowMotion:
    found = planner.plan(SLOW)
    assert isinstance(found, ThrowMotion), str(found)
    return found


def whole(motion: ThrowMotion) -> JointPath:
    return JointPath.joined(motion.approach, motion.swing, motion.stopping, motion.returning)


def test_a_ur5e_stands_where_its_published_parameters_have_it() -> None:
    """Denavit-Hartenberg parameters of the maker's support pages; their base frame is half a turn from that of the URDF."""
    joints = np.random.default_rng(0).uniform(-3.0, 3.0, (20, 6))
    found = DescribedArm(UR5E).postures(joints)
    rows = zip([0.0, -0.425, -0.3922, 0.0, 0.0, 0.0], [0.1625, 0.0, 0.0, 0.1333, 0.0997, 0.0996],
               [0.5 * np.pi, 0.0, 0.0, 0.5 * np.pi, -0.5 * np.pi, 0.0])  # fmt: skip
    frames = np.tile(np.diag([-1.0, -1.0, 1.0, 1.0]), (20, 1, 1))
    for joint, (a, d, alpha) in enumerate(rows):
        turn, tilt = np.tile(np.eye(4), (20, 1, 1)), np.eye(4)
        cos, sin = np.cos(joints[:, joint]), np.sin(joints[:, joint])
        turn[:, :2, :2] = np.moveaxis(np.array([[cos, -sin], [sin, cos]]), 2, 0)
        tilt[1:3, 1:3] = [[np.cos(alpha), -np.sin(alpha)], [np.sin(alpha), np.cos(alpha)]]
        tilt[:3, 3] = a, 0.0, d
        frames = frames @ turn @ tilt
    pads = frames[:, :3, 3] + UR5E.gripper_length * frames[:, :3, 2]
    np.testing.assert_allclose(found.places, pads, atol=1e-6)
    np.testing.assert_allclose(found.frames[:, :, 2], frames[:, :3, 2], atol=1e-6)


def test_the_jacobian_is_the_slope_of_the_pads_place() -> None:
    arm, step = DescribedArm(XARM7), 1e-6
    posture = np.array([0.3, -0.5, 0.2, 1.1, -0.4, 1.3, 0.7])
    near = arm.postures(np.concatenate([posture + step * np.eye(7), posture - step * np.eye(7)]))
    slopes = (near.places[:7] - near.places[7:]).T / (2.0 * step)
    np.testing.assert_allclose(arm.postures(posture[None]).jacobians[0, :3], slopes, atol=1e-8)


def test_six_joints_have_one_answer() -> None:
    arm = DescribedArm(UR5E)
    jacobians = arm.postures(np.array([[0.1, -1.2, -1.6, -1.0, 1.4, 0.3]])).jacobians
    twist = np.array([[0.5, -0.2, 0.1, 0.4, 1.0, -0.3]])
    speeds = least_speeds(jacobians, twist, arm.limits)
    np.testing.assert_allclose(jacobians[0] @ speeds[0], twist[0], atol=1e-6)


def test_the_body_is_released_as_the_throw_wants(planner: ArmPlanner, motion: ThrowMotion) -> None:
    places, turns = body_along(planner, motion, JointPath.joined(motion.swing, motion.stopping))
    row = len(motion.swing) - 1
    np.testing.assert_allclose(places[row], SLOW.position, atol=1e-5)
    np.testing.assert_allclose(turns[row], np.eye(3), atol=1e-5)


def test_the_body_goes_steadily_around_the_release(planner: ArmPlanner, motion: ThrowMotion) -> None:
    places, turns = body_along(planner, motion, JointPath.joined(motion.swing, motion.stopping))
    row, reach = len(motion.swing) - 1, int(STEADY.window / STEP)
    rows = np.arange(row - reach + 1, row + reach)
    velocities = (places[rows + 1] - places[rows - 1]) / (2.0 * STEP)
    np.testing.assert_allclose(velocities, np.tile(SLOW.linear_velocity, (len(rows), 1)), atol=2e-3)
    change = turns[rows + 1] @ turns[rows - 1].transpose(0, 2, 1)
    spins = np.stack([change[:, 2, 1], change[:, 0, 2], change[:, 1, 0]], axis=1) / (2.0 * STEP)
    np.testing.assert_allclose(spins, np.tile(SLOW.angular_velocity, (len(rows), 1)), atol=5e-3)


def test_the_body_is_never_carried_like_one_that_falls(planner: ArmPlanner) -> None:
    every = 7
    for number in range(4):
        motion = planner.plan(throw(number))
        assert isinstance(motion, ThrowMotion), str(motion)
        path = JointPath.joined(motion.approach, motion.swing).thinned(every)
        heights = body_along(planner, motion, path)[0][:-1, 2]
        assert np.diff(heights, 2).min() / (every * STEP) ** 2 > -0.5 * planner.body.gravity


def test_positions_speeds_and_accelerations_of_a_motion_belong_together(motion: ThrowMotion) -> None:
    path = whole(motion)
    np.testing.assert_allclose(np.diff(path.positions, axis=0) / STEP, 0.5 * (path.speeds[1:] + path.speeds[:-1]), atol=2e-3)
    changes = np.diff(path.speeds, axis=0) / STEP
    np.testing.assert_allclose(changes, 0.5 * (path.accelerations[1:] + path.accelerations[:-1]), atol=0.2)
    for at in (0, len(motion.approach) - 1, -1):
        np.testing.assert_allclose(path.speeds[at], 0.0, atol=1e-9)


def test_no_sample_of_a_motion_breaks_a_limit(planner: ArmPlanner, motion: ThrowMotion) -> None:
    assert path_out_of_limits(whole(motion), planner.arm.limits) is None


def test_a_smaller_margin_leaves_more_of_every_limit_unused() -> None:
    planner = planner_of(replace(XARM7, margin=0.6), refined=3)
    motion = planner.plan(SLOW)
    assert isinstance(motion, ThrowMotion), str(motion)
    path, limits = whole(motion), planner.arm.limits
    for values, most in ((path.speeds, limits.speed), (path.accelerations, limits.acceleration)):
        assert (np.abs(values) <= 0.6 * most + 1e-9).all()


def test_a_planned_throw_is_one_path_from_home_to_home_that_knows_where_the_body_is(planner: ArmPlanner) -> None:
    plan = planned_throw(planner, SLOW)
    assert isinstance(plan, PlannedThrow), plan
    np.testing.assert_allclose(plan.path.positions[[0, -1]], np.tile(planner.arm.home_posture, (2, 1)), atol=1e-9)
    np.testing.assert_allclose(plan.path.speeds[[0, -1]], 0.0, atol=1e-9)
    assert plan.hand_times[-1] == pytest.approx(plan.duration, abs=4.0 * STEP)
    at = [np.interp(plan.release, plan.hand_times, axis) for axis in plan.hand.T]
    np.testing.assert_allclose(at, SLOW.position, atol=1e-4)
    near = [np.interp(plan.release + side, plan.hand_times, axis) for side in (-0.01, 0.01) for axis in plan.hand.T]
    np.testing.assert_allclose(np.subtract(near[3:], near[:3]) / 0.02, SLOW.linear_velocity, atol=0.01)
    np.testing.assert_allclose(plan.hand[0], plan.held.position, atol=1e-12)


def test_a_plan_for_another_body_is_refused(planner: ArmPlanner) -> None:
    assert planned_throw(planner, replace(SLOW, body="ball")) == "body: found ball, expected cube"


def test_the_way_home_is_slow_and_within_the_limits_or_names_what_is_in_the_way(planner: ArmPlanner) -> None:
    away = planner.arm.home_posture + 0.2
    path = planner.homeward(away)
    assert isinstance(path, JointPath), str(path)
    np.testing.assert_allclose(path.positions[[0, -1]], [away, planner.arm.home_posture], atol=1e-9)
    assert path_out_of_limits(path, planner.arm.limits) is None
    assert (np.abs(path.speeds) < 0.3 * planner.arm.limits.speed).all()


def test_a_way_home_into_an_obstacle_is_refused() -> None:
    place = DescribedArm(XARM7).postures(np.array([XARM7.home])).places[0]
    cos, sin = np.cos(XARM7.yaw), np.sin(XARM7.yaw)
    pad = XARM7.base + np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]]) @ place
    blocked = planner_of(replace(XARM7, obstacles=(*pad.tolist(), 0.03, 0.03, 0.03)), refined=1)
    refused = blocked.homeward(np.array(XARM7.home) + 0.2)
    assert isinstance(refused, Refused)
    assert "obstacle 1" in str(refused)


def test_a_throw_that_is_too_fast_is_refused_with_the_limit(planner: ArmPlanner) -> None:
    refused = planner.plan(replace(SLOW, linear_velocity=np.array([9.0, 0.0, 0.0])))
    assert isinstance(refused, Refused)
    assert refused.found > refused.allowed


def test_an_obstacle_in_the_way_is_named() -> None:
    x, y, z = SLOW.position
    wall = (float(x), float(y), float(z), 0.06, 0.06, 0.06)
    refused = planner_of(replace(XARM7, obstacles=wall), refined=1).plan(SLOW)
    assert isinstance(refused, Refused)
    assert "obstacle 1" in str(refused)


def without_ranges(path: Path) -> Path:
    text = Path(XARM7.description).read_text().replace('range="-6.28319 6.28319"', "", 1)
    (path / "endless.xml").write_text(text)
    return path / "endless.xml"


def tilted(path: Path) -> Path:
    text = Path(XARM7.description).read_text().replace('<body name="link_base">', '<body name="link_base" euler="0.3 0 0">')
    (path / "tilted.xml").write_text(text)
    return path / "tilted.xml"


def with_mesh(name: str) -> str:
    """The description of the UR5e with a mesh for one of its shapes."""
    text = Path(UR5E.description).read_text()
    return text.replace('<cylinder radius="0.06" length="0.14"/>', f'<mesh filename="{name}"/>', 1)


def described(path: Path, name: str) -> Path:
    (path / "meshed.urdf").write_text(with_mesh(name))
    return path / "meshed.urdf"


def test_a_mesh_in_a_ros_package_is_found_above_the_description(tmp_path: Path) -> None:
    (tmp_path / "arm" / "urdf").mkdir(parents=True)
    corners = np.array([[x, y, z] for x in (-0.05, 0.05) for y in (-0.05, 0.05) for z in (-0.05, 0.05)])
    write_obj(tmp_path / "arm" / "hull.obj", corners)
    file = described(tmp_path / "arm" / "urdf", "package://arm/hull.obj")
    assert DescribedArm(replace(UR5E, description=str(file))).joint_names


def write_obj(path: Path, corners: Array) -> None:
    lines = [f"v {x} {y} {z}" for x, y, z in corners.tolist()]
    path.write_text("\n".join(lines + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in ConvexHull(corners).simplices]))


@pytest.mark.parametrize("name", ["package://arm/hull.obj", "hull.obj", "hull.dae"])
def test_a_mesh_that_cannot_be_read_is_said_in_one_line(name: str, tmp_path: Path) -> None:
    (tmp_path / "hull.dae").write_text("<COLLADA/>")
    with pytest.raises(ContactCurationError, match=r"hull\.") as error:
        DescribedArm(replace(UR5E, description=str(described(tmp_path, name))))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (lambda _: {"acceleration": ()}, "arm.acceleration: found nothing, expected 7 numbers"),
        (lambda _: {"speed": ()}, "arm.speed: found nothing, expected 7 numbers: xarm7.xml has no speed limits"),
        (lambda _: {"speed": (1.0,) * 6}, "arm.speed"),
        (lambda _: {"joints": (*XARM7.joints[:6], "joint9")}, "joint9 not in xarm7.xml"),
        (lambda _: {"joints": (*XARM7.joints[1::-1], *XARM7.joints[2:])}, "another order"),
        (lambda _: {"flange": "hand"}, "arm.flange: found hand, expected a link of xarm7.xml: link_base"),
        (lambda _: {"home": (9.0,) * 7}, "arm.home"),
        (lambda _: {"description": "nowhere.urdf"}, "nowhere.urdf"),
        (lambda _: {"obstacles": (0.0,) * 5}, "arm.obstacles"),
        (lambda _: {"obstacles": (0.0, 0.0, 0.0, 0.1, 0.1, 0.0)}, "arm.obstacles: found a half size of 0 m"),
        (lambda _: {"table_half_width": 0.0}, "arm.table_half_width: found 0.0, expected a positive number"),
        (lambda _: {"margin": True}, "arm.margin: found True"),
        (lambda path: {"description": str(without_ranges(path))}, "range of joint1"),
        (lambda path: {"description": str(tilted(path))}, "degrees off the vertical"),
    ],
)  # fmt: skip
def test_what_a_description_lacks_is_said_in_one_line(
    change: Callable[[Path], dict[str, Any]], line: str, tmp_path: Path
) -> None:
    with pytest.raises(ContactCurationError) as error:
        DescribedArm(replace(XARM7, **change(tmp_path)))
    assert line in str(error.value)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("- a list", "found no mapping"),
        ("joint: [a]", "unknown"),
        ("{description: 5, joints: [a, b, c, d, e, f]}", "that is no text"),
        ("{description: a.urdf, joints: 6}", "that is no text"),
        ("{description: a.urdf, joints: [a, b, c, d, e, f], home: here}", "arm.home: found here, expected numbers"),
        ("{description: a.urdf, joints: [a, b, c, d, e, f], speed: null}", "arm.speed: found None, expected numbers"),
        ("{description: a.urdf, joints: [a, b, c, d, e, f], yaw: north}", "arm.yaw: found north, expected numbers"),
        ("joints: [a, b, c, d, e, f]", "arm.description: found nothing"),
    ],
)
def test_what_is_wrong_with_an_arms_file_is_said_in_one_line(text: str, line: str, tmp_path: Path) -> None:
    (tmp_path / "arm.yaml").write_text(text)
    with pytest.raises(ContactCurationError) as error:
        read_arm(tmp_path / "arm.yaml")
    assert line in str(error.value)
    assert "\n" not in str(error.value)
