"""A release in its heading frame is the release without place and heading."""

import numpy as np
import pytest

from contact_curation.design.releases import Placement, Releases
from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from test.design.cases import releases


def turned(states: Array, yaw: float, shift: tuple[float, float]) -> Array:
    """The same motions elsewhere and in another direction."""
    turn = quaternions.exp(np.array([0.0, 0.0, yaw]))
    moved = states.copy()
    moved[:, :3] = quaternions.rotate(turn, states[:, :3]) + np.array([*shift, 0.0])
    moved[:, 3:7] = quaternions.multiply(turn, states[:, 3:7])
    moved[:, 7:10] = quaternions.rotate(turn, states[:, 7:10])
    return moved


def test_a_release_comes_back_from_its_heading_frame() -> None:
    states = releases(7)
    back = Releases.of_states(states).states(Placement())
    np.testing.assert_allclose(back, states, atol=1e-12)


def test_neither_place_nor_heading_changes_what_is_left_of_a_release() -> None:
    states = releases(7)
    here, there = Releases.of_states(states), Releases.of_states(turned(states, 2.5, (0.4, -0.3)))
    np.testing.assert_allclose(there.motion, here.motion, atol=1e-12)
    np.testing.assert_allclose(quaternions.angle_between(there.orientations_wxyz, here.orientations_wxyz), 0.0, atol=1e-7)


def test_a_placement_puts_releases_where_it_says() -> None:
    placed = Releases.of_states(releases(5)).states(Placement((0.1, 0.2), np.pi / 2.0))
    np.testing.assert_allclose(placed[:, :2], [[0.1, 0.2]] * 5)
    np.testing.assert_allclose(placed[:, 7], 0.0, atol=1e-12)
    assert (placed[:, 8] > 0.5).all()


def test_a_step_moves_motion_and_turns_about_the_bodys_own_axes() -> None:
    start = Releases.of_states(releases(3))
    step = np.array([[0.01, 0.1, -0.1, 1.0, 2.0, 3.0, 0.2, 0.0, 0.0]] * 3)
    moved = start.moved(step)
    np.testing.assert_allclose(moved.motion - start.motion, step[:, :6])
    turn = quaternions.multiply(quaternions.conjugate(start.orientations_wxyz), moved.orientations_wxyz)
    np.testing.assert_allclose(quaternions.log(turn), step[:, 6:], atol=1e-12)


@pytest.mark.parametrize("place", [(0.0,), (np.nan, 0.0)])
def test_a_place_that_is_none_is_refused(place: tuple[float, float]) -> None:
    with pytest.raises(InvalidValueError, match=r"placement\.place"):
        Placement(place)
