"""The friction of each toss, from how fast it slows down while it slides, without a contact model.

A body that slides on a level board and hardly turns slows down by mu g along its way, whatever its shape. A run of such frames
gives mu and, by how far speeds scatter about a line, its standard error; the runs of a toss are averaged. If the frictions of
tosses scatter more than their errors explain, they differ: dust, a worn face, a board that is not alike everywhere. One
coefficient then describes the mean of the tosses that it was learned from, and informative tosses may be far from it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.survey.rig import CONFIDENCE
from contact_curation.motion.toss import Toss

SLOWEST, FEWEST_FRAMES = 0.1, 8
"""A body slides if its centre is faster along the board than this [m/s], for so many frames in a row."""

STEADY, YAWING = 0.15, 0.4
"""Shares of this speed that its vertical speed and that of a corner by its tumbling may have, and that by its turning on the
board, which lessens the friction along the way by less than a quarter of the share's square: by 4 %."""

FALLING = 0.5
"""A body whose vertical speed falls by more than this share of gravity is in the air, such as at the top of its flight."""

FAR, SURELY = 0.3, 5.0
"""A toss does not slide as the others do if its friction is off their median by more than this share and so many standard
deviations of the tosses. Of the 528 real tosses that slide none is off by more than 0.23, or 4 deviations."""


@dataclass(frozen=True, eq=False)
class Sliding:
    """Frictions of K tosses that slid.

    Attributes:
        friction: (K,) of each; negative where it became faster.
        error: (K,) its standard error.
        toss_ids: of each; empty where they are of no matter.
    """

    friction: Array
    error: Array
    toss_ids: tuple[str, ...] = ()

    @property
    def median(self) -> float:
        """The middle one."""
        return float(np.median(self.friction))

    @property
    def scatter(self) -> float:
        """Standard deviation over the tosses: of a normal distribution, and hardly of outliers."""
        return 1.4826 * float(np.median(np.abs(self.friction - self.median)))

    @property
    def apart(self) -> NDArray[np.bool_]:
        """(K,) tosses that do not slide as the others do: something else slowed them down, or pushed them."""
        off = np.abs(self.friction - self.median)
        return np.asarray((off > FAR * self.median) & (off > SURELY * np.hypot(self.scatter, self.error)))

    @property
    def median_error(self) -> float:
        """Its standard error, of tosses whose frictions scatter as they do."""
        return 1.25 * max(self.scatter, float(np.median(self.error))) / float(np.sqrt(len(self.friction)))

    @property
    def median_interval(self) -> float:
        """Half of its 95 % interval: by Student's t of (K - 1) / 2 degrees of freedom, since a median tells the scatter."""
        from scipy.special import stdtrit  # takes a tenth of a second to import

        return float(stdtrit(0.5 * (len(self.friction) - 1), CONFIDENCE)) * self.median_error

    def farthest_from(self, friction: float) -> float:
        """How far the median may be from another friction, with 95 % confidence."""
        return abs(self.median - friction) + self.median_interval

    @property
    def variation(self) -> float:
        """Standard deviation of the tosses' frictions, without what their errors explain, relative to their median."""
        return float(np.sqrt(max(self.scatter**2 - float(np.median(self.error)) ** 2, 0.0)) / self.median)


def sliding(tosses: Sequence[Toss], radius: float, gravity: float) -> Sliding:
    """Frictions of those tosses that slide.

    Args:
        tosses: along a level board.
        radius: distance of the body's farthest corner from its centre [m].
        gravity: [m/s^2].
    """
    found = [(toss.toss_id, one) for toss in tosses if (one := _of_toss(toss, radius, gravity)) is not None]
    friction, error = np.array([one for _, one in found]).reshape(-1, 2).T
    return Sliding(friction, error, tuple(toss_id for toss_id, _ in found))


def _of_toss(toss: Toss, radius: float, gravity: float) -> tuple[float, float] | None:
    """Mean friction of the runs of a toss, by their precision, and its standard error; None without one."""
    velocities = toss.linear_velocities
    speed = np.linalg.norm(velocities[:, :2], axis=1)
    spins = radius * quaternions.rotate(toss.orientations_wxyz, toss.angular_velocities)
    tumbling, yawing = np.linalg.norm(spins[:, :2], axis=1), np.abs(spins[:, 2])
    slides = (speed > SLOWEST) & (np.abs(velocities[:, 2]) < STEADY * speed)
    steady = slides & (tumbling < STEADY * speed) & (yawing < YAWING * speed)
    seconds = 1e-9 * (toss.stamps_ns - toss.stamps_ns[0])
    edges = np.flatnonzero(np.diff(np.concatenate([[False], steady, [False]])))
    runs = [(seconds[first:last], velocities[first:last]) for first, last in _long(edges)]
    on_board = [_slope(times, speeds[:, 2])[0] > -FALLING * gravity for times, speeds in runs]
    slowed = np.array([_of_run(*run) for run, slid in zip(runs, on_board, strict=True) if slid]).reshape(-1, 2) / gravity
    if not len(slowed):
        return None
    precision = slowed[:, 1] ** -2.0
    mean = float(precision @ slowed[:, 0] / precision.sum())
    return mean, float(precision.sum() ** -0.5)


def _long(edges: NDArray[np.intp]) -> list[tuple[int, int]]:
    """First frames and ends of runs that are long enough, of where runs begin, end, begin ..."""
    return [(int(first), int(last)) for first, last in list(pairwise(edges))[::2] if last - first >= FEWEST_FRAMES]


def _of_run(seconds: Array, velocities: Array) -> tuple[float, float]:
    """Deceleration along the mean direction on the board, and its standard error [m/s^2]."""
    mean = velocities[:, :2].mean(axis=0)
    slope, error = _slope(seconds, velocities[:, :2] @ (mean / np.linalg.norm(mean)))
    return -slope, error


def _slope(seconds: Array, speeds: Array) -> tuple[float, float]:
    """Of a line through speeds, and its standard error [m/s^2]."""
    times = seconds - seconds.mean()
    slope = float(times @ speeds / (times @ times))
    residuals = speeds - speeds.mean() - slope * times
    spread = float(np.sqrt(residuals @ residuals / (len(seconds) - 2)))
    return slope, max(spread / float(np.sqrt(times @ times)), 1e-6)
