"""Distances of shapes that do not depend on the order of the vertices."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form
from contact_curation.geometry.polytopes import box
from contact_curation.learning.evaluation.shape_errors import hull_distance, matched_distances, shape_errors

CUBE = ContactGeometry.of_body(CONTACTNETS_CUBE)
CORNERS = box([1.0, 1.0, 1.0]).vertices


def test_vertices_that_changed_places_are_no_error() -> None:
    turned = CUBE.vertices_normal[np.random.default_rng(0).permutation(8)]
    found = shape_errors(PolytopeModel(replace(CUBE, vertices_normal=turned), CONTACTNETS_CUBE, Form.PHYSICAL))
    assert found is not None
    assert found.vertex_rms == 0.0
    assert found.hull_mm == pytest.approx(0.0, abs=1e-6)


def test_a_lost_vertex_counts_by_what_the_hull_lacks() -> None:
    inside = CUBE.vertices_normal.copy()
    inside[0] *= 0.5
    found = shape_errors(PolytopeModel(replace(CUBE, vertices_normal=inside), CONTACTNETS_CUBE, Form.PHYSICAL))
    assert found is not None
    assert found.vertex_rms_mm == pytest.approx(52.4 * 0.5 * np.sqrt(3.0 / 8.0))
    # The corner at distance sqrt(3) over the plane through its three neighbours, whose distance is 1 / sqrt(3), or that of
    # the vertex half way, which lies outside it.
    assert found.hull_mm < 52.4 * 0.5 * np.sqrt(3.0) + 1e-6
    assert found.hull_mm > 30.0


def test_hulls_are_as_far_apart_as_their_farthest_points() -> None:
    assert hull_distance(CORNERS, CORNERS + np.array([0.3, 0.0, 0.0])) == pytest.approx(0.3, rel=1e-4)
    assert hull_distance(CORNERS, 1.2 * CORNERS) == pytest.approx(0.2 * np.sqrt(3.0), rel=1e-4)
    more = np.vstack([CORNERS, 0.9 * CORNERS])
    assert hull_distance(CORNERS, more) == pytest.approx(0.0, abs=1e-6)
    assert hull_distance(more, CORNERS) == hull_distance(CORNERS, more)


def test_fewer_vertices_are_matched_with_the_nearest() -> None:
    np.testing.assert_allclose(matched_distances(CORNERS[[5, 2]] + np.array([0.0, 0.0, 0.1]), CORNERS), 0.1)
