"""Polytopes and the heights of their corners over the board."""

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.polytopes import Polytope, box


def test_corner_heights_are_the_third_coordinates_of_the_corners_in_the_board_frame() -> None:
    rng = np.random.default_rng(1)
    polytope = Polytope(rng.normal(size=(7, 3)))
    positions, orientations = rng.normal(size=(2, 4, 3)), quaternions.exp(rng.normal(size=(2, 4, 3)))
    heights = polytope.corner_heights(positions, orientations)
    assert heights.shape == (2, 4, 7)
    for index in np.ndindex(2, 4, 7):
        corner = quaternions.rotate(orientations[index[:2]], polytope.vertices[index[2]]) + positions[index[:2]]
        assert heights[index] == pytest.approx(corner[2], abs=1e-12)


def test_a_cube_stands_on_a_face_on_an_edge_and_on_a_corner() -> None:
    cube = box([0.5, 0.5, 0.5])
    flat = cube.corner_heights([0.0, 0.0, 0.5], quaternions.IDENTITY)
    np.testing.assert_allclose(np.sort(flat), [0, 0, 0, 0, 1, 1, 1, 1], atol=1e-12)
    edge = cube.corner_heights([0.0, 0.0, np.sqrt(0.5)], quaternions.exp([np.pi / 4, 0.0, 0.0]))
    np.testing.assert_allclose(np.sort(edge)[:3], [0, 0, np.sqrt(0.5)], atol=1e-12)


def test_faces_beside_an_edge_rise_less_the_more_there_are() -> None:
    assert box([0.5, 0.5, 0.5]).balanced_rise == pytest.approx(np.sqrt(0.5))
    angles = np.arange(12) * np.pi / 6
    prism = Polytope(np.array([(np.cos(angle), np.sin(angle), z) for angle in angles for z in (-1.5, 1.5)]))
    assert prism.balanced_rise == pytest.approx(1.0 - np.cos(np.pi / 6))


def test_a_plate_on_its_broad_face_is_far_from_an_edge() -> None:
    assert box([0.1, 0.1, 0.004]).balanced_rise > 0.1


def test_the_box_of_a_cube_has_contactnets_corners() -> None:
    ours = {tuple(corner) for corner in box([0.0524] * 3).vertices}
    assert ours == {tuple(corner) for corner in CONTACTNETS_CUBE.vertices}


@pytest.mark.parametrize("size", [1e-300, 1e300, 1e308])
def test_a_box_of_any_size_has_a_volume(size: float) -> None:
    assert len(box(np.full(3, size)).vertices) == 8


@pytest.mark.parametrize(
    ("vertices", "why"),
    [
        (np.zeros((3, 3)), r"shape \(3, 3\), expected \(V, 3\)"),
        (np.zeros((8, 2)), r"shape \(8, 2\)"),
        (np.full((4, 3), np.nan), "not finite"),
        (np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.0]]), "all in one plane"),
    ],
)
def test_what_is_no_body_is_refused(vertices: np.ndarray, why: str) -> None:
    with pytest.raises(InvalidValueError, match=why):
        Polytope(vertices)
