"""Board and marker from K rests: a board's tilt is fixed in the world, a marker's turn in the body.

With R_k the tracked orientation of a rest, n_k and d_k the outward normal of the described face that it lies on and that face's
distance from the body's origin, p_k its place; u the board's normal, b its height, s the length scale, c any point; w and o the
turn and the place of the true body's frame in the tracked one, Q_k = R_k exp(-w):

    -Q_k n_k = u                                    bodies lie flat on the board (two equations, across)
    s u.(p_k - c) = b + d_k - u.Q_k o               their faces touch it

Both are solved together, each weighted by what it leaves over, by Gauss and Newton's steps and without outliers. Where throws
lie in one plane or under one heading, normals alone do not tell a tilted board from a turned marker; heights over place do, for
only a board's tilt makes them rise. What rests tell of the marker is what the board leaves of its information (Schur's
complement): directions in which that is too little are left as described, and it is said where the board explains them as well.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contact_curation.geometry import quaternions
from contact_curation.geometry.polytopes import Polytope
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.survey.falls import Rest, Survey, Throw

FLATTEST = np.radians(12.0)
"""A rest further from any described face is none of the described body."""

AS_HIGH = 0.25
"""Rests on one kind of face of the board are as high, to this share of the body's reach; bodies that were caught are not."""

FEWEST_FOR_MARKER = 8
"""Rests."""

CERTAIN = 4.0
"""Standard deviations that a marker's turn or place differs from none."""

SMALLEST_TURN, SMALLEST_PLACE = np.radians(0.5), 1e-3
"""Of a marker that is worth correcting [rad, m]."""

FLOORS = np.array([2e-4, 2e-4, 1e-4, 2e-4, 2e-4, 2e-4, 1e-4, 1e-4, 1e-4])
"""Standard deviations of (u, b, w, o) are no smaller, for bodies are not described better [rad, m]."""

BOARD, TURN, PLACE = slice(0, 3), slice(3, 6), slice(6, 9)
"""Among the nine unknowns: (u_x, u_y, b), w, o."""

FINEST_SCALES = np.array([2e-4, 2e-4, 1e-4])
"""Of what is left over of the two parts of a normal and of a height: no body is flatter [rad, m]."""

KEPT = 75
"""Percentile of the rests."""

STEPS = 4
"""Of Gauss and Newton."""

REWEIGHTED, SHALLOWEST = 30, 0.02
"""Rounds that lead to the least absolute residuals; singular values under that share of the largest count as none."""

ROUNDS, OUTLYING = 6, 4.0
"""Rounds of leaving out rests whose residuals are so many times the median."""

OF_DEVIATIONS = 1.4826
"""The standard deviation of normal values over the median of their absolute values."""


class Rests(NamedTuple):
    """K rests that lie on a described face.

    Attributes:
        turns: (K, 3, 3) tracked orientations.
        places: (K, 3) [m].
        normals: (K, 3) outward, of the faces.
        depths: (K,) of the faces under the origin [m].
        throws: (K,) which of all throws they end.
    """

    turns: Array
    places: Array
    normals: Array
    depths: Array
    throws: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.depths)

    def seen_from(self, place: Array) -> "Rests":
        """The same of a frame whose origin is at a place (3,) in the tracked one [m]."""
        return Rests(self.turns, self.places + self.turns @ place, self.normals, self.depths, self.throws)


@dataclass(frozen=True, eq=False)
class RestEstimate:
    """What rests tell of the board and the marker.

    Attributes:
        values, errors: (9,) of u_x, u_y, b, w, o and their standard deviations [rad, m]; zeros of what is left as described.
        free: degrees of freedom of what is left over.
        tilt_or_turn: whether what looks like a tilted board may as well be a turned marker.
        height_or_place: whether what looks like a height of the board may as well be the marker's place.
        left_over: residual of the heights that three rests in four keep to [m].
    """

    values: Array
    errors: Array
    free: int
    tilt_or_turn: bool
    height_or_place: bool
    left_over: float

    @property
    def up(self) -> Array:
        """(3,) the board's unit normal."""
        return _up(self.values)


def faces(polytope: Polytope) -> tuple[Array, Array]:
    """(F, 3) outward unit normals of a polytope's faces, and (F,) their distances from the origin [m]."""
    from scipy.spatial import ConvexHull  # takes a quarter of a second to import

    planes = np.unique(np.round(ConvexHull(polytope.vertices).equations, 9), axis=0)
    return planes[:, :3], -planes[:, 3]


def on_board(survey: Survey, polytope: Polytope) -> Survey:
    """A survey without the rests of bodies that are held, or lie beside the board.

    They are far over or under the height at which most bodies lie on a described face, or at all where none does.

    Args:
        survey: of poses of any unit and axes.
        polytope: of the body [m].
    """
    rests = [throw.rest for throw in survey.throws if throw.rest is not None]
    if survey.gravity is None or not rests:
        return survey
    size = float(np.linalg.norm(polytope.vertices, axis=1).max() * np.linalg.norm(survey.gravity)) / 9.81
    heights = np.array([rest.position @ survey.up for rest in rests])
    _, _, flat = _lain_on(rests, faces(polytope)[0], survey.up)
    ascending = np.sort(heights[flat] if flat.any() else heights)
    as_high = np.searchsorted(ascending, ascending + AS_HIGH * size, side="right") - np.arange(len(ascending))
    board = ascending[as_high.argmax()]

    def kept(rest: Rest | None) -> Rest | None:
        return None if rest is None or abs(rest.position @ survey.up - board) > 2.0 * size else rest

    return replace(survey, throws=tuple(replace(one, rest=kept(one.rest)) for one in survey.throws))


def rests_of(throws: Sequence[Throw], polytope: Polytope) -> Rests:
    """The rests on a described face, seen along z."""
    found = [throw.rest for throw in throws if throw.rest is not None]
    numbers = np.flatnonzero([throw.rest is not None for throw in throws])
    normals, distances = faces(polytope)
    turns, nearest, flat = _lain_on(found, normals, np.array([0.0, 0.0, 1.0]))
    places = np.array([rest.position for rest in found]).reshape(-1, 3)
    return Rests(turns[flat], places[flat], normals[nearest][flat], distances[nearest][flat], numbers[flat])


def _lain_on(rests: Sequence[Rest], normals: Array, up: Array) -> tuple[Array, NDArray[np.int64], NDArray[np.bool_]]:
    """Orientations (K, 3, 3) of rests, the face (K,) that each lies on by normals (F, 3), and whether it does (K,)."""
    turns = quaternions.to_matrix(np.array([rest.orientation_wxyz for rest in rests]).reshape(-1, 4))
    along = -(up @ turns) @ normals.T  # (K, F), down in the body's frame
    nearest = np.argmax(along, axis=1)
    return turns, nearest, along[np.arange(len(rests)), nearest] > np.cos(FLATTEST)


def estimate_rests(rests: Rests, scale: float, centre: Array) -> RestEstimate:
    """Board and marker by rests.

    Args:
        rests: K >= 1.
        scale: s, by the falls.
        centre: (3,) c.
    """
    board = np.eye(9)[:, BOARD]
    if len(rests) < FEWEST_FOR_MARKER:
        return _estimate(rests, scale, centre, board, shared=(True, True))
    whole = _fit(rests, scale, centre, np.eye(9))
    turn, turn_shared = _told(whole, TURN, 0.5 * SMALLEST_TURN)
    place, place_shared = _told(whole, PLACE, 0.5 * SMALLEST_PLACE)
    shared = turn_shared, place_shared
    basis = np.hstack([board, turn, place])
    found = _fit(rests, scale, centre, basis)
    at, width = 3 + turn.shape[1], basis.shape[1]
    kept = [basis[:, :3]]
    kept += [turn] if _certain(found, slice(3, at), SMALLEST_TURN) else []
    kept += [place] if _certain(found, slice(at, width), SMALLEST_PLACE) else []
    return _estimate(rests, scale, centre, np.hstack(kept), shared)


class _Fit(NamedTuple):
    """Values x = basis c of the nine unknowns."""

    values: Array  # (9,)
    parts: Array  # (P,) c
    information: Array  # (P, P)
    near: NDArray[np.bool_]  # (K, 3) equations that are no outliers
    heights: Array  # (K,) residuals [m]


def _estimate(rests: Rests, scale: float, centre: Array, basis: Array, shared: tuple[bool, bool]) -> RestEstimate:
    found = _fit(rests, scale, centre, basis)
    covariance = basis @ np.linalg.pinv(found.information) @ basis.T
    used = np.abs(basis).max(axis=1) > 0.0
    errors = np.where(used, np.hypot(np.sqrt(np.maximum(np.diagonal(covariance), 0.0)), FLOORS), 0.0)
    free = max(int(found.near.sum()) - basis.shape[1], 1)
    return RestEstimate(found.values, errors, free, *shared, float(np.percentile(np.abs(found.heights), KEPT)))


def _fit(rests: Rests, scale: float, centre: Array, basis: Array) -> _Fit:
    """Least squares over c (P,), in which basis (9, P) gives the unknowns."""
    parts = np.zeros(basis.shape[1])
    for _ in range(STEPS):
        rows, seen = _equations(rests, scale, centre, basis @ parts)
        rows = rows @ basis  # (K, 3, P)
        step, near, scales = _solved(rows, seen)
        parts = parts + step
    weighted = (rows * (near / scales)[:, :, np.newaxis]).reshape(-1, basis.shape[1])
    left = seen - rows @ step
    return _Fit(basis @ parts, parts, weighted.T @ weighted, near, left[:, 2])


def _equations(rests: Rests, scale: float, centre: Array, values: Array) -> tuple[Array, Array]:
    """Rows (K, 3, 9) and seen (K, 3) of what is to be added to values (9,)."""
    up, height, turn, place = _up(values), values[2], values[TURN], values[PLACE]
    true = rests.turns @ quaternions.to_matrix(quaternions.exp(-turn))
    away = scale * (rests.places - centre)
    rows = np.zeros((len(rests), 3, 9))
    rows[:, :2, :2] = np.eye(2)
    rows[:, :2, TURN] = (true @ _skew(rests.normals))[:, :2]
    rows[:, 2, :2] = -away[:, :2]
    rows[:, 2, 2] = 1.0
    rows[:, 2, PLACE] = -np.einsum("i,kij->kj", up, true)
    seen = np.empty((len(rests), 3))
    seen[:, :2] = (-np.einsum("kij,kj->ki", true, rests.normals) - up)[:, :2]
    seen[:, 2] = away @ up - rests.depths + _heights(true, up, place) - height
    return rows, seen


def _heights(true: Array, up: Array, place: Array) -> Array:
    """(K,) how high the described origin is over the tracked one."""
    return np.asarray(np.einsum("i,kij,j->k", up, true, place))


def _solved(rows: Array, seen: Array) -> tuple[Array, NDArray[np.bool_], Array]:
    """Solves rows (K, 3, P) c = seen (K, 3), outliers left out.

    It begins with the least absolute residuals of the normals, which outliers move little. A normal may be one and its height
    none, and files that forget where a toss was made have no heights that rise with a tilt.

    Returns:
        c (P,); (K, 3) which equations are no outliers; the scales (3,) of what is left over.
    """
    values = _least_absolute(rows[:, :2], seen[:, :2])
    unseen = ~rows[:, :2].any(axis=(0, 1))  # (P,) by normals
    values[unseen] = _least_absolute(rows[:, 2:, unseen], seen[:, 2:] - rows[:, 2:] @ values)
    scales = np.maximum(OF_DEVIATIONS * np.median(np.abs(seen - rows @ values), axis=0), FINEST_SCALES)
    scales[:2] = scales[:2].max()
    for _ in range(ROUNDS):
        off = _off(seen - rows @ values, scales)
        near = off <= np.maximum(OUTLYING * np.median(off, axis=0), 1e-9)
        values = _least_squares(rows, seen, near / scales)
        squares = np.square(_off(seen - rows @ values, np.ones(3)))
        shares = (squares * near).sum(axis=0) / near.sum(axis=0) / max(1.0 - rows.shape[2] / near.sum(), 0.1)
        scales = np.maximum(np.sqrt(shares), FINEST_SCALES)
    return values, near, scales


def _off(left: Array, scales: Array) -> Array:
    """(K, 3) how far residuals (K, 3) are off, in their scales; of the two of a normal both in the root mean square."""
    off = np.abs(left / scales)
    off[:, :2] = np.sqrt(np.square(off[:, :2]).mean(axis=1, keepdims=True))
    return np.asarray(off)


def _least_absolute(rows: Array, seen: Array) -> Array:
    """C (P,) with the least sum of lengths |rows (K, m, P) c - seen (K, m)|; without directions that hardly change them."""
    weights = np.ones((len(seen), 1))
    for _ in range(REWEIGHTED):
        values = _least_squares(rows, seen, weights, SHALLOWEST)
        off = np.linalg.norm(seen - rows @ values, axis=1, keepdims=True)
        weights = np.maximum(off, FINEST_SCALES.min()) ** -0.5
    return values


def _least_squares(rows: Array, seen: Array, weights: Array, shallowest: float = 1e-9) -> Array:
    """C (P,) of rows (K, m, P) c = seen (K, m), each of which counts by its weight (K, m) or (K, 1)."""
    system = (rows * weights[:, :, np.newaxis]).reshape(-1, rows.shape[2])
    return np.asarray(np.linalg.lstsq(system, (seen * weights).ravel(), rcond=shallowest)[0])


def _told(found: _Fit, part: slice, largest: float) -> tuple[Array, bool]:
    """Columns (9, D): the directions of a part that rests tell to `largest` while the board is free.

    And whether there is another one that they see, but that the board explains as well.
    """
    alone, across = found.information[part, part], found.information[BOARD, part]
    others = np.linalg.pinv(found.information[BOARD, BOARD], rcond=1e-12)
    values, vectors = np.linalg.eigh(alone - across.T @ others @ across)
    told = values > largest**-2
    seen = np.einsum("id,ij,jd->d", vectors, alone, vectors) > largest**-2
    columns = np.zeros((9, 3))
    columns[part] = vectors
    return columns[:, told], bool((seen & ~told).any())


def _certain(found: _Fit, part: slice, smallest: float) -> bool:
    """Whether parts of c are certainly other than nothing, and large enough to be corrected."""
    errors = np.sqrt(np.maximum(np.diagonal(np.linalg.pinv(found.information)), 0.0))
    values = found.parts[part]
    return bool(np.linalg.norm(values) > smallest and (np.abs(values) > CERTAIN * errors[part]).any())


def _up(values: Array) -> Array:
    up = np.array([values[0], values[1], 0.0])
    up[2] = np.sqrt(max(1.0 - up @ up, 0.0))
    return up


def _skew(vectors: Array) -> Array:
    """(K, 3, 3) matrices of the cross products with (K, 3)."""
    x, y, z = vectors.T
    none = np.zeros_like(x)
    return np.stack([np.stack([none, -z, y], 1), np.stack([z, none, -x], 1), np.stack([-y, x, none], 1)], axis=1)
