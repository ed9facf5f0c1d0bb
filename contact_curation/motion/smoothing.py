"""Velocities and accelerations of tracked poses: backward differences over the true stamps, then a median of three.

The rules by which ContactNets' public tosses were made (arXiv 2009.11193; method.md 1.0): the difference belongs to the later
of its two frames, so that p' = p + dt v' before the median, which takes single outliers out of the velocities and keeps the
jumps of impacts.

Only frames of fast cameras are filtered so. Slower ones see a contact in one or two frames, which a median of three takes for
outliers, and the friction that is learned is far too low (docs/explanation/learning.md). Noise asks for no filter there: that
of differences falls with the time between frames.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.toss import NANOSECONDS, Toss

QUIET_PERIOD = 1.0 / 150.0
"""[s] Bounds on velocities and accelerations are given for frames that are no closer than this."""

LONGEST_FILTERED = 1.0 / 130.0
"""[s] Velocities of frames that are farther apart are plain differences (`benchmarks.learning.frame_rates`)."""

PLAIN_NOISE = 1.6
"""Largest accelerations of some 10 000 by noise alone, of plain differences relative to filtered ones at the same rate."""


def is_filtered(frame_period: float) -> bool:
    """Whether velocities at a frame period [s] are medians of three."""
    return frame_period <= LONGEST_FILTERED


def noise_without_filter(frame_period: float) -> float:
    """How much larger noise makes derivatives at a frame period [s] because they are not filtered; 1 where they are."""
    return 1.0 if is_filtered(frame_period) else PLAIN_NOISE


def noise_growth(frame_period: float, noise: float = 1.0, order: int = 1) -> float:
    """How much noisier filtered derivatives are than those of ContactNets' poses at `QUIET_PERIOD`; at least 1.

    With bounds that grow so, a tracker's jump of the same length is seen at any rate.

    Args:
        frame_period: [s].
        noise: of the poses, in multiples of that of ContactNets' rig.
        order: 1 of velocities, 2 of accelerations.
    """
    return max(1.0, noise * (QUIET_PERIOD / frame_period) ** order)


def kinematic_noise_growth(frame_period: float, noise: float = 1.0, order: int = 1) -> float:
    """The same of the derivatives that `kinematics` gives, which are not filtered at every rate."""
    return noise_growth(frame_period, noise * noise_without_filter(frame_period), order)


@dataclass(frozen=True, eq=False)
class Kinematics:
    """Rates of T successive poses without gaps.

    Attributes:
        linear_velocities: (T, 3) [m/s] in the board's frame.
        angular_velocities: (T, 3) [rad/s] in the body's frame.
        accelerations: (T, 3) backward differences of the linear velocities [m/s^2]; the first is the second, repeated.
    """

    linear_velocities: Array
    angular_velocities: Array
    accelerations: Array


def median_of_three(values: Array) -> Array:
    """Each row (T, C) of `values` replaced by the median of itself and its neighbours; the ends see themselves twice."""
    padded = np.concatenate([values[:1], values, values[-1:]])
    before, after = padded[:-2], padded[2:]
    return np.asarray(np.maximum(np.minimum(before, after), np.minimum(np.maximum(before, after), values)))


def median_orientations(orientations_wxyz: Array) -> Array:
    """(T, 4) orientations with the median of three taken over rotation vectors.

    The vectors are those to the neighbours from each frame's own orientation: unlike vectors from a fixed orientation, as in
    ContactNets' processing, they cannot wrap around.
    """
    to_previous = quaternions.log(quaternions.multiply(quaternions.conjugate(orientations_wxyz[1:]), orientations_wxyz[:-1]))
    to_next = quaternions.log(quaternions.multiply(quaternions.conjugate(orientations_wxyz[:-1]), orientations_wxyz[1:]))
    none = np.zeros((1, 3))
    neighbours = np.stack(
        [np.concatenate([none, to_previous]), np.concatenate([to_next, none]), np.zeros((len(orientations_wxyz), 3))]
    )
    return quaternions.multiply(orientations_wxyz, quaternions.exp(np.median(neighbours, axis=0)))


def all_around(mask: NDArray[np.bool_], before: int, after: int) -> NDArray[np.bool_]:
    """Frames (T,) for which `mask` (T,) holds from `before` frames earlier to `after` later, as far as there are any.

    An acceleration comes from the poses of frames i - 3 to i + 1: a body is in the air for it only if it is in all of them, or
    the median carries the rebound of an impact into the air.
    """
    padded = np.concatenate([np.ones(before, dtype=bool), mask, np.ones(after, dtype=bool)])
    return np.asarray(np.logical_and.reduce([padded[k : k + len(mask)] for k in range(before + 1 + after)]))


def clear_steps(heights: Array, travels: Array) -> NDArray[np.bool_]:
    """Steps (T - 1,) between frames within which no vertex can have touched the board.

    A bounce takes the body down to the board and up again: the heights at both ends together are a way that it can travel.

    Args:
        heights: (T,) of the lowest vertex [m].
        travels: (T - 1,) how far a vertex comes within each step, at most [m].
    """
    return np.asarray(heights[:-1] + heights[1:] > travels)


def vertex_travels(toss: Toss, reach: float) -> Array:
    """(T - 1,) how far any vertex comes from frame to frame, at most [m]; `reach` is that of the farthest [m]."""
    speeds = quaternions.lengths(toss.linear_velocities) + reach * quaternions.lengths(toss.angular_velocities)
    return np.asarray(np.maximum(speeds[:-1], speeds[1:]) * np.diff(toss.stamps_ns) / NANOSECONDS)


def kinematics(
    stamps_ns: NDArray[np.int64], positions: Array, orientations_wxyz: Array, frame_period: float | None = None
) -> Kinematics:
    """Rates of T >= 2 successive poses.

    Args:
        stamps_ns: (T,) strictly increasing.
        positions: (T, 3) [m] in the board's frame.
        orientations_wxyz: (T, 4) body to board.
        frame_period: of the tracker [s], which decides whether rates are filtered; None for the median of the steps.
    """
    steps = np.diff(stamps_ns)[:, np.newaxis] / NANOSECONDS  # (T - 1, 1)
    turns = quaternions.log(quaternions.multiply(quaternions.conjugate(orientations_wxyz[:-1]), orientations_wxyz[1:]))
    linear, angular = _first_repeated(np.diff(positions, axis=0) / steps), _first_repeated(turns / steps)
    if is_filtered(float(np.median(steps)) if frame_period is None else frame_period):
        linear, angular = median_of_three(linear), median_of_three(angular)
    return Kinematics(linear, angular, _first_repeated(np.diff(linear, axis=0) / steps))


def _first_repeated(differences: Array) -> Array:
    return np.concatenate([differences[:1], differences])
