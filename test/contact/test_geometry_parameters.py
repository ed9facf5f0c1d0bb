"""A theta that is none is refused in one line that says what was found and what a theta has."""

from typing import Any

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.impulse_noise import ImpulseNoise
from contact_curation.errors import InvalidValueError

RIGHT: dict[str, Any] = {
    "vertices_normal": np.ones((4, 3)),
    "normal": np.array([0.0, 0.0, 1.0]),
    "vertices_tangent": np.ones((4, 3)),
    "tangents": np.eye(2, 3),
}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"vertices_normal": np.ones(3)}, "vertices_normal: found shape (3,), expected (V, 3) with V >= 1"),
        ({"vertices_normal": np.ones((0, 3))}, "vertices_normal: found shape (0, 3), expected (V, 3) with V >= 1"),
        ({"vertices_tangent": np.ones((3, 3))}, "vertices_tangent: found shape (3, 3), expected (4, 3)"),
        ({"tangents": np.eye(3)}, "tangents: found shape (3, 3), expected (2, 3)"),
        ({"pivot": np.zeros(2)}, "pivot: found shape (2,), expected (3,)"),
        ({"normal": np.array([0.0, np.inf, 1.0])}, "normal: found a value that is not finite, expected finite numbers"),
        ({"normal": np.zeros(3)}, "normal: found the zero vector, expected a direction"),
        ({"height": np.nan}, "height: found nan, expected a finite number"),
        ({"restitution": -0.01}, "restitution: found -0.01, expected a number from 0 to 1"),
        ({"restitution": 1.01}, "restitution: found 1.01, expected a number from 0 to 1"),
        ({"restitution": np.nan}, "restitution: found nan, expected a number from 0 to 1"),
    ],
)
def test_what_is_no_theta_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidValueError) as refused:
        ContactGeometry(**{**RIGHT, **changes})
    assert str(refused.value) == message


def test_one_vertex_is_enough_and_arrays_are_of_floats() -> None:
    geometry = ContactGeometry(**{**RIGHT, "vertices_normal": [[1, 2, 3]], "vertices_tangent": [[1, 2, 3]]})
    assert geometry.vertex_count == 1
    assert geometry.vertices_normal.dtype == float


def test_the_kernels_numbers_are_six_a_vertex_ten_and_a_restitution() -> None:
    plain, bouncing = ContactGeometry(**RIGHT), ContactGeometry(**RIGHT, restitution=0.0)
    assert (plain.kernel_size, bouncing.kernel_size) == (34, 35)
    assert ContactGeometry(**RIGHT, restitution=1.0).restitution == 1.0
    assert plain.rigid().noise == ImpulseNoise()
    noise = ImpulseNoise(0.5)
    known = ContactGeometry(**RIGHT, noise=noise)
    assert known.rigid() is known
    assert not plain.has_own_friction_vertices
    assert ContactGeometry(**{**RIGHT, "vertices_tangent": np.zeros((4, 3))}).has_own_friction_vertices


def test_a_gap_is_the_height_of_a_vertex_over_the_plane_through_the_pivot() -> None:
    """phi_i(q) = n . (R p_i + x - pivot) - height."""
    vertices = np.array([[1.0, 2.0, 3.0], [-1.0, 0.5, 0.0]])
    normal, pivot = np.array([0.1, -0.2, 0.9]), np.array([0.3, 0.4, 0.5])
    geometry = ContactGeometry(vertices, normal, vertices, np.eye(2, 3), pivot, 0.25)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # a quarter about the vertical
    state = np.concatenate([[7.0, 8.0, 9.0], np.sqrt([0.5, 0.0, 0.0, 0.5]), np.zeros(6)])
    expected = [normal @ (turn @ vertex + state[:3] - pivot) - 0.25 for vertex in vertices]
    np.testing.assert_allclose(geometry.gaps(state), expected, rtol=1e-12)
    np.testing.assert_allclose(geometry.gaps(np.tile(state, (2, 3, 1))), np.tile(expected, (2, 3, 1)), rtol=1e-12)


def test_a_bodys_geometry_stands_on_the_plane_with_its_own_friction() -> None:
    geometry = ContactGeometry.of_body(CONTACTNETS_CUBE)
    np.testing.assert_array_equal(geometry.vertices_normal, CONTACTNETS_CUBE.vertices / 0.0524)
    np.testing.assert_array_equal(geometry.vertices_tangent, geometry.vertices_normal)
    np.testing.assert_array_equal(geometry.normal, [0.0, 0.0, 1.0])
    np.testing.assert_array_equal(geometry.tangents, [[0.18, 0.0, 0.0], [0.0, 0.18, 0.0]])
    np.testing.assert_array_equal(geometry.pivot, np.zeros(3))
    assert (geometry.height, geometry.noise, geometry.restitution) == (0.0, None, None)
