"""How fast corners leave the board at first impacts, without a model.

The share of its approach speed with which the lowest corner of the body as described leaves the board. Both speeds are taken
over some frames, away from the impact, because filters of trackers spread it. Gravity makes the share a little too small.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contact_curation.contact.body import Body
from contact_curation.geometry.polytopes import Polytope
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.transitions import Transitions

NEAR, FAR = 1, 3
"""Frames from an impact between which its speeds are taken."""

CLOSE = 0.03
"""A corner that comes so near to its lowest height touches the board [characteristic lengths]."""

SLOWEST = 0.1
"""Impacts that approach with less than this share of the fastest say nothing of restitution."""

FEWEST = 4
"""Tosses whose first impacts give a restitution."""

MISSED = 0.05
"""Standard error of a restitution by first impacts of however many tosses: of 0.3 it is 0.25, since bodies fall meanwhile."""

FALLING = 0.2
"""Share of the approach speed that gravity may add in the frames between an impact and its speeds: 0.12 for the real cube."""


class Rebound(NamedTuple):
    """A restitution by first impacts, and its standard error."""

    restitution: float
    error: float


def rebound_of(data: Transitions, body: Body) -> Rebound | None:
    """The median share of tosses, between 0 and 1; None of too few, or if frames are too far apart to see a rebound.

    Args:
        data: transitions between successive frames.
        body: as described.
    """
    speeds = _first_impacts(data.before, data.starts, body)
    fall = body.scaled_gravity * float(np.median(data.dt)) ** 2 * 0.5 * (NEAR + FAR)
    if len(speeds) < FEWEST or fall > FALLING * float(np.median(speeds[:, 0])):
        return None
    shares = speeds[:, 1] / speeds[:, 0]
    median = float(np.median(shares))
    scatter = 1.4826 * float(np.median(np.abs(shares - median)))
    return Rebound(float(np.clip(median, 0.0, 1.0)), float(np.hypot(MISSED, 1.25 * scatter / np.sqrt(len(shares)))))


def rebounds(states: Array, starts: NDArray[np.int64], body: Body) -> Array:
    """Share of its approach speed with which the lowest corner leaves its first impact, of the K motions that have one.

    Args:
        states: (N, 13) of all motions [characteristic lengths].
        starts: (K + 1,) motion k owns rows starts[k]:starts[k + 1].
        body: as described.
    """
    speeds = _first_impacts(states, starts, body)
    return np.asarray(speeds[:, 1] / speeds[:, 0])


def _first_impacts(states: Array, starts: NDArray[np.int64], body: Body) -> Array:
    """(K, 2) speeds per frame before and after, of the motions that have a first impact that is not slow."""
    heights = Polytope(body.scaled_vertices).corner_heights(states[:, :3], states[:, 3:7])  # (N, V)
    speeds = [_impact(heights[first:last]) for first, last in pairwise(starts.tolist())]
    found = np.array([each for each in speeds if each is not None]).reshape(-1, 2)
    return found[found[:, 0] > SLOWEST * found[:, 0].max()] if len(found) else found


def _impact(heights: Array) -> tuple[float, float] | None:
    """Speeds per frame before and after the first impact of corners (T, V); None without one, or enough frames around it."""
    if len(heights) <= 2 * FAR or not np.isfinite(heights).all():
        return None
    lowest = heights.min(axis=1)
    touching = np.flatnonzero(lowest < lowest.min() + CLOSE)
    first = int(touching[0])
    corner = heights[:, int(heights[first].argmin())]
    turn = first + int(np.argmin(corner[first : first + FAR]))
    if turn < FAR or turn + FAR >= len(corner):
        return None
    before, after = ((corner[turn + side * FAR] - corner[turn + side * NEAR]) / (FAR - NEAR) for side in (-1, 1))
    return (float(before), float(after)) if before > 0.0 else None
