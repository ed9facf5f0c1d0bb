"""Where a rigid thing stands in a camera, from the corners of all its tags that are seen at once (perspective n points).

    minimise  sum_k | (pixel_k - project(R p_k + t)) / sigma_k |^2  over R, t

First guesses are OpenCV's: SQPnP over all corners, and for single tags both solutions of IPPE, for a flat square with little
perspective has two that hardly differ (Collins and Bartoli, IJCV 2014). Each is refined over all corners by Gauss-Newton with a
turn from the left, R <- exp(dtheta) R; what they end in are the minima that there are.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contact_curation.errors import InvalidValueError, MissingDependencyError
from contact_curation.geometry import quaternions
from contact_curation.geometry.pinhole import Pinhole
from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.tags import CORNERS, Tag

STEPS = 12
CONVERGED = 1e-8
"""Steps smaller than this [m, rad] end the refinement."""

DAMPING = 1e-9
"""So that corners all in one place are no error of arithmetic; beside real ones it is nothing."""

LONGEST_STEP = 0.5
"""[m, rad]"""

TAGS_TO_START_FROM = 2
"""The largest ones in the image; each gives two first guesses."""

NEAREST = 1e-3
"""A point is in front of the camera when it is further away than this [m]."""


class SeenTag(NamedTuple):
    """A tag in an image.

    Attributes:
        tag: what is known of it.
        pixels: (4, 2) its corners without distortion.
    """

    tag: Tag
    pixels: Array


@dataclass(frozen=True)
class CornerNoise:
    """How far corners are off, standard deviation per axis.

    Attributes:
        deviation: standard deviation of a corner of a tag that is seen well [px].
        oblique: sine of the angle between the line of sight and a tag's plane below which corners get less accurate.
    """

    deviation: float = 0.05
    oblique: float = 0.4

    def __post_init__(self) -> None:
        if not (self.deviation > 0.0 and 0.0 < self.oblique <= 1.0):
            raise InvalidValueError("deviation, oblique", (self.deviation, self.oblique), "a positive one, and one up to 1")

    def deviations(self, views: Array) -> Array:
        """Of tags whose sines (...) are given [px]."""
        return np.asarray(self.deviation / np.clip(views / self.oblique, 0.1, 1.0) ** 2)


@dataclass(frozen=True, eq=False)
class Minima:
    """What C of G first guesses were refined to, the best one first.

    Attributes:
        positions: (C, 3) of the thing in the camera [m].
        orientations_wxyz: (C, 4).
        residuals: (C, 4 T, 2) pixels beside the projection [px].
        deviations: (C, 4 T) what is expected of them [px].
        informations: (C, 6, 6) J^T W J of position and turn, both in the camera's axes.
        guessed_wxyz: (G, 4) orientations of the first guesses themselves.
        guessed_misfits: (G,) of those, without refinement; inf where a tag does not face the camera.
    """

    positions: Array
    orientations_wxyz: Array
    residuals: Array
    deviations: Array
    informations: Array
    guessed_wxyz: Array
    guessed_misfits: Array

    @property
    def misfits(self) -> Array:
        """(C,) root mean square of the residuals in deviations; increasing."""
        return _misfits(self.residuals, self.deviations)


def undistorted(pixels: Array, camera: Pinhole) -> Array:
    """Pixels (..., 2) as the camera would have them without distortion."""
    if not camera.distorted:
        return pixels
    cv2, flat = _opencv(), np.ascontiguousarray(pixels.reshape(-1, 1, 2))
    matrix, distortion = camera.matrix, np.array(camera.distortion)
    until_exact = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 200, 1e-12)  # OpenCV's own five steps miss by a pixel
    if camera.distortion_model == "equidistant":
        found = cv2.fisheye.undistortPoints(flat, matrix, distortion, P=matrix)
    elif hasattr(cv2, "undistortPointsIter"):  # OpenCV 4
        found = cv2.undistortPointsIter(flat, matrix, distortion, None, matrix, until_exact)
    else:
        found = cv2.undistortPoints(flat, matrix, distortion, P=matrix, criteria=until_exact)
    return np.asarray(found, dtype=float).reshape(pixels.shape)


def minima(seen: tuple[SeenTag, ...], camera: Pinhole, noise: CornerNoise) -> Minima | None:
    """The minima that first guesses lead to, each with all tags in front of the camera and facing it; None for none.

    Args:
        seen: at least one tag.
        camera: without its distortion, that is undone already.
        noise: of the corners.
    """
    positions, orientations = _first_guesses(seen, camera)
    pixels = np.concatenate([one.pixels for one in seen])  # (4 T, 2)
    normals = np.array([quaternions.rotate(one.tag.pose.orientation_wxyz, [0.0, 0.0, 1.0]) for one in seen])
    middles = np.array([one.tag.pose.position for one in seen])
    corners = np.concatenate([one.tag.corners for one in seen])
    guessed = orientations
    guessed_misfits: Array | None = None
    for _ in range(STEPS):
        matrices = quaternions.to_matrix(orientations)
        views = _views(positions, matrices, middles, normals)  # (C, T)
        residuals, slopes = _residuals(positions, matrices, corners, pixels, camera)
        deviations = np.repeat(noise.deviations(views), 4, axis=1)  # (C, 4 T)
        if guessed_misfits is None:
            guessed_misfits = np.where((views > 0.0).all(axis=1), _misfits(residuals, deviations), np.inf)
        weighted = (slopes / deviations[..., None, None]).reshape(len(positions), -1, 6)  # (C, 8 T, 6)
        turned_over = weighted.transpose(0, 2, 1)
        informations = turned_over @ weighted + DAMPING * np.eye(6)
        pulls = turned_over @ (residuals / deviations[..., None]).reshape(len(positions), -1, 1)
        steps = np.linalg.solve(informations, pulls)[..., 0]
        steps *= np.minimum(1.0, LONGEST_STEP / np.maximum(np.linalg.norm(steps, axis=1, keepdims=True), LONGEST_STEP))
        if np.abs(steps).max() < CONVERGED:
            break
        positions = positions + steps[:, :3]
        orientations = quaternions.normalized(quaternions.multiply(quaternions.exp(steps[:, 3:]), orientations))
    found = Minima(positions, orientations, residuals, deviations, informations, guessed, np.asarray(guessed_misfits))
    ahead = (_in_camera(positions, matrices, corners)[..., 2] > NEAREST).all(axis=1)
    return _sorted(found, np.flatnonzero(ahead & (views > 0.0).all(axis=1) & np.isfinite(found.misfits)))


def _first_guesses(seen: tuple[SeenTag, ...], camera: Pinhole) -> tuple[Array, Array]:
    """Positions (C, 3) and orientations (C, 4) of the thing in the camera."""
    cv2 = _opencv()
    guesses: list[tuple[Array, Array]] = []
    sizes = [area(one.pixels) for one in seen]
    for place in np.argsort(sizes)[::-1][:TAGS_TO_START_FROM]:
        tag = seen[place].tag
        back = tag.pose.inverse()
        _, turns, places, *_ = cv2.solvePnPGeneric(
            tag.edge * CORNERS, np.ascontiguousarray(seen[place].pixels), camera.matrix, None, flags=cv2.SOLVEPNP_IPPE
        )
        for turn, at in zip(turns, places):
            orientation = quaternions.exp(np.ravel(turn))
            at_thing = np.ravel(at) + quaternions.rotate(orientation, back.position)
            guesses.append((at_thing, quaternions.multiply(orientation, back.orientation_wxyz)))
    if len(seen) > 1:
        corners = np.concatenate([one.tag.corners for one in seen])
        pixels = np.concatenate([one.pixels for one in seen])
        good, turn, at = cv2.solvePnP(corners, pixels, camera.matrix, None, flags=cv2.SOLVEPNP_SQPNP)
        if good:
            guesses.append((np.ravel(at), quaternions.exp(np.ravel(turn))))
    return np.array([at for at, _ in guesses]), np.array([turn for _, turn in guesses])


def _residuals(positions: Array, matrices: Array, corners: Array, pixels: Array, camera: Pinhole) -> tuple[Array, Array]:
    """Residuals (C, N, 2) [px], and the slopes (C, N, 2, 6) of the projections by position and turn."""
    turned = corners @ matrices.transpose(0, 2, 1)  # (C, N, 3)
    x, y, z = np.moveaxis(turned + positions[:, None], -1, 0)
    along = np.array(camera.focal) / z[..., None]  # (C, N, 2)
    across = np.stack([x, y], axis=-1) / z[..., None]
    slopes = np.zeros((*z.shape, 2, 6))
    slopes[..., 0, 0], slopes[..., 1, 1] = along[..., 0], along[..., 1]
    slopes[..., 2] = -along * across
    a, b, c = (turned[..., None, axis] for axis in range(3))
    by_x, by_y, by_z = (slopes[..., axis] for axis in range(3))  # the point moves by dtheta x turned
    slopes[..., 3], slopes[..., 4], slopes[..., 5] = b * by_z - c * by_y, c * by_x - a * by_z, a * by_y - b * by_x
    return pixels - (across * camera.focal + camera.middle), slopes


def _views(positions: Array, matrices: Array, middles: Array, normals: Array) -> Array:
    """Sines (C, T) of the angles between the lines of sight and the tags; negative where a tag is seen from behind."""
    at = _in_camera(positions, matrices, middles)
    outward = normals @ matrices.transpose(0, 2, 1)
    return np.asarray(-(at * outward).sum(axis=-1) / np.sqrt((at**2).sum(axis=-1)))


def _in_camera(positions: Array, matrices: Array, points: Array) -> Array:
    """Points (N, 3) of the thing in the camera, (C, N, 3)."""
    return np.asarray(points @ matrices.transpose(0, 2, 1) + positions[:, None])


def _sorted(found: Minima, kept: NDArray[np.intp]) -> Minima | None:
    """Those kept, the best one first."""
    if not len(kept):
        return None
    order = kept[np.argsort(found.misfits[kept], kind="stable")]
    return Minima(
        found.positions[order],
        found.orientations_wxyz[order],
        found.residuals[order],
        found.deviations[order],
        found.informations[order],
        found.guessed_wxyz,
        found.guessed_misfits,
    )


def _misfits(residuals: Array, deviations: Array) -> Array:
    """(C,) root mean squares."""
    return np.asarray(np.sqrt(np.mean((residuals / deviations[..., None]) ** 2, axis=(1, 2))))


def area(pixels: Array) -> float:
    """Of a convex quadrilateral (4, 2), by its diagonals."""
    (ax, ay), (bx, by) = pixels[2] - pixels[0], pixels[3] - pixels[1]
    return float(0.5 * abs(ax * by - ay * bx))


def _opencv() -> Any:
    """OpenCV, that takes long to import and is needed for tags alone."""
    try:
        import cv2
    except ImportError as error:
        raise MissingDependencyError("OpenCV", "pip install opencv-python-headless") from error
    return cv2
