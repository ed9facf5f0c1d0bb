"""The simulated world: free flight and friction by hand, momentum of a lopsided body, and our own rollouts beside MuJoCo's."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.rollout import rollout
from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.evaluation.motion_errors import motion_errors
from contact_curation.simulation.world import DEFAULT_WORLD, WorldConfig, free_motion, world_of
from test.simulated import FRAME_PERIOD, length_scales, release_states

HALF_WIDTH = CONTACTNETS_CUBE.length_scale
GRAVITY = CONTACTNETS_CUBE.gravity


def lopsided_body() -> Body:
    """Full inertia matrix, and a centre of mass away from the vertices' centre."""
    masses = np.array([[0.05, 0.02, 0.0], [0.0, 0.03, -0.02], [0.03, 0.0, 0.03]])  # in three points, a third each
    inertia = 0.37 / 3 * sum(point @ point * np.eye(3) - np.outer(point, point) for point in masses)
    vertices = CONTACTNETS_CUBE.vertices + np.array([0.01, -0.005, 0.02])
    return Body("lopsided", vertices, 0.37, inertia, 0.3, HALF_WIDTH)


def state_of(position: list[float], velocity: list[float], orientation: Array = quaternions.IDENTITY) -> Array:
    """At a place [m], with a velocity [m/s], without spin."""
    return np.concatenate([position, orientation, velocity, np.zeros(3)])


def test_a_free_flight_is_the_one_of_the_textbook() -> None:
    release = release_states(1, np.random.default_rng(1))[0] + np.array([0, 0, 10.0, *10 * [0]])
    states, step = free_motion(CONTACTNETS_CUBE, release, 100, FRAME_PERIOD), FRAME_PERIOD / 7
    time = FRAME_PERIOD * np.arange(100)[:, None]
    fall = 0.5 * GRAVITY * time * (time + step) * np.array([0.0, 0.0, 1.0])  # semi-implicit: a step's velocity is its last
    np.testing.assert_allclose(states[:, :3], release[:3] + time * release[7:10] - fall, atol=1e-9)
    turned = quaternions.multiply(release[3:7], quaternions.exp(time * release[10:]))
    np.testing.assert_allclose(quaternions.angle_between(states[:, 3:7], turned), 0.0, atol=1e-6)
    np.testing.assert_allclose(states[:, 7:10], release[7:10] - GRAVITY * time * np.array([0.0, 0.0, 1.0]), atol=1e-9)
    np.testing.assert_allclose(states[:, 10:], np.tile(release[10:], (100, 1)), atol=1e-9)


def test_a_lopsided_body_keeps_its_angular_momentum_in_flight() -> None:
    body = lopsided_body()
    release = release_states(1, np.random.default_rng(2))[0] + np.array([0, 0, 10.0, *10 * [0]])
    states = free_motion(body, release, 40, FRAME_PERIOD, WorldConfig(longest_step=1e-4))
    momentum = quaternions.rotate(states[:, 3:7], states[:, 10:] @ body.inertia)
    assert np.abs(states[:, 10:] - release[10:]).max() > 0.5
    np.testing.assert_allclose(momentum, np.tile(momentum[0], (40, 1)), rtol=0.0, atol=2e-3 * np.linalg.norm(momentum[0]))


@pytest.mark.parametrize("body", [CONTACTNETS_CUBE, lopsided_body()], ids=lambda body: str(body.name))
def test_a_dropped_body_comes_to_rest_on_its_lowest_vertices(body: Body) -> None:
    lowest = body.vertices[:, 2].min()
    rested = free_motion(body, state_of([0.0, 0.0, 0.01 - lowest], [0.0, 0.0, 0.0]), 300, FRAME_PERIOD)[-1]
    assert rested[2] == pytest.approx(-lowest, abs=1e-3)
    assert np.degrees(quaternions.angle_between(rested[3:7], quaternions.IDENTITY)) < 1.0
    np.testing.assert_allclose(rested[7:], 0.0, atol=1e-2)


@pytest.mark.parametrize("heading", [0.0, np.pi / 4])
@pytest.mark.parametrize("friction", [0.18, 0.3])
def test_a_sliding_body_is_slowed_down_by_its_friction_alike_in_all_directions(heading: float, friction: float) -> None:
    body, speed = replace(CONTACTNETS_CUBE, friction=friction), 1.0
    rested = free_motion(body, state_of([0.0, 0.0, HALF_WIDTH], [0.0, 0.0, 0.0]), 200, FRAME_PERIOD)[-1]
    rested[7:10] = speed * np.array([np.cos(heading), np.sin(heading), 0.0])
    states = free_motion(body, rested, 20, FRAME_PERIOD)
    lost = speed - np.linalg.norm(states[-1, 7:10])
    assert lost == pytest.approx(friction * GRAVITY * 19 * FRAME_PERIOD, rel=0.06)


def test_our_rollouts_and_the_engine_move_alike_but_for_soft_contacts() -> None:
    releases, frames = release_states(12, np.random.default_rng(3)), 110
    theirs = np.concatenate([free_motion(CONTACTNETS_CUBE, release, frames, FRAME_PERIOD) for release in releases])
    scales, geometry = length_scales(CONTACTNETS_CUBE), ContactGeometry.of_body(CONTACTNETS_CUBE)
    ours = rollout(geometry, CONTACTNETS_CUBE, releases / scales, frames, FRAME_PERIOD)
    errors = motion_errors(theirs / scales, ours.states, ours.starts, CONTACTNETS_CUBE)
    assert errors.position.mean() < 14.0
    assert errors.rotation.mean() < 6.0
    assert 0.0 < errors.penetration.mean() < 0.15


def test_the_same_release_gives_the_same_motion_and_the_first_row_is_the_release() -> None:
    release = release_states(1, np.random.default_rng(4))[0]
    states = free_motion(CONTACTNETS_CUBE, release, 60, FRAME_PERIOD)
    np.testing.assert_array_equal(states[0], release)
    np.testing.assert_array_equal(free_motion(CONTACTNETS_CUBE, release, 60, FRAME_PERIOD), states)
    np.testing.assert_array_equal(free_motion(CONTACTNETS_CUBE, release, 1, FRAME_PERIOD), states[:1])


@pytest.mark.parametrize(("longest", "steps"), [(0.0035, 2), (0.0034, 2), (0.0033, 3), (1.0, 1), (FRAME_PERIOD, 1)])
def test_a_frame_is_cut_into_equal_steps(longest: float, steps: int) -> None:
    assert WorldConfig(longest).steps_in(FRAME_PERIOD) == steps


@pytest.mark.parametrize("speed", [1e9, 1e200])
def test_an_unstable_motion_ends_in_rows_that_are_not_numbers(
    speed: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # MuJoCo writes a log file where it runs
    states = free_motion(CONTACTNETS_CUBE, state_of([0.0, 0.0, 0.1], [0.0, 0.0, -speed]), 5, FRAME_PERIOD)
    assert np.isfinite(states[0]).all()
    assert np.isnan(states[1:]).all()


def test_the_world_has_one_free_body_with_the_friction_and_inertia_of_the_body() -> None:
    body = lopsided_body()
    model = world_of(body, 0.001).compile()
    assert (model.nq, model.nv, model.ngeom) == (7, 6, 2)
    moments = model.body(body.name).inertia
    np.testing.assert_allclose(np.sort(moments), np.linalg.eigvalsh(body.inertia), rtol=1e-9)
    assert model.geom(body.name).friction[0] == body.friction
    assert model.opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC


@pytest.mark.parametrize(
    ("change", "frames", "period", "name"),
    [
        ({"shape": 12}, 3, FRAME_PERIOD, "states"),
        ({0: np.nan}, 3, FRAME_PERIOD, "release"),
        ({3: 2.0}, 3, FRAME_PERIOD, "quaternion"),
        ({}, 0, FRAME_PERIOD, "frames"),
        ({}, 3, 0.0, "frame_period"),
        ({}, 3, np.inf, "frame_period"),
    ],
)
def test_wrong_releases_are_refused(change: dict[object, float], frames: int, period: float, name: str) -> None:
    release = state_of([0.0, 0.0, 0.1], [0.0, 0.0, 0.0])[: int(change.get("shape", 13))]
    for column, value in change.items():
        if isinstance(column, int):
            release[column] = value
    with pytest.raises(InvalidValueError, match=name):
        free_motion(CONTACTNETS_CUBE, release, frames, period)


def test_a_world_needs_steps_of_some_length() -> None:
    with pytest.raises(InvalidValueError, match="longest_step"):
        replace(DEFAULT_WORLD, longest_step=0.0)
