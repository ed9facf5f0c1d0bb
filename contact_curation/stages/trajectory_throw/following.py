"""How an arm follows a planned path, told from its joint states: how late it is, and how far it is off.

An arm with a controller passes each place of its path a little later than planned. With joint positions q_k measured at times
t_k the lag is the least-squares solution of

    q_k = P(t_k - lag)

by Gauss-Newton steps, over all joints and samples. What remains is the tracking error.
"""

from typing import NamedTuple

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.simulation.arm.path import JointPath
from contact_curation.simulation.arm.throw_motion import STEP

ITERATIONS = 4
LEAST_MOTION = 1e-3
"""Mean square speed from which on a lag can be told [rad^2/s^2]."""


class Following(NamedTuple):
    """How an arm follows.

    Attributes:
        lag: time by which it passes places later than planned [s].
        error: largest distance of a joint from the path that is late by this [rad].
        joint: number of that joint, from 1.
    """

    lag: float
    error: float
    joint: int


def positions_at(path: JointPath, times: Array) -> tuple[Array, Array]:
    """Positions (N, J) [rad] and speeds (N, J) [rad/s] of a path at times (N,) [s] after its beginning; it rests outside."""
    rows = np.clip(np.asarray(times) / STEP, 0.0, len(path) - 1.0)
    first = np.minimum(rows.astype(int), len(path) - 2)
    share = (rows - first)[:, None]
    positions = path.positions[first] + share * (path.positions[first + 1] - path.positions[first])
    return positions, path.speeds[first] + share * (path.speeds[first + 1] - path.speeds[first])


def following(path: JointPath, times: Array, positions: Array, guess: float, latest: float) -> Following:
    """How an arm follows a path.

    Args:
        path: planned.
        times: (N,) of the joint states, after the path's planned beginning [s].
        positions: (N, J) of the joints then [rad].
        guess: the lag, which is kept where nothing has moved so far [s].
        latest: largest lag; none is negative [s].
    """
    lag = guess
    for _ in range(ITERATIONS):
        planned, speeds = positions_at(path, times - lag)
        motion = float((speeds**2).sum())
        if motion < LEAST_MOTION * len(times):
            break
        lag = float(np.clip(lag - (speeds * (positions - planned)).sum() / motion, 0.0, latest))
    off = np.abs(positions - positions_at(path, times - lag)[0]).max(axis=0)
    return Following(lag, float(off.max()), int(off.argmax()) + 1)
