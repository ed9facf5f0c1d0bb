"""How an arm follows a path, told from its joint states: how late it is, how far its joints go, how far off they are.

A controller passes each place of its trajectory a little later than planned, and a joint may go a little further from home than
it is told, or less far. With joint positions q_k measured at times t_k, the lag and the gains g_j of the joints are the
least-squares solution of

    q_k = h + g (T(t_k - lag) - h)

where T is what the controller was told and h is home, by Gauss-Newton steps for the lag over all joints and samples, with the
best gains at each (variable projection). A prior keeps the gain of a joint that hardly moves at 1. The tracking error is the
distance from the path P that was planned, q_k - P(t_k - lag).

`joint_gains` carries the gains from one throw to the next.
"""

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.simulation.arm.path import JointPath
from contact_curation.simulation.arm.throw_motion import STEP
from contact_curation.stages.joint_gains import PRIOR, Following

ITERATIONS = 6
LEAST_MOTION = 1e-3
"""Mean square speed from which on a lag can be told [rad^2/s^2]."""

DAMPING = (2e-3 / 0.02) ** 2
"""Of steps of the lag: 2 mrad of error in a joint state, against lags that are 20 ms off [rad^2/s^2]."""


def positions_at(path: JointPath, times: Array) -> tuple[Array, Array]:
    """Positions (N, J) [rad] and speeds (N, J) [rad/s] of a path at times (N,) [s] after its beginning; it rests outside."""
    rows = np.clip(np.asarray(times) / STEP, 0.0, len(path) - 1.0)
    first = np.minimum(rows.astype(int), len(path) - 2)
    share = (rows - first)[:, None]
    positions = path.positions[first] + share * (path.positions[first + 1] - path.positions[first])
    return positions, path.speeds[first] + share * (path.speeds[first + 1] - path.speeds[first])


def following(
    path: JointPath, told: JointPath, home: Array, times: Array, positions: Array, guess: float, latest: float
) -> Following:
    """How an arm follows a path.

    Args:
        path: that it is to follow.
        told: what its joints were told for that.
        home: (J,) posture from which their ways count [rad].
        times: (N,) of the joint states, after the path's planned beginning [s].
        positions: (N, J) of the joints then [rad].
        guess: the lag, which is kept where nothing has moved so far [s].
        latest: largest lag; none is negative [s].
    """
    lag, gone = guess, positions - home
    for _ in range(ITERATIONS):
        places, speeds = positions_at(told, times - lag)
        if (speeds**2).sum() < LEAST_MOTION * len(times):
            break
        ways = places - home
        gains, squares = _gains(ways, gone)
        slopes = gains * (speeds - ways * (ways * speeds).sum(axis=0) / (squares + PRIOR))
        step = (slopes * (gone - gains * ways)).sum() / ((slopes**2).sum() + DAMPING)
        lag = float(np.clip(lag - step, 0.0, latest))
    off = np.abs(positions - positions_at(path, times - lag)[0]).max(axis=0)
    return Following(lag, float(off.max()), int(off.argmax()) + 1, *_gains(positions_at(told, times - lag)[0] - home, gone))


def _gains(told: Array, gone: Array) -> tuple[Array, Array]:
    squares = (told**2).sum(axis=0)
    return ((told * gone).sum(axis=0) + PRIOR) / (squares + PRIOR), squares
