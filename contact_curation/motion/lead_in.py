"""The frames around a stored toss, made up so that the segmenter cuts the same toss out again.

ContactNets' public files start at the detected release and end at rest; what the tracker saw before and after was not
published. These frames are synthetic and belong to no toss: a body carried at constant velocity that is let go one frame before
the toss, and one that lies still after it.

With the median of three, the filtered velocity of frame 0 is the toss's own v_0 when the difference quotient of frame 0 is v_0
and the one before it is not below it in z:

    p_-1 = p_0 - v_0 dt,    p_-k-1 = p_-k - (v_0 - a_0 dt) dt,    q_-k = q_0 exp(-k w_0 dt)

where the acceleration a_0 of frame 0 is the one that the start rule wants: -g on average over frames 0 and 1. Even stamps are
not those of the tracker, so a few tosses would not be seen to fall from their own v_0: these get a velocity nearer to that of
the next frame.
"""

from dataclasses import dataclass

import numpy as np

from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.segmenter_config import SegmenterConfig
from contact_curation.motion.smoothing import median_of_three
from contact_curation.motion.toss import Toss

FALL_MARGIN = 0.05
"""By how much the first accelerations keep the bounds of the rules [m/s^2]."""

SHARES = np.linspace(0.0, 1.0, 9)
"""How far the release velocity may go from the toss's own to that of the next frame."""

SEEN = 5
"""The first accelerations that the release velocity has a part in, and some more, hang on so many positions."""


@dataclass(frozen=True, eq=False)
class Surroundings:
    """A toss of T frames with `before` frames in front and some behind.

    Attributes:
        before: number of made-up frames in front.
        positions: (before + T + after, 3) [m].
        orientations_wxyz: (before + T + after, 4).
    """

    before: int
    positions: Array
    orientations_wxyz: Array


def surrounded(toss: Toss, before: int, after: int, config: SegmenterConfig) -> Surroundings:
    """A toss with made-up frames around it, for even stamps `toss.frame_period` apart.

    Args:
        toss: at least `SEEN` frames.
        before: frames in front, at least 4: what the start rule looks at.
        after: frames behind, at least 1: what the last velocity looks at.
        config: whose rules the first frames shall meet.
    """
    dt = toss.frame_period
    release = _release_velocity(toss, config)
    held = release - np.array([0.0, 0.0, dt * _first_acceleration(toss, release, config)])
    steps = dt * np.concatenate([np.tile(held, (before - 1, 1)), release[np.newaxis]])  # (before, 3), the last leads to frame 0
    ahead = toss.positions[0] - np.cumsum(steps[::-1], axis=0)[::-1]
    turns = quaternions.exp(-dt * np.arange(before, 0, -1)[:, np.newaxis] * toss.angular_velocities[0])
    rest = toss.positions[-1] + dt * toss.linear_velocities[-1]
    turned = quaternions.multiply(toss.orientations_wxyz[-1], quaternions.exp(dt * toss.angular_velocities[-1]))
    return Surroundings(
        before,
        np.concatenate([ahead, toss.positions, np.tile(rest, (after, 1))]),
        np.concatenate(
            [quaternions.multiply(toss.orientations_wxyz[0], turns), toss.orientations_wxyz, np.tile(turned, (after, 1))]
        ),
    )


def _release_velocity(toss: Toss, config: SegmenterConfig) -> Array:
    """The velocity of frame 0 (3,) nearest to the toss's own from which it is seen to fall freely; its own if none is."""
    own: Array = toss.linear_velocities[0]
    following: Array = (toss.positions[1] - toss.positions[0]) / toss.frame_period + np.array(
        [0.0, 0.0, config.gravity * toss.frame_period]
    )
    for share in SHARES:
        release = own + share * (following - own)
        if _falls_freely(_accelerations(toss, release, config), config):
            return release
    return own


def _falls_freely(accelerations: Array, config: SegmenterConfig) -> bool:
    """Whether frames 0 and 1 start a toss, and they and frame 2 move as a body in the air."""
    excess = np.linalg.norm(accelerations + np.array([0.0, 0.0, config.gravity]), axis=1)
    starting = accelerations[:2, 2]
    return bool(
        excess.max() < config.airborne_acceleration - FALL_MARGIN
        and starting.max() < config.fall_tolerance - FALL_MARGIN - config.gravity + 1e-9
        and abs(starting.mean() + config.gravity) < config.fall_mean_tolerance
    )


def _accelerations(toss: Toss, release: Array, config: SegmenterConfig) -> Array:
    """Of frames 0 to 2, as the segmenter will see them (3, 3) [m/s^2]."""
    first = np.array([0.0, 0.0, _first_acceleration(toss, release, config)])
    return np.concatenate([first[np.newaxis], np.diff(_first_velocities(toss, release), axis=0)[:2] / toss.frame_period])


def _first_acceleration(toss: Toss, release: Array, config: SegmenterConfig) -> float:
    """Upward acceleration of frame 0: the mean over frames 0 and 1 is -g where the bound on each allows it [m/s^2]."""
    second = (_first_velocities(toss, release)[1, 2] - release[2]) / toss.frame_period
    return min(-2.0 * config.gravity - float(second), config.fall_tolerance - FALL_MARGIN - config.gravity)


def _first_velocities(toss: Toss, release: Array) -> Array:
    """Filtered velocities of the first frames, when frame 0 has the velocity `release` (SEEN - 1, 3) [m/s]."""
    quotients = np.diff(toss.positions[:SEEN], axis=0) / toss.frame_period
    return median_of_three(np.concatenate([release[np.newaxis], quotients]))[: SEEN - 1]
