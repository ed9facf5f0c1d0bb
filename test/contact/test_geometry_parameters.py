"""A theta that is none is refused in one line that says what was found and what a theta has."""

from typing import Any

import numpy as np
import pytest

from contact_curation.contact.geometry_parameters import ContactGeometry
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
