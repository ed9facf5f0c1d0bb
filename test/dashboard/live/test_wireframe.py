"""Edges and faces of convex bodies."""

import numpy as np
import pytest

from contact_curation.dashboard.live.wireframe import wireframe_of
from contact_curation.geometry.polytopes import box
from contact_curation.geometry.quaternions import Array

OCTAHEDRON = np.concatenate([np.eye(3), -np.eye(3)])


@pytest.mark.parametrize(("vertices", "edges", "triangles"), [(box([1, 2, 3]).vertices, 12, 12), (OCTAHEDRON, 12, 8)])
def test_a_body_has_the_edges_it_is_known_for_and_faces_that_look_outward(vertices: Array, edges: int, triangles: int) -> None:
    wireframe = wireframe_of(vertices)
    assert wireframe.edges.shape == (edges, 2)
    assert wireframe.triangles.shape == (triangles, 3)
    a, b, c = vertices[wireframe.triangles].swapaxes(0, 1)
    assert (np.einsum("fi,fi->f", np.cross(b - a, c - a), a) > 0.0).all()


def test_edges_of_a_body_in_two_places_are_the_edges_moved() -> None:
    wireframe = wireframe_of(OCTAHEDRON)
    shift = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 3.0]])
    turned = np.array([[1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]])
    strips = wireframe.strips_at(OCTAHEDRON, shift, turned)
    assert strips.shape == (24, 2, 3)
    assert strips[12:] == pytest.approx(wireframe.strips(OCTAHEDRON) + shift[1])
