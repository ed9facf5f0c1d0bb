"""Detects tags in images with the AprilTag library (pupil-apriltags); corners have its order and its pixel coordinates."""

from dataclasses import dataclass

import numpy as np

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.simulation.camera.corner_refinement import refined_corners
from contact_curation.simulation.camera.tag_textures import Image, tag_library


@dataclass(frozen=True)
class DetectorConfig:
    """Settings of the AprilTag library's detector.

    Attributes:
        decimate: factor by which the image is reduced for the search for quads.
        blur: standard deviation of a Gaussian blur before the search [px].
        refine_edges: whether edges are moved to the strongest gradient nearby.
        refine_corners: whether lines are fitted to all pixels of the edges afterwards, which the AprilTag library does not do.
        threads: number of threads that search for quads.
    """

    decimate: float = 2.0
    blur: float = 0.0
    refine_edges: bool = True
    refine_corners: bool = True
    threads: int = 1

    def __post_init__(self) -> None:
        for name, least in (("decimate", 1.0), ("blur", 0.0), ("threads", 1)):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) >= least):
                raise InvalidValueError(f"detector.{name}", getattr(self, name), f"a number of at least {least:g}")


@dataclass(frozen=True, eq=False)
class Detection:
    """A tag in an image, with the fields of apriltag_msgs.

    Attributes:
        tag_id: id in the family 36h11.
        hamming: number of corrected bits.
        margin: mean difference of the bits' grey values from the threshold; larger means more reliable.
        centre: (2,) centre [px].
        corners: (4, 2) corners [px] in the library's order.
        homography: (3, 3) homography from the square [-1, 1] x [-1, 1] to pixels.
    """

    tag_id: int
    hamming: int
    margin: float
    centre: Array
    corners: Array
    homography: Array


SMALLEST_IMAGE = 16
"""Smallest shorter side of an image [px]: a tag with its border has 10 x 10 cells."""
SMALLEST_REDUCED = 8
"""The same after `decimate`: the library reads beyond the end of images with at most 3 rows."""


class TagDetector:
    """Detects tags of the family 36h11.

    Raises:
        MissingDependencyError: the library is not installed.
    """

    def __init__(self, config: DetectorConfig | None = None) -> None:
        self._config = config = config or DetectorConfig()
        self._library = tag_library(
            nthreads=config.threads,
            quad_decimate=config.decimate,
            quad_sigma=config.blur,
            refine_edges=int(config.refine_edges),
        ).detector

    def detect(self, image: Image) -> tuple[Detection, ...]:
        """Detects the tags in a grey image (height, width), sorted by id; none if the image is too small for a tag.

        An image that is smaller than the blur's kernel is too small, too: the library writes before its begin.
        """
        kernel = 4.0 * self._config.blur + 2.0
        if min(image.shape) < max(SMALLEST_IMAGE, self._config.decimate * max(SMALLEST_REDUCED, kernel)):
            return ()
        found = [
            Detection(
                int(one.tag_id),
                int(one.hamming),
                float(one.decision_margin),
                np.array(one.center, dtype=float),
                self._corners(image, np.array(one.corners, dtype=float)),
                np.array(one.homography, dtype=float),
            )
            for one in self._library.detect(image)
        ]
        return tuple(sorted(found, key=lambda one: one.tag_id))

    def _corners(self, image: Image, corners: Array) -> Array:
        return refined_corners(image, corners) if self._config.refine_corners else corners
