"""Errors of motion: hand cases, a plain loop, and the physical floor on ContactNets' real tosses (method.md 1.11, 6.14)."""

from dataclasses import replace
from math import acos, degrees
from pathlib import Path

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.rollout import rollout
from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.polytopes import box
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.evaluation.motion_errors import body_width, motion_errors
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import states_of
from contact_curation.storage.datasets.contactnets import read_contactnets

REST = np.array([0.0, 0.0, 1.0, 1.0, *[0.0] * 9])
"""The cube flat on the plane."""


def motions(count: int, seed: int) -> tuple[Array, Array]:
    """States (N, 13) of motions of 3, 4, 5, ... frames, and their starts."""
    rng = np.random.default_rng(seed)
    starts = np.cumsum([0, *range(3, 3 + count)])
    states = rng.standard_normal((starts[-1], 13))
    states[:, 3:7] = quaternions.normalized(states[:, 3:7])
    return states, starts


def test_a_motion_has_no_error_against_itself() -> None:
    states, starts = motions(3, seed=1)
    errors = motion_errors(states, states, starts, CONTACTNETS_CUBE)
    np.testing.assert_array_equal(errors.position, 0.0)
    np.testing.assert_allclose(errors.rotation, 0.0, atol=1e-6)


def test_lengths_are_percent_of_the_bodys_width_and_the_first_frame_counts() -> None:
    predicted = np.stack([REST, REST, REST])
    predicted[1, 1] += 0.2
    predicted[2, 2] -= 0.1
    errors = motion_errors(predicted, np.stack([REST] * 3), [0, 3], CONTACTNETS_CUBE)
    assert errors.position[0] == pytest.approx(100.0 * (0.0 + 0.2 + 0.1) / 3 / 2.0)  # the cube is 2 half widths wide
    assert errors.penetration[0] == pytest.approx(100.0 * 0.1 / 3 / 2.0)
    assert errors.rotation[0] == 0.0


def test_a_width_is_the_bodys_own_in_its_own_unit() -> None:
    assert body_width(CONTACTNETS_CUBE) == pytest.approx(2.0)
    assert body_width(replace(CONTACTNETS_CUBE, length_scale=1.0)) == pytest.approx(0.1048)
    assert body_width(replace(CONTACTNETS_CUBE, vertices=box([0.1, 0.2, 0.3]).vertices, length_scale=1.0)) == pytest.approx(0.4)


@pytest.mark.parametrize("angle", [1e-9, 0.3, 2.0, np.pi - 1e-9, np.pi])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_angles_are_exact_from_none_to_a_half_turn_whatever_the_quaternions_sign(angle: float, sign: float) -> None:
    turned = REST.copy()
    turned[3:7] = sign * quaternions.exp(angle * np.array([0.6, 0.0, 0.8]))
    errors = motion_errors(turned[None], REST[None], [0, 1], CONTACTNETS_CUBE)
    assert errors.rotation[0] == pytest.approx(degrees(angle), rel=1e-7)


def test_a_batch_is_what_a_plain_loop_gives() -> None:
    predicted, starts = motions(7, seed=2)
    measured, _ = motions(7, seed=3)
    errors = motion_errors(predicted, measured, starts, CONTACTNETS_CUBE)
    for k in range(7):
        distances, angles, depths = [], [], []
        for ours, theirs in zip(predicted[starts[k] : starts[k + 1]], measured[starts[k] : starts[k + 1]], strict=True):
            distances.append(50.0 * float(np.sqrt(((ours[:3] - theirs[:3]) ** 2).sum())))
            angles.append(degrees(2.0 * acos(min(1.0, abs(float(ours[3:7] @ theirs[3:7]))))))
            corners = CONTACTNETS_CUBE.scaled_vertices @ quaternions.to_matrix(ours[3:7]).T + ours[:3]
            depths.append(50.0 * max(0.0, -float(corners[:, 2].min())))
        assert errors.position[k] == pytest.approx(np.mean(distances))
        assert errors.rotation[k] == pytest.approx(np.mean(angles))
        assert errors.penetration[k] == pytest.approx(np.mean(depths))


@pytest.mark.parametrize(("column", "value"), [(0, np.nan), (4, np.nan), (9, np.inf), (2, 1e300)])
def test_a_motion_that_is_not_finite_or_runs_away_is_nan_and_the_others_are_as_before(column: int, value: float) -> None:
    predicted, starts = motions(3, seed=4)
    measured, _ = motions(3, seed=5)
    clean = motion_errors(predicted, measured, starts, CONTACTNETS_CUBE)
    predicted[starts[1] + 2, column] = value
    errors = motion_errors(predicted, measured, starts, CONTACTNETS_CUBE)
    assert errors.finite.tolist() == [True, False, True]
    for name in ("position", "rotation", "penetration"):
        ours, expected = getattr(errors, name), getattr(clean, name)
        assert np.isnan(ours[1])
        np.testing.assert_array_equal(ours[[0, 2]], expected[[0, 2]])


@pytest.mark.parametrize("starts", [[0, 2], [0, 7, 7], [1, 7], [0], [[0, 7]], [0, 5, 3, 7]])
def test_starts_that_are_no_partition_are_refused(starts: list[int]) -> None:
    states, _ = motions(2, seed=6)
    with pytest.raises(InvalidValueError, match="starts"):
        motion_errors(states, states, starts, CONTACTNETS_CUBE)


def test_states_of_different_shapes_are_refused() -> None:
    states, starts = motions(2, seed=7)
    with pytest.raises(InvalidValueError, match="predicted states"):
        motion_errors(states[:-1], states, starts, CONTACTNETS_CUBE)


def test_the_true_cube_reaches_the_physical_floor_and_the_data_their_own_penetration(contactnets_folder: Path) -> None:
    tosses = [item for item in read_contactnets(contactnets_folder) if isinstance(item, Toss)]
    measured = [states_of(toss, CONTACTNETS_CUBE.length_scale) for toss in tosses]
    starts, together = np.cumsum([0, *map(len, measured)]), np.concatenate(measured)
    geometry = ContactGeometry.of_body(CONTACTNETS_CUBE)
    rolled = rollout(geometry, CONTACTNETS_CUBE, together[starts[:-1]], np.diff(starts), 1.0 / 148.0)
    errors = motion_errors(rolled.states, together, starts, CONTACTNETS_CUBE)
    assert len(tosses) == 570
    assert errors.position.mean() == pytest.approx(14.4, abs=0.3)
    assert errors.rotation.mean() == pytest.approx(18.3, abs=0.5)
    assert errors.penetration.mean() < 0.01
    own = motion_errors(together, together, starts, CONTACTNETS_CUBE)
    assert own.penetration.mean() == pytest.approx(1.47, abs=0.01)
