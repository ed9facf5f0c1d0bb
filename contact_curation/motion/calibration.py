"""Calibration of the rig that tracked tosses, estimated from the tosses themselves: tilt of the board, and length scale.

Nothing but the tosses is needed. A body comes to rest flat on the board, so that the mean of the faces that it lies on is the
board's plane; and it falls by 9.81 m/s^2, so that a tracker that sees it fall by less measures lengths too short (or time too
slow, which free fall alone does not distinguish). Both belong to the rig, are the same for all tosses, and are corrected
together: the frame is turned until the mean rest is level, and lengths are multiplied by the scale.

A board that is tilted in the tracker's frame looks to a learner like tilted ground under untilted gravity; a length scale that
is too short looks like a small body. ContactNets' public tosses have both errors (docs/explanation/data.md).
"""

from collections.abc import Iterable
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.polytopes import Polytope
from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.scalars import Quaternion, ScalarPose, Vector, conjugate, rotate, third_row, vector
from contact_curation.motion.gates import footing, rest_normal
from contact_curation.motion.scales import size_of
from contact_curation.motion.toss import NANOSECONDS, Toss

FEWEST_TOSSES = 8
"""That a calibration is estimated from, at least."""

FEWEST_FRAMES = 12
"""In the air, for an acceleration."""

CLEARANCE = 0.012 / 0.0524
"""A body whose vertices are higher than this share of its size is in the air."""

RESTING_SPEED, RESTING_SPIN = 0.05, 0.5
"""A body at rest is as slow as that [m/s, rad/s], whatever tracked it."""

STEEPEST = float(np.sqrt(0.5))
"""Cosine of the largest tilt."""

ROUNDING = 1e-12
"""What is as near to length 1 has it."""


@dataclass(frozen=True)
class RigCalibration:
    """How poses of a rig are corrected; by default they are not.

    Attributes:
        normal: upward normal of the board's plane in the frame of the poses; of any length.
        centre: point about which poses are rotated, in the middle of where bodies come to rest [m]; its x and y stay, its
            height is scaled.
        scale: factor that lengths are multiplied with.
        height: height of the board's surface in poses that were rotated and scaled; it is subtracted [m].
        marker_turn: rotation vector of the tracked frame against the described body's, in that body's frame [rad].
        marker_offset: place of the described body's origin seen from the tracked one, in the described body's frame [m].
    """

    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    scale: float = 1.0
    height: float = 0.0
    marker_turn: tuple[float, float, float] = (0.0, 0.0, 0.0)
    marker_offset: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        length = float(np.linalg.norm(self.normal))
        if not (np.shape(self.normal) == (3,) and np.isfinite(length) and self.normal[2] > STEEPEST * length):
            raise InvalidValueError("normal", self.normal, "three numbers that point up by more than across")
        for name in ("centre", "marker_turn", "marker_offset"):
            value = getattr(self, name)
            if not (np.shape(value) == (3,) and np.isfinite(value).all()):
                raise InvalidValueError(name, value, "three numbers")
        if not np.isfinite(self.height):
            raise InvalidValueError("height", self.height, "a number of metres")
        if not 0.5 <= self.scale <= 2.0:
            raise InvalidValueError("scale", self.scale, "a number from 0.5 to 2")

    @property
    def up(self) -> Array:
        """(3,) the normal with length 1."""
        normal = np.array(self.normal)
        length = float(np.linalg.norm(normal))
        return normal if abs(length - 1.0) < ROUNDING else normal / length

    @property
    def has_marker(self) -> bool:
        """Whether the tracked frame is not the described body's."""
        return any(self.marker_turn) or any(self.marker_offset)

    @property
    def marker(self) -> ScalarPose:
        """The described body's frame in the tracked one, in the length of the poses."""
        turn = quaternions.exp(-np.array(self.marker_turn))
        place = quaternions.rotate(turn, self.marker_offset) / self.scale
        w, x, y, z = turn.tolist()
        return ScalarPose(vector(place), (w, x, y, z))

    @property
    def without_marker(self) -> "RigCalibration":
        """Of the board and the length scale alone."""
        return replace(self, marker_turn=(0.0, 0.0, 0.0), marker_offset=(0.0, 0.0, 0.0))

    @property
    def tilt(self) -> float:
        """Angle of the board against the frame of the poses [rad]."""
        return float(np.arccos(min(self.up[2], 1.0)))


NO_CORRECTION = RigCalibration()
"""Of a level rig with a true length scale."""


@dataclass(frozen=True, eq=False)
class RigMeasurements:
    """Measurements of a rig from K tosses.

    Attributes:
        normals: (K, 3) up, of the faces that they came to lie on; NaN where they did not.
        heights: (K,) of these faces, in the mean of three corners [m]; NaN likewise.
        accelerations: (K, 3) in the air [m/s^2]; NaN where they were too short there.
        weights: (K,) of these, zero where there is none.
        ends: (K, 3) last positions [m].
    """

    normals: Array
    heights: Array
    accelerations: Array
    weights: Array
    ends: Array

    @property
    def rests(self) -> NDArray[np.bool_]:
        """(K,) which tosses have a normal."""
        return np.isfinite(self.heights)

    @property
    def falls(self) -> NDArray[np.bool_]:
        """(K,) which tosses have an acceleration for the scale."""
        return self.weights > 0.0

    def calibration(self, gravity: float = 9.81) -> RigCalibration:
        """The calibration that is estimated from them; the rest as of `calibration_of`."""
        rests, falls = self.rests, self.falls
        for what, found in (("come to rest", rests), (f"are {FEWEST_FRAMES} frames in the air", falls)):
            if (count := int(found.sum())) < FEWEST_TOSSES:
                raise InvalidValueError(
                    f"tosses that {what}", count, f"at least {FEWEST_TOSSES}, to estimate the calibration from"
                )
        normal = np.median(self.normals[rests], axis=0)
        seen = np.linalg.norm(self.weights[falls] @ self.accelerations[falls]) / self.weights[falls].sum()
        centre = np.array([*self.ends[:, :2].mean(axis=0), 0.0])
        return RigCalibration(vector(normal / np.linalg.norm(normal)), vector(centre), gravity / float(seen))

    def resampled(self, places: NDArray[np.int64]) -> "RigMeasurements":
        """The measurements of resampled tosses."""
        return RigMeasurements(*(getattr(self, field.name)[places] for field in fields(self)))


def measurements_of(tosses: Iterable[Toss], polytope: Polytope) -> RigMeasurements:
    """The measurements of tosses, one after the other; none of them stays in memory."""
    normals, heights, accelerations, weights, ends = [], [], [], [], []
    for toss in tosses:
        corners, fall = footing(toss, polytope, RESTING_SPEED, RESTING_SPIN), _fall(toss, polytope)
        normals.append(np.full(3, np.nan) if corners is None else rest_normal(corners))
        heights.append(np.nan if corners is None else float(corners[:, 2].mean()))
        accelerations.append(np.full(3, np.nan) if fall is None else fall[0])
        weights.append(0.0 if fall is None else fall[1])
        ends.append(toss.positions[-1])
    columns = (np.array(each, dtype=float) for each in (normals, heights, accelerations, weights, ends))
    shapes = ((-1, 3), (-1,), (-1, 3), (-1,), (-1, 3))
    return RigMeasurements(*(column.reshape(shape) for column, shape in zip(columns, shapes, strict=True)))


def calibration_of(tosses: Iterable[Toss], polytope: Polytope) -> RigCalibration:
    """The calibration of the rig that tosses were tracked with.

    Args:
        tosses: of one body, all tracked by the same rig.
        polytope: of the body.

    Raises:
        InvalidValueError: fewer than `FEWEST_TOSSES` of them come to rest, or are long enough in the air.
    """
    return measurements_of(tosses, polytope).calibration()


def apply_calibration(toss: Toss, rig: RigCalibration) -> Toss:
    """The toss as a level rig with a true length scale would have tracked it; unchanged where there is nothing to correct."""
    if rig == NO_CORRECTION:
        return toss
    positions, orientations = calibrated_poses(toss.positions, toss.orientations_wxyz, rig)
    velocities = calibrated_vectors(toss.linear_velocities, rig)
    spins = toss.angular_velocities  # in the body's frame, which no board turns
    if rig.has_marker:
        spins = quaternions.rotate(quaternions.exp(rig.marker_turn), spins)
        velocities = velocities + quaternions.rotate(orientations, np.cross(spins, np.array(rig.marker_offset)))
    return replace(
        toss, positions=positions, orientations_wxyz=orientations, linear_velocities=velocities, angular_velocities=spins
    )


def calibrated_poses(positions: Array, orientations_wxyz: Array, rig: RigCalibration) -> tuple[Array, Array]:
    """Positions (T, 3) and orientations (T, 4) as a level rig with a true length scale and an exact marker would give them."""
    turn, centre = _levelling(rig), np.array(rig.centre)
    levelled = centre * [1.0, 1.0, rig.scale] + rig.scale * quaternions.rotate(turn, positions - centre)
    levelled = levelled - np.array([0.0, 0.0, rig.height])
    orientations = quaternions.multiply(turn, orientations_wxyz)
    if rig.has_marker:
        orientations = quaternions.multiply(orientations, quaternions.conjugate(quaternions.exp(rig.marker_turn)))
        levelled = levelled + quaternions.rotate(orientations, rig.marker_offset)
    return levelled, orientations


class CornerHeights:
    """Heights of a body's corners over the board, one pose at a time: those that `calibrated_poses` give them."""

    def __init__(self, vertices: Array, rig: RigCalibration) -> None:
        if rig.has_marker:
            vertices = quaternions.rotate(quaternions.exp(-np.array(rig.marker_turn)), vertices + np.array(rig.marker_offset))
        self._corners = [vector(corner) for corner in vertices]  # in the tracked frame
        self._up, self._scale = vector(rig.up), rig.scale
        self._board = rig.height + rig.scale * (float(rig.up @ rig.centre) - rig.centre[2])
        self._level = not (rig.normal[0] or rig.normal[1])

    def __call__(self, position: Vector, orientation_wxyz: Quaternion) -> list[float]:
        """(V,) [m]."""
        if self._level:
            (a, b, c), z = third_row(orientation_wxyz), self._scale * position[2] - self._board
        else:
            (x, y, z), (p, q, r) = position, self._up
            (a, b, c), z = rotate(conjugate(orientation_wxyz), self._up), self._scale * (p * x + q * y + r * z) - self._board
        return [a * u + b * v + c * w + z for u, v, w in self._corners]


def calibrated_vectors(vectors: Array, rig: RigCalibration) -> Array:
    """Velocities or accelerations (T, 3) of the tracked origin, turned and scaled."""
    return vectors if rig == NO_CORRECTION else rig.scale * quaternions.rotate(_levelling(rig), vectors)


def _levelling(rig: RigCalibration) -> Array:
    """(4,) the turn that brings the board's normal upright."""
    axis = np.cross(rig.up, [0.0, 0.0, 1.0])
    length = float(np.linalg.norm(axis))
    return quaternions.exp(axis * (rig.tilt / length if length else 0.0))


def _fall(toss: Toss, polytope: Polytope) -> tuple[Array, float] | None:
    """(3,) acceleration before the first contact [m/s^2], and its weight: the inverse of its variance goes as n^5."""
    low = polytope.corner_heights(toss.positions, toss.orientations_wxyz).min(axis=1) < CLEARANCE * size_of(polytope.vertices)
    frames = int(np.argmax(low)) if low.any() else toss.frames
    if frames < FEWEST_FRAMES:
        return None
    times = (toss.stamps_ns[:frames] - toss.stamps_ns[0]) / NANOSECONDS
    terms = np.stack([np.ones(frames), times, 0.5 * times**2], axis=1)
    return np.linalg.lstsq(terms, toss.positions[:frames], rcond=None)[0][2], float(frames) ** 5
