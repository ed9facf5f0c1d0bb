"""Images of tags are those of the family, as its own library and OpenCV read them; the one place for conventions is right."""

import sys
from typing import Any

import numpy as np
import pytest

from contact_curation.errors import MissingDependencyError
from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.tags import CornerOrder, in_our_order
from contact_curation.simulation.camera.tag_detection import DetectorConfig, TagDetector
from contact_curation.simulation.camera.tag_textures import Image, tag_image

CELL = 12
MARGIN = 30
FIRST, LAST = MARGIN + CELL - 0.5, MARGIN + 9 * CELL - 0.5
"""Pixels of the black square's edges, the middle of the first pixel of the image at 0."""

UPRIGHT = np.array([[FIRST, LAST], [LAST, LAST], [LAST, FIRST], [FIRST, FIRST]])
"""Lower left, lower right, upper right, upper left, with y down."""


def picture(tag_id: int) -> Image:
    large = np.kron(tag_image(tag_id), np.ones((CELL, CELL), dtype=np.uint8))
    return np.pad(large, MARGIN, constant_values=np.uint8(128))


def opencv_corners(image: Image, refinement: str = "CORNER_REFINE_NONE") -> tuple[int, Array]:
    import cv2

    aruco: Any = cv2.aruco
    parameters = aruco.DetectorParameters()
    parameters.cornerRefinementMethod = getattr(aruco, refinement)
    detector = aruco.ArucoDetector(aruco.getPredefinedDictionary(aruco.DICT_APRILTAG_36h11), parameters)
    (corners,), ids, _ = detector.detectMarkers(image)
    return int(np.ravel(ids)[0]), np.asarray(corners, dtype=float).reshape(4, 2)


@pytest.mark.parametrize("tag_id", [0, 5, 100, 586])
def test_the_library_reads_the_tag_upright_without_a_corrected_bit(tag_id: int) -> None:
    (found,) = TagDetector().detect(picture(tag_id))
    assert (found.tag_id, found.hamming) == (tag_id, 0)
    np.testing.assert_allclose(in_our_order(found.corners, CornerOrder.APRILTAG), UPRIGHT, atol=0.1)
    np.testing.assert_allclose(found.centre - 0.5, UPRIGHT.mean(axis=0), atol=0.2)


def test_opencv_reads_the_same_tag_and_its_corners_become_ours() -> None:
    """Which of the two orders an OpenCV has is told by this test: it is to be changed when another one comes."""
    tag_id, corners = opencv_corners(picture(7))
    assert tag_id == 7
    np.testing.assert_allclose(in_our_order(corners, CornerOrder.OPENCV_TURNED), UPRIGHT, atol=1.1)


@pytest.mark.parametrize(
    ("refinement", "first_pixel"),
    [("CORNER_REFINE_SUBPIX", 0.0), ("CORNER_REFINE_CONTOUR", 0.0), ("CORNER_REFINE_APRILTAG", 0.5)],
)
def test_opencv_has_its_own_first_pixel_unless_it_refines_as_the_apriltag_library(refinement: str, first_pixel: float) -> None:
    _, corners = opencv_corners(picture(7), refinement)
    found = in_our_order(corners, CornerOrder.OPENCV_TURNED) - UPRIGHT
    np.testing.assert_allclose(found.mean(axis=0), first_pixel, atol=0.1)


def test_an_image_without_tags_has_none() -> None:
    assert TagDetector().detect(np.full((200, 200), 128, dtype=np.uint8)) == ()


@pytest.mark.parametrize(("decimate", "blur"), [(1e9, 0.0), (16.0, 0.0), (2.0, 50.0), (2.0, 1e3)])
def test_images_that_are_too_small_for_the_settings_have_no_tags(decimate: float, blur: float) -> None:
    """The library reads or writes outside of them."""
    detector = TagDetector(DetectorConfig(decimate=decimate, blur=blur))
    random = np.random.default_rng(0)
    assert all(detector.detect(random.integers(0, 256, (20, 20), dtype=np.uint8)) == () for _ in range(20))


def test_detectors_that_are_made_and_let_go_again_and_again_do_no_harm() -> None:
    image = picture(3)
    for _ in range(12):
        assert [one.tag_id for one in TagDetector().detect(image)] == [3]


def test_without_the_library_the_package_to_install_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pupil_apriltags", None)
    with pytest.raises(MissingDependencyError, match="pip install pupil-apriltags"):
        TagDetector()
