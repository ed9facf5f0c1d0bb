"""Generates frames around a stored toss, so that the segmenter cuts out the same toss again.

ContactNets' public files start at the detected release and end at rest; what the tracker saw before and after was not
published. These frames are synthetic and belong to no toss: a body carried at constant velocity that is let go one frame before
the toss, and one that lies still after it. The filter looks at them, so they are chosen to make the first and the last velocity
the file's own. With r_k the raw rate of the step into frame k, and a_0 the acceleration that the start rule wants of frame 0
(-g on average over frames 0 and 1),

    v_0 = median(r_-1, r_0, r_1),  v_1 = median(r_0, r_1, r_2),  v_T-1 = median(r_T-2, r_T-1, r_T)
    r_0 = v_0, or where v_1 wants another, that;   r_-1 = r_-2 = .. = v_0 - a_0 dt;   r_T = v_T-1

The true r_0 made v_0 and v_1 both, so with the tracker's stamps (`recovered_timing`) there is such a one. Velocities of slow
cameras are not filtered (smoothing.py): r_0 = v_0.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.segmenter_config import FALL_TOLERANCE, RIG_GRAVITY, SegmenterConfig
from contact_curation.motion.smoothing import is_filtered, median_of_three
from contact_curation.motion.toss import NANOSECONDS, Toss

FALL_MARGIN = 0.05
"""By how much the first accelerations keep the bounds of the rules [m/s^2]."""

SAME_RATE = 4e-7
"""Rates that differ less are equal (relative): stamps are rounded to nanoseconds."""


@dataclass(frozen=True, eq=False)
class Surroundings:
    """A toss of T frames with `before` frames in front and some behind.

    Attributes:
        before: number of made-up frames in front.
        stamps_ns: (before + T + after,) from zero on; those of the toss are its own, those around it even.
        positions: (before + T + after, 3) [m].
        orientations_wxyz: (before + T + after, 4).
    """

    before: int
    stamps_ns: NDArray[np.int64]
    positions: Array
    orientations_wxyz: Array


def surrounded(toss: Toss, before: int, after: int, config: SegmenterConfig) -> Surroundings:
    """A toss with made-up frames around it, `toss.frame_period` in whole nanoseconds apart.

    Args:
        toss: T frames.
        before: frames in front, at least 4: what the start rule looks at.
        after: frames behind, at least 1: what the last velocity looks at.
        config: whose rules the first frames shall meet.
    """
    period_ns = round(toss.frame_period * NANOSECONDS)
    dt = period_ns / NANOSECONDS
    own, raw = _rates(toss)
    release = _release_rate(own, raw) if is_filtered(toss.frame_period) else own[0]
    held = own[0].copy()
    held[2] -= dt * _first_acceleration(toss, release, raw, config)
    steps = dt * np.concatenate([np.tile(held, (before - 1, 1)), release[np.newaxis]])  # (before, 6), the last leads to frame 0
    return Surroundings(
        before,
        _stamps(toss, period_ns, before, after),
        np.concatenate(
            [
                toss.positions[0] - np.cumsum(steps[::-1, :3], axis=0)[::-1],
                toss.positions,
                np.tile(toss.positions[-1] + dt * own[-1, :3], (after, 1)),
            ]
        ),
        np.concatenate(
            [
                _turned_to(toss.orientations_wxyz[0], steps[:, 3:]),
                toss.orientations_wxyz,
                np.tile(quaternions.multiply(toss.orientations_wxyz[-1], quaternions.exp(dt * own[-1, 3:])), (after, 1)),
            ]
        ),
    )


def _rates(toss: Toss) -> tuple[Array, Array]:
    """The velocities of a toss (T, 6), linear and angular, and the raw rates of its first two steps (2, 6)."""
    own = np.concatenate([toss.linear_velocities, toss.angular_velocities], axis=1)
    seconds = np.diff(toss.stamps_ns[:3])[:, np.newaxis] / NANOSECONDS
    orientations = toss.orientations_wxyz[:3]
    turned = quaternions.multiply(quaternions.conjugate(orientations[:-1]), orientations[1:])
    raw = np.concatenate([np.diff(toss.positions[:3], axis=0), quaternions.log(turned)], axis=1) / seconds
    return own, raw if len(raw) == 2 else np.concatenate([raw, own[-1:]])


def _release_rate(own: Array, raw: Array) -> Array:
    """The raw rate of frame 0 (6,) that makes the first two velocities `own` (T, 6) out of `raw` (2, 6), as nearly as can be.

    The error of both is piecewise linear in it, so the least is at one of its corners: the velocities and the raw rates.
    """
    tried = np.stack([own[0], own[1], raw[0], raw[1]])  # (4, 6)
    first = np.clip(own[0], np.minimum(tried, raw[0]), np.maximum(tried, raw[0]))
    second = np.clip(tried, raw.min(axis=0), raw.max(axis=0))
    error = np.abs(first - own[0]) + np.abs(second - own[1])
    best = np.argmax(error <= error.min(axis=0) + SAME_RATE * np.abs(tried).max(axis=0), axis=0)  # (6,)
    return np.asarray(tried[best, np.arange(6)])


def _first_acceleration(toss: Toss, release: Array, raw: Array, config: SegmenterConfig) -> float:
    """Upward acceleration of frame 0: the mean over frames 0 and 1 is -g where the bound on each allows it [m/s^2]."""
    velocity = median_of_three(np.concatenate([release[np.newaxis], raw]))[1, 2]
    second = (velocity - toss.linear_velocities[0, 2]) / (toss.stamps_ns[1] - toss.stamps_ns[0]) * NANOSECONDS
    gravity = config.gravity or RIG_GRAVITY
    tolerance = config.fall_tolerance or FALL_TOLERANCE * gravity
    return min(-2.0 * gravity - float(second), tolerance - FALL_MARGIN - gravity)


def _turned_to(orientation_wxyz: Array, turns: Array) -> Array:
    """Orientations (N, 4) from which successive turns (N, 3) lead to `orientation_wxyz`."""
    orientations = []
    for turn in turns[::-1]:
        orientation_wxyz = quaternions.multiply(orientation_wxyz, quaternions.exp(-turn))
        orientations.append(orientation_wxyz)
    return np.array(orientations[::-1])


def _stamps(toss: Toss, period_ns: int, before: int, after: int) -> NDArray[np.int64]:
    """Stamps of a toss and the frames around it, from zero on."""
    own = period_ns * before + toss.stamps_ns - toss.stamps_ns[0]
    return np.concatenate([period_ns * np.arange(before), own, own[-1] + period_ns * np.arange(1, after + 1)])
