"""Shapes have the mass properties of the textbooks, and their corners stay as near as is said."""

import numpy as np
import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.solids import shapes
from contact_curation.geometry.solids.mass_properties import combined, of_hull
from contact_curation.geometry.solids.simplification import hull_corners

MOST = 32


def rotation(seed: int) -> np.ndarray:
    turn, _ = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))
    return np.asarray(turn * np.linalg.det(turn))


def test_the_mass_properties_of_a_hull_are_those_of_the_box_that_it_is() -> None:
    box = shapes.box([0.03, 0.05, 0.11]).moved(rotation(0), np.array([0.2, -0.1, 0.4]))
    found = of_hull(box.points)
    assert found.mass == pytest.approx(box.uniform.mass, rel=1e-12)
    np.testing.assert_allclose(found.center, box.uniform.center, atol=1e-14)
    np.testing.assert_allclose(found.inertia, box.uniform.inertia, atol=1e-15)


def test_two_halves_of_a_box_are_the_box() -> None:
    half = shapes.box([0.03, 0.05, 0.055])
    parts = [half.moved(np.eye(3), np.array([0.0, 0.0, end])) for end in (-0.055, 0.055)]
    whole, both = shapes.box([0.03, 0.05, 0.11]), shapes.union(parts)
    np.testing.assert_allclose(both.uniform.inertia, whole.uniform.inertia, rtol=1e-12)
    np.testing.assert_allclose(hull_corners(both.points, MOST).vertices, hull_corners(whole.points, MOST).vertices)
    assert combined([part.uniform for part in parts]).mass == pytest.approx(whole.uniform.mass)


@pytest.mark.parametrize(
    ("shape", "fine"),
    [
        (shapes.cylinder(0.03, 0.1), 2e-2),
        (shapes.sphere(0.05), 1e-2),
        (shapes.ellipsoid([0.03, 0.04, 0.07]), 1e-2),
        (shapes.capsule(0.02, 0.06), 1e-2),
    ],
    ids=["cylinder", "sphere", "ellipsoid", "capsule"],
)
def test_a_round_shape_has_nearly_the_mass_of_the_hull_of_its_points_and_a_bit_more(shape: shapes.Solid, fine: float) -> None:
    hull = of_hull(shape.points)
    assert hull.mass < shape.uniform.mass
    assert hull.mass == pytest.approx(shape.uniform.mass, rel=2.0 * fine)
    np.testing.assert_allclose(hull.inertia, shape.uniform.inertia, rtol=4.0 * fine, atol=1e-12)


def test_a_round_shape_says_how_far_its_points_hull_is_inside_it() -> None:
    from scipy.spatial import ConvexHull

    ball, tube = shapes.sphere(1.0), shapes.cylinder(1.0, 4.0)
    assert -ConvexHull(ball.points).equations[:, 3].max() == pytest.approx(1.0 - ball.error, abs=1e-5)
    assert -ConvexHull(tube.points).equations[:, 3].max() == pytest.approx(1.0 - tube.error, abs=1e-12)


def test_points_on_faces_and_edges_and_those_inside_are_no_corners() -> None:
    lattice = np.stack(np.meshgrid(*[np.linspace(-0.05, 0.05, 7)] * 3), axis=-1).reshape(-1, 3) @ rotation(1).T
    found = hull_corners(lattice, MOST)
    assert (len(found.vertices), found.hull_count, found.error) == (8, 8, 0.0)


def test_of_more_corners_than_are_wanted_those_are_taken_that_stay_near_the_hull() -> None:
    points = np.random.default_rng(2).standard_normal((40, 3))
    points *= 0.05 / np.linalg.norm(points, axis=1)[:, None]
    found = hull_corners(points, MOST)
    assert (len(found.vertices), found.hull_count) == (MOST, 40)
    left_out = [point for point in points if not (found.vertices == point).all(axis=1).any()]
    distances = [distance_to_hull(point, found.vertices) for point in left_out]
    assert found.error == pytest.approx(max(distances), rel=1e-4)


def distance_to_hull(point: np.ndarray, vertices: np.ndarray) -> float:
    """By non-negative least squares over the weights of the vertices, which sum to 1."""
    from scipy.optimize import nnls

    heavy = 100.0
    rows = np.vstack([vertices.T, np.full(len(vertices), heavy)])
    weights, _ = nnls(rows, np.array([*point, heavy]))
    return float(np.linalg.norm(weights @ vertices - point))


@pytest.mark.parametrize(
    "points", [np.zeros((5, 3)), np.eye(3), [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 1e-12]], [[np.nan] * 3] * 4]
)
def test_points_without_a_volume_are_refused(points: object) -> None:
    with pytest.raises(InvalidValueError, match="vertices"):
        hull_corners(np.asarray(points, dtype=float), MOST)
