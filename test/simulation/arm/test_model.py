"""The arm's model against published numbers, and against kinematics that were worked out in another way."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.polytopes import box
from contact_curation.simulation.arm.grasps import grasps_of
from contact_curation.simulation.arm.kinematics import postures_of
from contact_curation.simulation.arm.limits import FR3_LIMITS
from contact_curation.simulation.arm.model import (
    DEFAULT_ARM,
    GRIPPER_LENGTH,
    PAD,
    ArmConfig,
    free_model,
    holding_model,
    planning_model,
)
from contact_curation.simulation.arm.path import DEFAULT_RAMP, JointPath, moving, ramp_way, slowing_down, speeding_up
from contact_curation.simulation.arm.postures import least_speeds
from contact_curation.simulation.arm.safety import GateConfig
from contact_curation.simulation.arm.throw_motion import FRAME_PERIOD, STEP, STEPS_PER_FRAME
from contact_curation.simulation.world import free_motion
from test.simulated import release_states

OCTAHEDRON = 0.06 * np.concatenate([np.eye(3), -np.eye(3)])
WEDGE = np.array([[x, y, z] for x in (-0.04, 0.04) for y, z in ((-0.05, -0.02), (0.05, -0.02), (-0.05, 0.05))])


def body_of(vertices: np.ndarray) -> Body:
    return Body("shape", vertices, 0.2, np.full(3, 2e-4), 0.3, 0.05)


def test_the_model_and_the_denavit_hartenberg_parameters_are_one_arm() -> None:
    model = planning_model(CONTACTNETS_CUBE, DEFAULT_ARM)
    data = mujoco.MjData(model)
    joints = np.random.default_rng(0).uniform(FR3_LIMITS.lowest, FR3_LIMITS.highest, (7, 7))
    known = postures_of(joints, GRIPPER_LENGTH)
    base = Rotation.from_euler("z", DEFAULT_ARM.yaw).as_matrix()
    for k, posture in enumerate(joints):
        data.qpos[:] = posture
        mujoco.mj_forward(model, data)
        jacobian = np.zeros((6, 7))
        mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], model.site(PAD).id)
        np.testing.assert_allclose(data.site(PAD).xpos, np.array(DEFAULT_ARM.base) + base @ known.places[k], atol=1e-12)
        np.testing.assert_allclose(data.site(PAD).xmat.reshape(3, 3), base @ known.frames[k], atol=1e-12)
        np.testing.assert_allclose(jacobian[:3], base @ known.jacobians[k, :3], atol=1e-12)
        np.testing.assert_allclose(jacobian[3:], base @ known.jacobians[k, 3:], atol=1e-12)


def test_stretched_upwards_the_flange_is_where_the_data_sheet_has_it() -> None:
    stretched = postures_of(np.zeros((1, 7)), 0.0)
    np.testing.assert_allclose(stretched.places[0], [0.088, 0.0, 0.333 + 0.316 + 0.384 - 0.107], atol=1e-12)
    np.testing.assert_allclose(stretched.frames[0][:, 2], [0.0, 0.0, -1.0], atol=1e-12)


def test_a_body_beside_the_arm_moves_as_it_does_where_real_tosses_are_replayed() -> None:
    model = free_model(CONTACTNETS_CUBE, DEFAULT_ARM, STEP)
    for release in release_states(3, np.random.default_rng(7)):
        alone = free_motion(CONTACTNETS_CUBE, release, 90, FRAME_PERIOD)
        data = mujoco.MjData(model)
        data.qpos[:7], data.qvel[:6], seen = release[:7], release[7:], [release]
        for _ in alone[1:]:
            for _ in range(STEPS_PER_FRAME):
                data.qpos[7:], data.qvel[6:] = DEFAULT_ARM.home_posture, 0.0
                mujoco.mj_step(model, data)
            seen.append(np.concatenate([data.qpos[:7], data.qvel[:6]]))
        assert np.abs(alone[:, 2]).min() < 0.06  # it has been on the board
        np.testing.assert_allclose(np.array(seen)[:, :3], alone[:, :3], atol=1e-5)
        np.testing.assert_allclose(np.array(seen)[:, 7:10], alone[:, 7:10], atol=1e-3)


def test_the_models_have_the_published_limits_and_masses() -> None:
    for model in (planning_model(CONTACTNETS_CUBE, DEFAULT_ARM), holding_model(CONTACTNETS_CUBE, DEFAULT_ARM, STEP)):
        np.testing.assert_allclose(model.jnt_range[:7], np.column_stack([FR3_LIMITS.lowest, FR3_LIMITS.highest]))
        assert model.body("fr3_link2").mass == pytest.approx(2.9355, abs=1e-4)
        assert model.body_mass.sum() == pytest.approx(15.4947 + 1.01 + CONTACTNETS_CUBE.mass, abs=1e-3)
    free = free_model(CONTACTNETS_CUBE, DEFAULT_ARM, STEP)
    assert (free.nq, free.nv) == (14, 13)
    assert GateConfig().keep_out_place == DEFAULT_ARM.base[:2]


def test_no_speed_is_left_at_the_ends_of_a_range_and_all_of_it_in_the_middle() -> None:
    middle = 0.5 * (FR3_LIMITS.lowest + FR3_LIMITS.highest)
    low, high = FR3_LIMITS.fastest(middle)
    np.testing.assert_allclose(high[[0, 4, 6]], FR3_LIMITS.speed[[0, 4, 6]])
    np.testing.assert_allclose(-low[[0, 4, 6]], FR3_LIMITS.speed[[0, 4, 6]])
    low, high = FR3_LIMITS.fastest(FR3_LIMITS.highest)
    assert (high < 0.2).all()
    np.testing.assert_allclose(-low[[0, 4, 6]], FR3_LIMITS.speed[[0, 4, 6]])
    # joint 1 at 2.7 rad, by hand: sqrt(12 * (2.7501 - 2.7)) - 0.3
    posture = np.array([2.7, *middle[1:]])
    assert FR3_LIMITS.fastest(posture)[1][0] == pytest.approx(np.sqrt(12.0 * 0.0501) - 0.30)
    assert FR3_LIMITS.speed_use(posture, np.array([-2.62, *np.zeros(6)]))[0] == pytest.approx(1.0)
    assert FR3_LIMITS.speed_use(FR3_LIMITS.highest + 1.0, np.eye(7)[0])[0] == np.inf


def test_ramps_end_exactly_take_the_way_they_say_and_are_their_own_derivatives() -> None:
    posture, speeds = np.linspace(-1.0, 1.0, 7), np.array([2.0, -2.5, 0.1, 0.0, 5.0, -4.0, 0.3])
    for path, first in (
        (speeding_up(posture, speeds, 1e-3, DEFAULT_RAMP), -1),
        (slowing_down(posture, speeds, 1e-3, DEFAULT_RAMP), 0),
    ):
        np.testing.assert_allclose(path.positions[first], posture, atol=1e-12)
        np.testing.assert_allclose(path.speeds[first], speeds, atol=1e-12)
        np.testing.assert_allclose(path.speeds[-1 - first if first == 0 else 0], 0.0, atol=1e-9)
        way = path.positions[-1] - path.positions[0]
        np.testing.assert_allclose(way, ramp_way(speeds, DEFAULT_RAMP), atol=1e-9)
        check_derivatives(path)
    check_derivatives(moving(posture, posture + speeds, FR3_LIMITS.speed, 1e-3, DEFAULT_RAMP))


def check_derivatives(path: JointPath) -> None:
    assert np.abs(path.accelerations).max() <= DEFAULT_RAMP.acceleration + 1e-9
    np.testing.assert_allclose(np.gradient(path.positions, 1e-3, axis=0)[1:-1], path.speeds[1:-1], atol=1e-4)
    np.testing.assert_allclose(np.gradient(path.speeds, 1e-3, axis=0)[1:-1], path.accelerations[1:-1], atol=0.2)


def test_least_speeds_give_the_twist_and_no_others_on_the_line_use_less() -> None:
    rng = np.random.default_rng(1)
    jacobians = postures_of(rng.uniform(FR3_LIMITS.lowest, FR3_LIMITS.highest, (20, 7)), GRIPPER_LENGTH).jacobians
    twists = jacobians @ rng.standard_normal(7)
    speeds = least_speeds(jacobians, twists, FR3_LIMITS)
    np.testing.assert_allclose(np.einsum("nij,nj->ni", jacobians, speeds), twists, atol=1e-5)
    for jacobian, found in zip(jacobians, speeds):
        idle = np.linalg.svd(jacobian)[2][-1]
        others = found + np.linspace(-3.0, 3.0, 601)[:, None] * idle
        assert (np.abs(found) / FR3_LIMITS.speed).max() <= (np.abs(others) / FR3_LIMITS.speed).max(axis=1).min() + 1e-4


@pytest.mark.parametrize(("vertices", "count"), [(box([0.04, 0.05, 0.06]).vertices, 6), (OCTAHEDRON, 8), (WEDGE, 5)])
def test_a_pad_fits_in_the_middle_of_each_face_of_a_convex_body(vertices: np.ndarray, count: int) -> None:
    grasps = grasps_of(body_of(vertices))
    assert len(grasps) == count
    for place, normal in zip(grasps.places, grasps.normals):
        heights = vertices @ normal
        assert heights.max() == pytest.approx(place @ normal)  # on the face, and nothing of the body is in front of it
        assert np.linalg.norm(normal) == pytest.approx(1.0)


def test_a_body_without_a_face_for_the_pad_is_refused() -> None:
    with pytest.raises(InvalidValueError, match="for the pad"):
        grasps_of(body_of(0.1 * OCTAHEDRON))


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"base": (0.0, 0.0)}, "base"),
        ({"yaw": np.nan}, "yaw"),
        ({"home": (0.0,) * 7}, "home"),
        ({"clearance": -1.0}, "clearance"),
        ({"margin": 1.1}, "margin"),
        ({"friction": np.inf}, "friction"),
    ],
)
def test_an_arm_that_cannot_be_is_refused(change: dict[str, object], name: str) -> None:
    with pytest.raises(InvalidValueError, match=name):
        ArmConfig(**change)  # type: ignore[arg-type]
