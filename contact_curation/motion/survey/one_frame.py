"""Whether positions and orientations are given in one frame: impacts of a single corner turn a body as they push it.

    d(R J w) = r x (d v + g dt)        J = I / m, r from the centre of mass to the lowest corner

The right side comes from positions, but for r, and the left side from orientations. Where positions alone were mirrored or
turned about the vertical, bodies still fall and come to rest flat; but C (d v + g dt) in place of the push, with a mirror or a
turn C, then explains the change of spin better. Of all C the one with the smallest median error is compared with none.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.toss import NANOSECONDS, Toss

FEWEST = 8
"""Impacts from which anything is said."""

APART, STRONG = 0.05, 0.2
"""A single corner hits the board where the next one is higher by so much of the body's radius, and it is pushed up so much
[m/s]."""

TURNS = 72
"""Steps of 5 degrees in which turns are tried, each with and without a mirror."""

NEAR = 25.0
"""Degrees: up to so much the best turn of the real tosses may be away from none by chance."""

BETTER, CERTAIN = 1.25, 2.0
"""Times the smaller median error; standard errors by which more than half of the impacts must be explained better
(`python -m benchmarks.data.half_converted`)."""


class OtherFrame(NamedTuple):
    """How the frame of positions lies in that of orientations.

    Attributes:
        mirrored: whether one of them is left-handed.
        angle: turn about the vertical, before it the mirror of y [degrees].
        times: by which the median error is larger as read.
        impacts: that were used.
    """

    mirrored: bool
    angle: float
    times: float
    impacts: int


def other_frame(tosses: Sequence[Toss], vertices: Array, inertia: Array, gravity: float) -> OtherFrame | None:
    """The frame of positions where it certainly is not that of orientations.

    Args:
        tosses: on a level board.
        vertices: (V, 3) from the centre of mass [m].
        inertia: (3, 3) of a body of 1 kg [m^2].
        gravity: [m/s^2].
    """
    arms, pushes, turned = np.concatenate(
        [np.zeros((0, 3, 3)), *(_impacts(toss, vertices, inertia, gravity) for toss in tosses)]
    ).transpose(1, 0, 2)
    if len(arms) < FEWEST:
        return None
    angles = 2.0 * np.pi * np.arange(TURNS) / TURNS
    around = np.stack([np.zeros(TURNS), np.zeros(TURNS), angles], axis=1)
    turns = quaternions.to_matrix(quaternions.exp(around))
    tried = np.concatenate([turns, turns * np.array([1.0, -1.0, 1.0])])  # (2 TURNS, 3, 3)
    errors = quaternions.lengths(turned - np.cross(arms, np.einsum("cij,nj->cni", tried, pushes)))
    medians = np.median(errors, axis=1)
    best = int(np.argmin(medians))
    angle = float(np.degrees(angles[best % TURNS]))
    signs = 2.0 * float(np.mean(errors[0] > errors[best])) - 1.0
    found = OtherFrame(best >= TURNS, angle, float(medians[0] / medians[best]), len(arms))
    is_near = not found.mirrored and min(angle, 360.0 - angle) <= NEAR
    return None if is_near or found.times < BETTER or signs * np.sqrt(len(arms)) < CERTAIN else found


def _impacts(toss: Toss, vertices: Array, inertia: Array, gravity: float) -> Array:
    """(n, 3, 3) of the impacts of single corners: r, push and change of the angular momentum, both of 1 kg."""
    turns = quaternions.to_matrix(toss.orientations_wxyz)
    corners = np.einsum("tij,vj->tvi", turns, vertices)
    lowest = corners[..., 2].argmin(axis=1)
    lowest_two = np.sort(corners[..., 2], axis=1)[:, :2]
    pushes = np.diff(toss.linear_velocities, axis=0)
    pushes[:, 2] += gravity * np.diff(toss.stamps_ns) / NANOSECONDS
    momenta = np.einsum("tij,jk,tk->ti", turns, inertia, toss.angular_velocities)
    single = np.diff(lowest_two, axis=1)[:-1, 0] > APART * float(quaternions.lengths(vertices).max())
    hit = single & (lowest[1:] == lowest[:-1]) & (pushes[:, 2] > STRONG)
    arms = corners[np.arange(len(lowest)), lowest][:-1]
    return np.asarray(np.stack([arms, pushes, np.diff(momenta, axis=0)], axis=1)[hit])
