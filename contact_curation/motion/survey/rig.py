"""How a rig tracked, estimated from bodies that fall and come to rest: board, length scale, and the marker in the body.

With a throw's rest k: R_k its orientation as tracked, n_k the outward normal of the described face that it lies on, d_k the
height of the body's origin over that face, p_k its place; u the board's normal, b its height, s the length scale; w and o the
turn and the place of the true body's frame in the tracked one:

    acceleration in the air = -g u / s                           length scale: bodies fall by g
    -R_k n_k = u + R_k (n_k x w)                                 tilt and turn: bodies lie flat on the board
    s u.(p_k - c) = b + d_k - u.R_k o                            height and place: their faces touch it

Both are linear in what is looked for, for small angles, and solved one after the other by least squares without outliers. A
tilted board is the same for all rests, a marker that is askew turns with the body: rests on several faces under several
headings tell them apart, throws in one plane do not. What the tosses cannot tell
apart is left out: turn and place of the marker count only where they are certain and larger than what is worth correcting.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.polytopes import Polytope
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.calibration import NO_CORRECTION, RigCalibration
from contact_curation.motion.survey.falls import Survey, Throw

FEWEST_THROWS = 4
"""From which anything is estimated."""

FEWEST_FOR_MARKER = 8
"""Rests, on at least `FEWEST_FACES` faces."""

FEWEST_FACES = 3

CONFIDENT = 1.96
"""Standard deviations of a 95 % interval."""

CERTAIN = 4.0
"""Standard deviations that a marker's turn or place differs from none."""

SMALLEST_TURN, SMALLEST_PLACE = np.radians(0.5), 1e-3
"""Of a marker that is worth correcting [rad, m]."""

FLATTEST = np.radians(12.0)
"""A rest further from any described face is none of the described body."""

SMALLEST_ERRORS = {"tilt": 2e-4, "height": 1e-4, "scale": 5e-4}
"""Standard deviations are no smaller, however many tosses there are: bodies are not described better [rad, m, 1]."""

OF_MEDIAN = 1.2533
"""Its standard deviation over that of a mean, of normal values."""

ROUNDS = 6
OUTLYING = 4.0
"""Rounds of leaving out residuals that are so many times the median."""


type Triple = tuple["Estimate", "Estimate", "Estimate"]


class Estimate(NamedTuple):
    """A number with its 95 % interval."""

    value: float
    low: float
    high: float

    @property
    def holds_none(self) -> bool:
        """Whether the interval holds 0."""
        return self.low <= 0.0 <= self.high


@dataclass(frozen=True, eq=False)
class RigEstimate:
    """What throws say of their rig.

    Attributes:
        throws, rests, falls: how many there are, come to rest on a face, and are long enough in the air.
        rig: what corrects poses, all of it.
        tilt: of the board about x and y [rad].
        height: of the board's surface [m].
        scale: relative length error, s - 1.
        marker_turn: w [rad]; zeros where it is not estimated.
        marker_place: o [m]; likewise.
        off_flat: (K,) angle of each rest to its face before any correction [rad].
        heights: (K,) of the faces at rest before any correction [m].
        rest_depths: (K,) of the described origin over the faces that they lie on [m].
        left_over: median residual of the heights after it [m].
    """

    throws: int
    rests: int
    falls: int
    rig: RigCalibration
    tilt: tuple[Estimate, Estimate]
    height: Estimate
    scale: Estimate
    marker_turn: Triple
    marker_place: Triple
    off_flat: Array
    heights: Array
    rest_depths: Array
    left_over: float

    @property
    def tilt_degrees(self) -> float:
        return float(np.degrees(self.rig.tilt))

    @property
    def tilt_interval(self) -> Estimate:
        """Of the whole angle [degrees]."""
        half = float(np.degrees(max(0.5 * (one.high - one.low) for one in self.tilt)))
        low = 0.0 if all(one.holds_none for one in self.tilt) else max(self.tilt_degrees - half, 0.0)
        return Estimate(self.tilt_degrees, low, self.tilt_degrees + half)

    @property
    def length_scale(self) -> Estimate:
        """What lengths are multiplied with."""
        return Estimate(*(1.0 + value for value in self.scale))

    @property
    def needs_none(self) -> bool:
        """Whether the intervals of tilt, height and scale hold 0 and the marker sits where it is described."""
        return all(one.holds_none for one in (*self.tilt, self.height, self.scale)) and not (self.rig.has_marker)


class _Rests(NamedTuple):
    """K rests that lie on a described face."""

    turns: Array  # (K, 3, 3) tracked orientations
    places: Array  # (K, 3)
    normals: Array  # (K, 3) outward, of the faces
    depths: Array  # (K,) of the faces under the origin [m]
    off: Array  # (K,) angle to the face [rad]


def faces(polytope: Polytope) -> tuple[Array, Array]:
    """(F, 3) outward unit normals of a polytope's faces, and (F,) their distances from the origin [m]."""
    from scipy.spatial import ConvexHull  # takes a quarter of a second to import

    planes = np.unique(np.round(ConvexHull(polytope.vertices).equations, 9), axis=0)
    return planes[:, :3], -planes[:, 3]


def estimate_rig(survey: Survey, polytope: Polytope, gravity: float = 9.81, *, fewest: int = FEWEST_THROWS) -> RigEstimate:
    """The rig of some throws.

    Args:
        survey: of poses of one body by one rig [m], z up.
        polytope: the body's.
        gravity: the true one [m/s^2].
        fewest: throws.

    Raises:
        InvalidValueError: fewer than `fewest` throws fall, or come to rest on a face of the body.
    """
    throws = survey.throws
    rests = _rests(throws, polytope)
    for what, count in (("fall freely", len(throws)), ("come to rest on a face", len(rests.off))):
        if count < fewest:
            raise InvalidValueError(f"throws that {what}", count, f"at least {fewest}, to estimate the rig from")
    scale = _scale(throws, gravity)
    told = 1.0 + scale.value
    centre = np.array([*np.median(rests.places[:, :2], axis=0), 0.0])
    several = _several_faces(rests)
    tilt, turn = _turns(rests, several)
    up = np.array([tilt[0].value, tilt[1].value, 1.0])
    up /= np.linalg.norm(up)
    true = rests.turns @ quaternions.to_matrix(quaternions.exp([-one.value for one in turn]))
    gaps = told * (rests.places - centre) @ up - _support(true, polytope, up)
    height, place, left = _height(gaps, true, up, several)
    rig = RigCalibration(
        normal=_triple(up),
        centre=_triple(centre),
        scale=told,
        height=height.value,
        marker_turn=_triple([one.value for one in turn]),
        marker_offset=_triple([one.value for one in place]),
    )
    return RigEstimate(
        throws=len(throws),
        rests=len(rests.off),
        falls=len(throws),
        rig=rig,
        tilt=tilt,
        height=height,
        scale=scale,
        marker_turn=turn,
        marker_place=place,
        off_flat=rests.off,
        heights=rests.places[:, 2] - _support(rests.turns, polytope, np.array([0.0, 0.0, 1.0])),
        rest_depths=rests.depths,
        left_over=left,
    )


def worth_correcting(found: RigEstimate) -> RigCalibration:
    """The calibration without those parts whose intervals hold 0."""
    rig = found.rig
    if all(one.holds_none for one in found.tilt):
        rig = replace(rig, normal=NO_CORRECTION.normal)
    if found.height.holds_none:
        rig = replace(rig, height=0.0)
    if found.scale.holds_none:
        rig = replace(rig, scale=1.0)
    unused = rig.normal == NO_CORRECTION.normal and rig.scale == 1.0
    return replace(rig, centre=NO_CORRECTION.centre) if unused else rig


def _rests(throws: Sequence[Throw], polytope: Polytope) -> _Rests:
    """Those on a face, seen along z."""
    found = [throw.rest for throw in throws if throw.rest is not None]
    turns = quaternions.to_matrix(np.array([rest.orientation_wxyz for rest in found]).reshape(-1, 4))
    normals, distances = faces(polytope)
    down = -turns[:, 2, :]  # (K, 3) in the body's frame
    nearest = np.argmax(down @ normals.T, axis=1)
    off = np.arccos(np.clip(np.einsum("ki,ki->k", down, normals[nearest]), -1.0, 1.0))
    flat = off < FLATTEST
    places = np.array([rest.position for rest in found]).reshape(-1, 3)
    return _Rests(turns[flat], places[flat], normals[nearest][flat], distances[nearest][flat], off[flat])


def _several_faces(rests: _Rests) -> bool:
    return len(rests.off) >= FEWEST_FOR_MARKER and len(np.unique(np.round(rests.normals, 6), axis=0)) >= FEWEST_FACES


def _support(turns: Array, polytope: Polytope, up: Array) -> Array:
    """(K,) height of the origin over the lowest corner."""
    return np.asarray(-np.min(np.einsum("i,kij,vj->kv", up, turns, polytope.vertices), axis=1))


def _scale(throws: Sequence[Throw], gravity: float) -> Estimate:
    """S - 1; the spread of the throws' accelerations along their mean gives the interval."""
    accelerations = np.array([throw.acceleration for throw in throws])
    weights = np.array([throw.frames**5.0 for throw in throws])
    off = np.linalg.norm(accelerations - np.median(accelerations, axis=0), axis=1)
    near = off <= max(OUTLYING * float(np.median(off)), 1e-9)
    mean = weights[near] @ accelerations[near] / weights[near].sum()
    length = float(np.linalg.norm(mean))
    along = accelerations[near] @ (mean / length) - length
    error = float(np.sqrt(np.sum((weights[near] * along) ** 2)) / weights[near].sum())
    value = gravity / length
    return _estimate(value - 1.0, float(np.hypot(value * error / length, SMALLEST_ERRORS["scale"])))


def _turns(rests: _Rests, several: bool) -> tuple[tuple[Estimate, Estimate], Triple]:
    """Of the board (tx, ty), and of the marker (w): -R n = u + R (n x w), without z."""
    seen = -np.einsum("kij,kj->ki", rests.turns, rests.normals)[:, :2]
    rows = np.concatenate([np.tile(np.eye(2), (len(seen), 1, 1)), (rests.turns @ _skew(rests.normals))[:, :2]], axis=2)
    found = _with_marker(rows, seen, 2, several, SMALLEST_TURN, SMALLEST_ERRORS["tilt"])
    return (found[0], found[1]), (found[2], found[3], found[4])


def _height(gaps: Array, turns: Array, up: Array, several: bool) -> tuple[Estimate, Triple, float]:
    """Of the board (b), the marker's place (o), and what is left in the median: gaps (K,) = b - u.R o."""
    beside = -np.einsum("kij,i->kj", turns, up)
    rows = np.concatenate([np.ones((len(gaps), 1)), beside], axis=1)[:, np.newaxis]  # (K, 1, 4)
    found = _with_marker(rows, gaps[:, np.newaxis], 1, several, SMALLEST_PLACE, SMALLEST_ERRORS["height"])
    values = np.array([one.value for one in found])
    return found[0], (found[1], found[2], found[3]), float(np.median(np.abs(gaps - rows[:, 0] @ values)))


def _with_marker(rows: Array, seen: Array, board: int, several: bool, smallest: float, floor: float) -> tuple[Estimate, ...]:
    """Solves rows (K, m, P) x = seen (K, m), whose first `board` unknowns are the board's and the others the marker's.

    The marker's are zeros where rests on few faces do not tell them, or they are too small to be worth it.
    """
    values, errors = _solved(rows, seen) if several else (np.zeros(rows.shape[2]), np.zeros(rows.shape[2]))
    if not several or not _certain(values[board:], errors[board:], smallest):
        values, errors = np.zeros(rows.shape[2]), np.zeros(rows.shape[2])
        values[:board] = np.median(seen, axis=0)  # the rows of the board are those of the identity
        spread = 1.4826 * np.median(np.abs(seen - values[:board]), axis=0)
        errors[:board] = OF_MEDIAN * spread / np.sqrt(len(seen))
    errors[:board] = np.hypot(errors[:board], floor)
    return tuple(_estimate(*each) for each in zip(values, errors, strict=True))


def _certain(values: Array, errors: Array, smallest: float) -> bool:
    return bool(np.linalg.norm(values) > smallest and (np.abs(values) > CERTAIN * errors).any())


def _solved(rows: Array, seen: Array) -> tuple[Array, Array]:
    """Least squares of K blocks rows (K, m, P) x = seen (K, m), outliers left out; x (P,) and its standard deviations (P,)."""
    near: NDArray[np.bool_] = np.ones(len(seen), dtype=bool)
    middle = np.median(seen, axis=0)
    for _ in range(ROUNDS):
        system, target = rows[near].reshape(-1, rows.shape[2]), seen[near].ravel()
        values = np.linalg.lstsq(system, target, rcond=1e-6)[0] if near.any() else np.full(rows.shape[2], middle[0])
        off = np.linalg.norm(seen - rows @ values, axis=1)
        near = off <= max(OUTLYING * float(np.median(off)), 1e-9)
    left = (seen - rows @ values)[near]
    system = rows[near].reshape(-1, rows.shape[2])
    free = max(left.size - rows.shape[2], 1)
    spread = float(np.square(left).sum()) / free
    return values, np.sqrt(np.maximum(np.diagonal(spread * np.linalg.pinv(system.T @ system)), 0.0))


def _skew(vectors: Array) -> Array:
    """(K, 3, 3) matrices of the cross products with (K, 3)."""
    x, y, z = vectors.T
    none = np.zeros_like(x)
    return np.stack([np.stack([none, -z, y], 1), np.stack([z, none, -x], 1), np.stack([-y, x, none], 1)], axis=1)


def _estimate(value: float, error: float) -> Estimate:
    return Estimate(float(value), float(value - CONFIDENT * error), float(value + CONFIDENT * error))


def _triple(values: Sequence[float] | Array) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z
