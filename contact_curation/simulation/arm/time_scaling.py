"""Stops an arm on its planned path: the path stays, and time on it slows down until it stands still.

On the path P(s) the arm goes by s(t) with s' = 1 - 3 u^2 + 2 u^3, u = t / T, so that

    q' = P'(s) s'    q'' = P''(s) s'^2 + P'(s) s''

T is the shortest time for which the accelerations stay within the limits. A path that ends at rest can always be stopped so:
the slower time slows down, the more the stop is the path's own end.
"""

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.simulation.arm.path import JointPath

SHORTEST, LONGER = 0.05, 1.2
"""First stopping time that is tried [s], and the ratio of each to the one before."""

SLOWEST = 50.0
"""Times the rest of the path: a stop this slow is the path itself."""


def stopped(path: JointPath, at: float, step: float, acceleration: Array) -> JointPath:
    """The way to rest from where a path is at a time.

    Args:
        path: samples every `step`, at rest at its end.
        at: time on it from which on it is slowed down [s].
        step: between samples [s].
        acceleration: (J,) limits [rad/s^2].
    """
    if at <= 0.0:  # it has not begun
        still = np.zeros((2, path.positions.shape[1]))
        return JointPath(np.repeat(path.positions[:1], 2, axis=0), still, still)
    rest = (len(path) - 1) * step - at
    total = SHORTEST
    while True:
        slowed = _slowed(path, at, step, total)
        fits = bool((np.abs(slowed.accelerations) <= acceleration).all())
        if fits or total > SLOWEST * max(rest, step):
            return slowed
        total *= LONGER


def _slowed(path: JointPath, at: float, step: float, total: float) -> JointPath:
    count = max(int(np.ceil(total / step)), 2)
    total = count * step
    u = np.linspace(0.0, 1.0, count + 1)
    on_path = at + total * (u - u**3 + 0.5 * u**4)
    rate, change = 1.0 - 3.0 * u**2 + 2.0 * u**3, (6.0 * u**2 - 6.0 * u) / total
    rows = np.clip(on_path / step, 0.0, len(path) - 1.0)
    first = np.minimum(rows.astype(int), len(path) - 2)
    share = (rows - first)[:, None]
    positions, speeds, accelerations = (
        part[first] + share * (part[first + 1] - part[first]) for part in (path.positions, path.speeds, path.accelerations)
    )
    moving = (rows < len(path) - 1.0)[:, None]
    rate, change = rate[:, None], change[:, None]
    return JointPath(positions, moving * speeds * rate, moving * (accelerations * rate**2 + speeds * change))
