"""Intrinsics: a hand case, and what no camera has."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.pinhole import Pinhole, pinhole_of_view

CAMERA = Pinhole(640, 480, (500.0, 510.0), (320.0, 240.0))


def test_a_point_is_where_a_ray_through_the_pinhole_meets_the_image() -> None:
    np.testing.assert_allclose(CAMERA.project([[0.2, -0.1, 2.0]]), [[320.0 + 50.0, 240.0 - 25.5]])
    homogeneous = CAMERA.matrix @ [0.2, -0.1, 2.0]
    np.testing.assert_allclose(CAMERA.project([0.2, -0.1, 2.0]), homogeneous[:2] / homogeneous[2])


def test_the_edges_of_the_view_are_half_a_pixel_beyond_the_outer_pixels() -> None:
    camera = pinhole_of_view(640, 480, np.radians(60.0))
    top = camera.project([0.0, -np.tan(np.radians(30.0)), 1.0])
    np.testing.assert_allclose(top, [319.5, -0.5])


@pytest.mark.parametrize(
    "wrong",
    [
        {"width": 0},
        {"focal": (0.0, 500.0)},
        {"focal": (np.nan, 500.0)},
        {"middle": (np.inf, 0.0)},
        {"distortion_model": "unknown", "distortion": (0.1,)},
        {"distortion_model": "plumb_bob", "distortion": (0.1, 0.2, 0.3)},
    ],
    ids=str,
)
def test_intrinsics_that_cannot_be_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(InvalidValueError):
        replace(CAMERA, **wrong)


def test_coefficients_that_are_all_zero_are_no_distortion_of_whatever_kind() -> None:
    assert not replace(CAMERA, distortion_model="unknown", distortion=(0.0,) * 7).distorted
    assert replace(CAMERA, distortion_model="equidistant", distortion=(0.0, 0.1, 0.0, 0.0)).distorted
