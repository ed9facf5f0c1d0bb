"""How an arm follows a path, told from its joint states: how late it is, how far its joints go, how far off they are.

A controller passes each place of its trajectory a little later than planned, and a joint may go a little further from home than
it is told, or less far. With joint positions q_k measured at times t_k, the lag and the gains g_j of the joints are the
least-squares solution of

    q_k = h + g (T(t_k - lag) - h)

where T is what the controller was told and h is home, by Gauss-Newton steps for the lag over all joints and samples, with the
best gains at each (variable projection). A prior keeps the gain of a joint that hardly moves at 1. The tracking error is the
distance from the path P that was planned, q_k - P(t_k - lag).

`JointGains` carries the gains from one throw to the next, and divides what the joints are told by them.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.simulation.arm.path import JointPath
from contact_curation.simulation.arm.throw_motion import STEP

ITERATIONS = 6
LEAST_MOTION = 1e-3
"""Mean square speed from which on a lag can be told [rad^2/s^2]."""

DAMPING = (2e-3 / 0.02) ** 2
"""Of steps of the lag: 2 mrad of error in a joint state, against lags that are 20 ms off [rad^2/s^2]."""

PRIOR = (2e-3 / 0.02) ** 2
"""Weight of the prior of a gain, in sums of squares of a joint's way: 2 mrad of error in a joint state, against gains that are
2 % off 1 [rad^2]."""

REMEMBERED = 0.8
"""Weight that what is known keeps at each throw."""

LARGEST_CORRECTION = 0.05
"""Of a gain, from 1."""


class Following(NamedTuple):
    """How an arm of J joints follows.

    Attributes:
        lag: time by which it passes places later than planned [s].
        error: largest distance of a joint from the path that is late by this [rad].
        joint: number of that joint, from 1.
        gains: (J,) how far each joint goes from home, as a share of what it was told.
        weights: (J,) of these gains: sums of squares of the ways that were told [rad^2].
    """

    lag: float
    error: float
    joint: int
    gains: Array
    weights: Array


@dataclass(frozen=True)
class JointGains:
    """How far J joints go from home, as shares of what they are told.

    Attributes:
        gains: of the joints; empty before the first throw.
        weights: of the gains [rad^2].
    """

    gains: tuple[float, ...] = ()
    weights: tuple[float, ...] = ()

    def after(self, found: Following) -> "JointGains":
        """What is known after a throw that showed this."""
        before = REMEMBERED * np.array(self.weights or np.zeros_like(found.weights))
        weights = before + found.weights + PRIOR  # of at least the prior's, so that a mean exists
        known = np.array(self.gains or np.ones_like(found.gains))
        gains = (before * known + (found.weights + PRIOR) * found.gains) / weights
        gains = np.clip(gains, 1.0 - LARGEST_CORRECTION, 1.0 + LARGEST_CORRECTION)
        return JointGains(tuple(gains.tolist()), tuple(weights.tolist()))

    def told(self, path: JointPath, home: Array) -> JointPath:
        """What to tell the joints so that they follow a path; `home` (J,) [rad]."""
        if not self.gains:
            return path
        gains = np.array(self.gains)
        return JointPath(home + (path.positions - home) / gains, path.speeds / gains, path.accelerations / gains)


UNKNOWN_GAINS = JointGains()


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
