"""Whether bodies that lie still move on the board as what they are measured from moves, such as a camera on an arm.

With T(t) the pose of the carrier in the board's frame, R(t) its rotation, and m(t) the body's place in it, a body that lies at
T m seems to move by

    s dT/dt m + R (d + w x m)

where transforms show the carrier by s later than poses with the same stamps do, and where it is displaced by d and turned by w
against what they say. All seven unknowns are solved together by least squares over rests, each about its mean, so that the one
is not taken for the other. Errors are the jackknife's, which leaves out one rest after the other.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.survey.series import PoseSeries

HALF, EDGE, LEAST = 0.04, 0.06, 0.3
"""[s] Speeds are taken over twice the first; ends of a rest are left out by the second; so long is the shortest rest."""

LEAST_FRAMES = 3
"""A rest has more, for third differences."""

SLOW, SLOW_TURN, SHARE = 0.1, 1.0, 0.25
"""[m/s, rad/s] Bodies that lie still seem to move more slowly, or, where transforms are far off, by less than this share of how
fast the carrier moves there."""

SEEN_TO_MOVE = 3.0
"""Times what it moves on the board, a body moves in the carrier, if it lies on the board and is not carried along."""

FEWEST, CERTAIN = 5, 6.0
"""Rests, and standard deviations, from which on a body's motion is certainly the carrier's."""

TIME, PLACE = slice(0, 1), slice(1, 7)
"""Among the unknowns: s, (d, w)."""

BESIDE = 0.25
"""Of what s moves bodies by: if d and w move them by less, they may stand for the curves of ways that s times a speed cuts."""

STRIDE, WHITE = 0.02, -0.55
"""[s] Over which what scatters is told from what moves, even if it is interpolated; and the correlation of successive third
differences, -0.75 of white noise: of more than this a filter may hide some."""


@dataclass(frozen=True, eq=False)
class Carried:
    """T poses of one body, measured in a frame that moves over the board.

    Attributes:
        frame: its name.
        body: on the board.
        carrier: of the frame on the board, at the same times.
    """

    frame: str
    body: PoseSeries
    carrier: PoseSeries


@dataclass(frozen=True)
class Wander:
    """How bodies that lie still seem to move.

    Attributes:
        frame: that they were measured in.
        rests: so many were looked at.
        lead: s; 0 where it is none for certain [s].
        by_lead: how far it moves bodies, root mean square [m].
        by_place: likewise the carrier's displacement and turn; 0 where these are none for certain.
    """

    frame: str
    rests: int
    lead: float
    by_lead: float
    by_place: float


@dataclass(frozen=True)
class Scatter:
    """By what poses of bodies that hardly move scatter, root mean square over the three axes together.

    Attributes:
        frame: that they were measured in.
        on_board: [m].
        in_carrier: as they were measured [m].
    """

    frame: str
    on_board: float
    in_carrier: float


class _Still(NamedTuple):
    """N frames in which a body hardly moves on the board."""

    period: float
    places: Array  # (N, 3) on the board
    seen: Array  # (N, 3) m
    rows: Array  # (N, 3, 7) of the unknowns


class _Rest(NamedTuple):
    """Means over its frames of the normal equations' terms."""

    information: Array  # (7, 7)
    seen: Array  # (7,)


def of_each_frame(carried: Iterable[Carried]) -> tuple[tuple[Carried, ...], ...]:
    """Those of one frame together: cameras that different arms move are late, and mounted wrongly, each for itself."""
    found: dict[str, tuple[Carried, ...]] = {}
    for one in carried:
        found[one.frame] = (*found.get(one.frame, ()), one)
    return tuple(found.values())


def wander(carried: Sequence[Carried]) -> Wander | None:
    """How bodies, measured in one frame, move on the board while they lie still; None of too few rests in which that moves."""
    rests = [rest for one in carried for rest in _rests(one, 0.0)]
    if len(rests) < FEWEST:
        rests = [rest for one in carried for rest in _rests(one, SHARE)]
    if len(rests) < FEWEST:
        return None
    without = [_solved(rests[:left_out] + rests[left_out + 1 :]) for left_out in range(len(rests))]
    values, spread = _solved(rests), np.array(without) - np.mean(without, axis=0)
    covariance = (len(rests) - 1) / len(rests) * spread.T @ spread
    information = sum((rest.information for rest in rests), np.zeros((7, 7))) / len(rests)

    def moved(part: slice) -> float:
        """Root mean square of what a part moves bodies by, where that is certainly more than none."""
        square = float(values[part] @ information[part, part] @ values[part])
        chance = float(np.trace(information[part, part] @ covariance[part, part]))
        return float(np.sqrt(square)) if square > CERTAIN**2 * chance else 0.0

    by_lead, by_place = moved(TIME), moved(PLACE)
    lead = float(values[0]) if by_lead else 0.0
    return Wander(carried[0].frame, len(rests), lead, by_lead, by_place if by_place > BESIDE * by_lead else 0.0)


def scatter(carried: Sequence[Carried]) -> Scatter | None:
    """By what poses, in one frame, of bodies that hardly move scatter; None of too few, or where a filter may hide some."""
    still = [each for one in carried for each in _still(one, 0.0)]
    if len(still) < FEWEST:
        return None
    steps = [max(round(STRIDE / each.period), 1) for each in still]
    successive = [np.diff(each.seen, n=3, axis=0) for each in still]
    products = sum(float((bent[1:] * bent[:-1]).sum()) for bent in successive)
    if products > WHITE * sum(float(np.square(bent).sum()) for bent in successive):
        return None
    on_board = np.median([_scatter(each.places, step) for each, step in zip(still, steps)])
    in_carrier = np.median([_scatter(each.seen, step) for each, step in zip(still, steps)])
    return Scatter(carried[0].frame, float(on_board), float(in_carrier))


def _scatter(places: Array, step: int) -> float:
    """Of places (N, 3), by third differences, which hardly know of motion."""
    bent = places[3 * step :] - 3.0 * places[2 * step : -step] + 3.0 * places[step : -2 * step] - places[: -3 * step]
    return float(np.sqrt(np.square(bent).sum(axis=1).mean() / 20.0))


def _solved(rests: Sequence[_Rest]) -> Array:
    """The seven unknowns."""
    information = sum((rest.information for rest in rests), np.zeros((7, 7)))
    return np.asarray(np.linalg.pinv(information, rcond=1e-9, hermitian=True) @ sum(rest.seen for rest in rests))


def _rests(one: Carried, share: float) -> list[_Rest]:
    """Where the body lies on the board and is not carried along."""
    return [_rest(each) for each in _still(one, share) if _span(each.places) * SEEN_TO_MOVE < _span(each.seen)]


def _still(one: Carried, share: float) -> list[_Still]:
    times, places, period = one.body.times, one.body.positions, one.body.period
    half = max(round(HALF / period), 1) if len(times) > 1 else 1
    middle = np.arange(half, len(times) - half)
    if not len(middle):
        return []
    before, after = middle - half, middle + half
    lasted = (times[after] - times[before])[:, np.newaxis]
    turns = quaternions.to_matrix(one.carrier.orientations_wxyz)
    seen = np.einsum("nji,nj->ni", turns, places - one.carrier.positions)

    def carried_along(at: NDArray[np.int64]) -> Array:
        """Where the carrier takes a point that is at m amid."""
        return np.asarray(np.einsum("nij,nj->ni", turns[at], seen[middle]) + one.carrier.positions[at])

    velocities = (carried_along(after) - carried_along(before)) / lasted
    speeds = np.linalg.norm(places[after] - places[before], axis=1) / lasted[:, 0]
    orientations = one.body.orientations_wxyz
    spins = quaternions.angle_between(orientations[before], orientations[after]) / lasted[:, 0]
    slow = speeds < np.maximum(SLOW, share * np.linalg.norm(velocities, axis=1))
    whole = lasted[:, 0] < 3.0 * half * period
    edges = np.flatnonzero(np.diff(np.concatenate([[False], slow & whole & (spins < SLOW_TURN), [False]])))
    edge, found = round(EDGE / period), []
    for first, stop in zip(edges[::2] + edge, edges[1::2] - edge):
        within = middle[first:stop]
        if (stop - first) * period > LEAST and stop - first > LEAST_FRAMES:
            turned = np.stack([np.einsum("nij,nj->ni", turns[within], np.cross(axis, seen[within])) for axis in np.eye(3)], 2)
            rows = np.concatenate([velocities[first:stop, :, np.newaxis], turns[within], turned], 2)
            found.append(_Still(period, places[within], seen[within], rows))
    return found


def _rest(still: _Still) -> _Rest:
    """Rows and places about their means."""
    rows = (still.rows - still.rows.mean(axis=0)).reshape(-1, 7)
    return _Rest(*(rows.T @ each / len(still.places) for each in (rows, (still.places - still.places.mean(axis=0)).ravel())))


def _span(places: Array) -> float:
    return float(np.linalg.norm(np.ptp(places, axis=0)))
