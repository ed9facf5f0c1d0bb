"""A pinhole camera: x to the right, y down, z forward, and (u, v) = (fx x / z + cx, fy y / z + cy) [px].

The middle of the first pixel is (0, 0), as in OpenCV and ROS' CameraInfo.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array


@dataclass(frozen=True)
class Pinhole:
    """Intrinsics.

    Attributes:
        width: width of the image [px].
        height: height of the image [px].
        focal: fx, fy [px].
        middle: cx, cy [px].
        distortion_model: "", or a name of ROS' CameraInfo: plumb_bob, rational_polynomial, equidistant.
        distortion: its coefficients; all zero or empty for none.
    """

    width: int
    height: int
    focal: tuple[float, float]
    middle: tuple[float, float]
    distortion_model: str = ""
    distortion: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not (self.width > 0 and self.height > 0):
            raise InvalidValueError("image", f"{self.width} x {self.height}", "a positive number of pixels")
        if not (np.isfinite(self.focal).all() and min(self.focal) > 0.0):
            raise InvalidValueError("focal lengths", self.focal, "two positive numbers [px]; is the camera calibrated?")
        if not (np.isfinite(self.middle).all() and np.isfinite(self.distortion).all()):
            raise InvalidValueError("intrinsics", (self.middle, self.distortion), "finite numbers")
        if self.distorted and len(self.distortion) not in COEFFICIENTS.get(self.distortion_model, ()):
            found = f"{self.distortion_model!r} with {len(self.distortion)} coefficients"
            raise InvalidValueError("distortion", found, f"one of {', '.join(COEFFICIENTS)} with as many as it has")

    @property
    def distorted(self) -> bool:
        return any(self.distortion)

    @property
    def matrix(self) -> Array:
        """(3, 3) K."""
        (fx, fy), (cx, cy) = self.focal, self.middle
        return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])

    def project(self, points: ArrayLike) -> Array:
        """Pixels (..., 2) of points (..., 3) in the camera's frame, as without distortion."""
        given = np.asarray(points, dtype=float)
        return np.asarray(given[..., :2] / given[..., 2:] * self.focal + self.middle)


COEFFICIENTS = {"plumb_bob": (4, 5), "rational_polynomial": (8, 12, 14), "equidistant": (4,)}
"""How many each model of distortion has."""


def pinhole_of_view(width: int, height: int, vertical_view: float) -> Pinhole:
    """The ideal camera of an image size and a vertical angle of view [rad]."""
    focal = 0.5 * height / np.tan(0.5 * vertical_view)
    return Pinhole(width, height, (float(focal), float(focal)), (0.5 * (width - 1), 0.5 * (height - 1)))
