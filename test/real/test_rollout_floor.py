"""How near the true cube comes to the real tosses, by our rollouts and by MuJoCo (method.md 1.11, 6.14)."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.models.deep import DeepModel
from contact_curation.contact.parameter_form import Form
from contact_curation.contact.rollout import Rollout, rollout
from contact_curation.contact.time_step import StepStatus
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.evaluation.motion_errors import MotionErrors, motion_errors
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import states_of
from contact_curation.simulation.world import DEFAULT_WORLD, MUJOCO_DEFAULTS, WorldConfig, free_motion
from test.simulated import FRAME_PERIOD, length_scales


@pytest.fixture(scope="module")
def measured(real_tosses: tuple[Toss, ...]) -> tuple[Array, ...]:
    """States of all 570 tosses, in characteristic lengths."""
    return tuple(states_of(toss, CONTACTNETS_CUBE.length_scale) for toss in real_tosses)


def replayed(measured: tuple[Array, ...], friction: float) -> Rollout:
    """The true cube from each toss's first measured state."""
    geometry = ContactGeometry.of_body(replace(CONTACTNETS_CUBE, friction=friction))
    first, lengths = [states[0] for states in measured], [len(states) for states in measured]
    return rollout(geometry, CONTACTNETS_CUBE, first, lengths, FRAME_PERIOD, threads=2)


def errors_of(predicted: Array, measured: tuple[Array, ...]) -> MotionErrors:
    starts = np.cumsum([0, *map(len, measured)])
    return motion_errors(predicted, np.concatenate(measured), starts, CONTACTNETS_CUBE)


def test_the_true_cube_reaches_the_physical_floor(measured: tuple[Array, ...]) -> None:
    rolled = replayed(measured, friction=0.18)
    errors = errors_of(rolled.states, measured)
    assert errors.position.mean() == pytest.approx(14.4, abs=0.3)
    assert errors.rotation.mean() == pytest.approx(18.3, abs=0.5)
    assert errors.penetration.mean() < 0.01
    assert np.median(errors.position) == pytest.approx(11.9, abs=0.3)
    assert np.median(errors.rotation) == pytest.approx(8.9, abs=0.5)
    assert np.mean(rolled.status == StepStatus.CONVERGED) > 0.999


@pytest.mark.slow
def test_position_error_is_least_at_the_true_friction(measured: tuple[Array, ...]) -> None:
    sweep = [0.10, 0.15, 0.18, 0.22, 0.30]
    position = [errors_of(replayed(measured, friction).states, measured).position.mean() for friction in sweep]
    assert position[0] > position[1] > position[2] < position[3] < position[4]


def test_the_measured_motions_own_penetration_is_that_of_the_data(measured: tuple[Array, ...]) -> None:
    assert errors_of(np.concatenate(measured), measured).penetration.mean() == pytest.approx(1.47, abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("world", "position", "penetration"),
    [
        pytest.param(DEFAULT_WORLD, 13.1, 0.2, id="ours"),
        pytest.param(MUJOCO_DEFAULTS, 13.9, 1.0, id="MuJoCo's own"),
    ],
)
def test_mujoco_an_engine_of_its_own_comes_as_near_within_two_points(
    measured: tuple[Array, ...], world: WorldConfig, position: float, penetration: float
) -> None:
    scales, cube = length_scales(CONTACTNETS_CUBE), CONTACTNETS_CUBE
    moved = [free_motion(cube, states[0] * scales, len(states), FRAME_PERIOD, world) / scales for states in measured]
    theirs, ours = errors_of(np.concatenate(moved), measured), errors_of(replayed(measured, 0.18).states, measured)
    assert theirs.position.mean() == pytest.approx(ours.position.mean(), abs=2.0)
    assert theirs.rotation.mean() == pytest.approx(ours.rotation.mean(), abs=2.0)
    assert theirs.position.mean() == pytest.approx(position, abs=0.5)
    assert theirs.penetration.mean() < penetration


def test_the_path_of_networks_gives_the_polytopes_motions_from_real_releases(measured: tuple[Array, ...]) -> None:
    some = tuple(states[:100] for states in measured[::40])
    expected = replayed(some, 0.18)
    model = DeepModel(ContactGeometry.of_body(CONTACTNETS_CUBE), CONTACTNETS_CUBE, Form.PHYSICAL)
    first, lengths = [states[0] for states in some], [len(states) for states in some]
    found = model.roll_out(first, lengths, FRAME_PERIOD)
    np.testing.assert_array_equal(found.starts, expected.starts)
    np.testing.assert_allclose(found.states, expected.states, rtol=0.0, atol=1e-6)
