"""A stored toss as the tracker saw it: with the stamps that its velocities were made with, on the board they were made on.

The velocities determine the yaw up to quarter turns. The throw determines the rest: turned back, every public toss leaves
within 12 degrees of an axis of the board, as from one machine at one side of it, so each is turned on until it leaves along x.

The tracker's own stamps, and the board it measured on, read out of the velocities that were made with them.

ContactNets' files hold poses and filtered velocities, but no stamps: those of the tracker jitter, and after the filter the
poses were turned about the vertical by a random angle. Both can be undone. With theta_j the step of one channel (three of
position, three of rotation) into frame j, and dt_j its time,

    v_k = median(theta_k-1 / dt_k-1, theta_k / dt_k, theta_k+1 / dt_k+1)

so v_k is exactly one of the three, and dt_j is among the ratios theta_j / v_k, k = j - 1 .. j + 1, of nearly every channel.
Witnesses show which: several channels that give the same period to rounding, or one that gives a multiple of 2^-22 s, as every
difference of Unix times in float64 seconds is (from 2004 to 2038; 238 ns apart, against ratios good to 1e-4 ns). Witnesses
that contradict each other show nothing: a body that slides straight on makes every neighbour's ratio one.

The yaw is found likewise. Where the medians of x and y come from different frames, v_k - theta_j / dt_j is along an axis of the
board that the medians were taken on; those directions agree, up to the quarter turns that medians cannot tell apart.

Limits: a period that no median took leaves no trace but the bounds it kept. It is chosen within these, nearest to the typical
one, and reproduces the velocities as well as the true one does. The first frame has no step. Where fewer than half of the
steps are witnessed, the velocities were not made this way and the periods are nominal.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.toss import NANOSECONDS, Toss

RESOLUTION = 2.0**-22
"""Of Unix times in float64 seconds, from 2004 to 2038 [s]."""

JITTER = 0.06
"""Periods are within this share of the nominal one."""

ROUNDING = 16.0 * float(np.finfo(float).eps)
"""Of a step, relative to the values it is the difference of; what the public files show is a tenth."""

COARSEST = 1e-6
"""Ratios that rounding makes coarser than this say nothing (relative)."""

RESOLVED = 1e-8
"""And those coarser than this may be multiples of the resolution by chance."""

SAME_RATE = 1e-8
"""Rates that differ less, in units of a toss's typical one, are equal."""

WITNESSES = 2
"""So many make a period certain."""

SAME_DIRECTION = 1e-8
"""Directions that differ less agree [rad]."""

SWEEPS = 3
"""Over the periods that no median took; neighbouring ones bound each other."""


@dataclass(frozen=True, eq=False)
class RecoveredTiming:
    """Of T frames.

    Attributes:
        periods: (T,) time since the frame before [s]; nominal for the first.
        yaw: the file is the tracker's board turned by this about the vertical [rad], in [0, pi/2).
        witnesses: (T,) how many determine each period.
        linear_residuals: (T,) largest difference of a stored linear velocity, turned back, from the median [length/s]. At both
            ends the frames outside are taken as what suits best.
        angular_residuals: (T,) likewise [rad/s].
    """

    periods: Array
    yaw: float
    witnesses: NDArray[np.int64]
    linear_residuals: Array
    angular_residuals: Array

    @property
    def anchored(self) -> NDArray[np.bool_]:
        """(T,) whether a period is certain."""
        return self.witnesses >= WITNESSES

    @property
    def found(self) -> bool:
        """Whether the velocities were made with stamps that jitter: else the periods are nominal."""
        return _mostly_witnessed(self.witnesses)


def recover_timing(
    positions: Array, orientations_wxyz: Array, linear_velocities: Array, angular_velocities: Array, nominal_period: float
) -> RecoveredTiming:
    """Finds the periods and the yaw that the velocities were made with.

    Args:
        positions: (T, 3) in any unit of length, T >= 4.
        orientations_wxyz: (T, 4) body to board.
        linear_velocities: (T, 3) in the same unit per second, in the board's frame.
        angular_velocities: (T, 3) in the body's frame [rad/s].
        nominal_period: [s].
    """
    turns = quaternions.log(quaternions.multiply(quaternions.conjugate(orientations_wxyz[:-1]), orientations_wxyz[1:]))
    steps = np.concatenate([np.full((1, 6), np.nan), np.concatenate([np.diff(positions, axis=0), turns], axis=1)])  # (T, 6)
    rates = np.concatenate([linear_velocities, angular_velocities], axis=1)  # (T, 6)
    rounding = ROUNDING * np.repeat([np.abs(positions).max(), 1.0], 3)
    upright = slice(2, 6)  # z and the turns of the body are the same before and after a yaw
    periods, witnesses = _witnessed(*_ratios(steps[:, upright], rates[:, upright], rounding[upright], nominal_period))
    yaw = _yaw(steps[:, :2], rates[:, :2], np.where(witnesses >= WITNESSES, periods, np.nan))
    steps, rates = _turned_back(steps, yaw), _turned_back(rates, yaw)
    ratios, slack = _ratios(steps, rates, rounding, nominal_period)
    periods, witnesses = _witnessed(ratios, slack)
    if _mostly_witnessed(witnesses):
        periods = _completed(np.where(witnesses >= WITNESSES, periods, np.nan), steps, rates, ratios)
        periods[0] = nominal_period
    else:
        periods = np.full(len(steps), nominal_period)
    off = np.abs(_medians(steps / periods[:, np.newaxis], rates) - rates)
    return RecoveredTiming(periods, yaw, witnesses, off[:, :3].max(axis=1), off[:, 3:].max(axis=1))


def _mostly_witnessed(witnesses: NDArray[np.int64]) -> bool:
    return bool(2 * np.count_nonzero(witnesses >= WITNESSES) >= len(witnesses) - 1)


def _turned_back(values: Array, yaw: float) -> Array:
    """Rows (T, 6) whose first two columns are x and y, turned by -yaw."""
    cosine, sine = np.cos(yaw), np.sin(yaw)
    x, y = values[:, 0], values[:, 1]
    return np.concatenate([np.stack([cosine * x + sine * y, cosine * y - sine * x], axis=1), values[:, 2:]], axis=1)


def _ratios(steps: Array, rates: Array, rounding: Array, nominal_period: float) -> tuple[Array, Array]:
    """What each median would make of the period, and how exactly.

    Args:
        steps: (T, C).
        rates: (T, C).
        rounding: (C,) of the steps.
        nominal_period: [s].

    Returns:
        (T, 3, C) periods [s] by the medians of the frame before, itself and the next, nan where impossible; (T, 3, C) relative
        slack.
    """
    none = np.full((1, rates.shape[1]), np.nan)
    around = np.stack([np.concatenate([none, rates[:-1]]), rates, np.concatenate([rates[1:], none])], axis=1)  # (T, 3, C)
    ahead = np.broadcast_to(steps[:, np.newaxis], around.shape)
    moving = (ahead != 0.0) & (around != 0.0)
    periods = np.divide(ahead, around, out=np.full(around.shape, np.nan), where=moving)
    slack = np.divide(rounding, np.abs(ahead), out=np.full(around.shape, np.inf), where=moving) + ROUNDING
    sound = (np.abs(periods / nominal_period - 1.0) < JITTER) & (slack < COARSEST)
    return np.where(sound, periods, np.nan), slack


def _witnessed(ratios: Array, slack: Array) -> tuple[Array, NDArray[np.int64]]:
    """The period of each frame (T,) with the most witnesses, and their number (T,): channels that agree, and the resolution.

    Where two periods have enough of them, the number is 0.
    """
    frames = len(ratios)
    multiples = np.round(ratios / RESOLUTION) * RESOLUTION
    resolved = (slack < RESOLVED) & (np.abs(ratios - multiples) <= slack * ratios)
    periods = np.where(resolved, multiples, ratios).reshape(frames, -1)  # (T, 3C)
    slack = np.where(resolved, ROUNDING, slack)
    apart = np.abs(periods[:, :, np.newaxis, np.newaxis] - periods.reshape(ratios.shape)[:, np.newaxis])  # (T, 3C, 3, C)
    flat_slack = slack.reshape(frames, -1)
    agree = apart <= (flat_slack[:, :, np.newaxis, np.newaxis] + slack[:, np.newaxis]) * periods[:, :, np.newaxis, np.newaxis]
    witnesses = agree.any(axis=2).sum(axis=2) + resolved.reshape(frames, -1)  # (T, 3C)
    best = np.argmax(witnesses - 0.5 * np.minimum(flat_slack / COARSEST, 1.0), axis=1)  # of equals the most exact
    rows = np.arange(frames)
    others = ~agree[rows, best].reshape(frames, -1)
    contradicted = (others & (witnesses >= WITNESSES)).any(axis=1)
    return periods[rows, best], np.where(contradicted, 0, witnesses[rows, best]).astype(np.int64)


def _yaw(steps: Array, rates: Array, periods: Array) -> float:
    """The direction of the board's axes, up to quarter turns, in [0, pi/2); 0 where nothing determines it.

    Args:
        steps: (T, 2) horizontal.
        rates: (T, 2).
        periods: (T,) nan where unknown.
    """
    raw = steps / periods[:, np.newaxis]
    off = np.concatenate([rates - raw, rates[:-1] - raw[1:], rates[1:] - raw[:-1]])  # the medians of a frame and its neighbours
    lengths = np.hypot(off[:, 0], off[:, 1])
    known = lengths > 1e-6 * np.abs(rates).max()  # not rounding, and not unknown
    if not known.any():
        return 0.0
    off, lengths = off[known], lengths[known]
    angles = np.arctan2(off[:, 1], off[:, 0])
    ordered = np.sort(np.mod(angles, 0.5 * np.pi))
    agreeing = np.searchsorted(ordered, ordered + SAME_DIRECTION, side="right") - np.arange(len(angles))
    most = ordered[np.argmax(agreeing)]
    quarters = np.round((angles - most) / (0.5 * np.pi))
    beyond = angles - most - 0.5 * np.pi * quarters
    cluster = np.abs(beyond) <= SAME_DIRECTION
    along_y = np.count_nonzero(quarters[cluster] % 2)
    if min(along_y, np.count_nonzero(cluster) - along_y) < WITNESSES:
        return 0.0  # a body that moves straight on shows its own direction
    return float(np.mod(most + np.average(beyond[cluster], weights=lengths[cluster] ** 2), 0.5 * np.pi))


def _completed(periods: Array, steps: Array, rates: Array, ratios: Array) -> Array:
    """Periods (T,) with those that are nan chosen so that the medians are the stored rates, as nearly as can be.

    A rate starts or ceases to fit only at the ratios: these, and one period between each two, are all there is to try.
    """
    typical = float(np.nanmedian(periods))
    open_steps = np.flatnonzero(np.isnan(periods[1:])) + 1
    completed = np.where(np.isnan(periods), typical, periods)
    scale = np.repeat([np.sqrt((rates[:, :3] ** 2).mean()), np.sqrt((rates[:, 3:] ** 2).mean())], 3)
    for _ in range(SWEEPS):
        before = completed.copy()
        for step in open_steps:
            options = _options(ratios[step], typical)
            tried = np.repeat(completed[np.newaxis], len(options), axis=0)  # (N, T)
            tried[:, step] = options
            misfit = (np.abs(_medians(steps / tried[:, :, np.newaxis], rates) - rates) / scale).sum(axis=(1, 2))
            completed[step] = options[int(np.argmax(misfit <= misfit.min() + SAME_RATE))]
        if (completed == before).all():
            break
    return completed


def _options(ratios: Array, typical: float) -> Array:
    """Periods to be tried, those next to the typical one first."""
    bounds = np.array([(1.0 - JITTER) * typical, (1.0 + JITTER) * typical])
    edges = np.sort(np.concatenate([ratios[np.isfinite(ratios)], bounds]))
    options = np.concatenate([[typical], edges, 0.5 * (edges[1:] + edges[:-1])])
    return options[np.argsort(np.abs(options - typical), kind="stable")]


def _medians(raw: Array, rates: Array) -> Array:
    """Medians of three of raw rates (..., T, C), the first unknown; at the ends, what comes nearest to `rates` (T, C)."""
    result = np.broadcast_to(rates, raw.shape).copy()
    low, high = np.minimum(raw[..., 1:-1, :], raw[..., 2:, :]), np.maximum(raw[..., 1:-1, :], raw[..., 2:, :])
    result[..., 2:-1, :] = np.maximum(low[..., :-1, :], np.minimum(high[..., :-1, :], raw[..., 3:, :]))
    for end in (0, -1):
        frame = 1 if end == 0 else -1
        result[..., frame, :] = np.clip(rates[frame], low[..., end, :], high[..., end, :])
    return result


SHORTEST = 3
"""Frames: shorter tosses hold no median of known steps only."""

QUARTER = 0.5 * np.pi


@dataclass(frozen=True, eq=False)
class RestoredToss:
    """What a file's toss was before it was turned and lost its stamps.

    Attributes:
        toss: T frames; the first stamp is zero, and all are rounded to nanoseconds, which moves a velocity by up to 1.5e-7 of
            itself. `frame_period` stays nominal.
        yaw: the file's toss is this one turned by it about the vertical [rad].
        timing: how it was found; None of a toss too short for it, which is left as it was.
    """

    toss: Toss
    yaw: float = 0.0
    timing: RecoveredTiming | None = None

    @property
    def timed_steps(self) -> int:
        """How many periods are certain."""
        return 0 if self.timing is None else int(np.count_nonzero(self.timing.anchored))


def restored(toss: Toss) -> RestoredToss:
    """The toss with its own stamps on the tracker's board; as it was where its velocities were not made as the public ones."""
    if toss.frames < SHORTEST:
        return RestoredToss(toss)
    timing = recover_timing(
        toss.positions, toss.orientations_wxyz, toss.linear_velocities, toss.angular_velocities, toss.frame_period
    )
    if not timing.found:
        return RestoredToss(toss, timing=timing)
    seconds = np.concatenate([[0.0], np.cumsum(timing.periods[1:])])
    heading = float(np.arctan2(toss.linear_velocities[0, 1], toss.linear_velocities[0, 0]))
    yaw = timing.yaw + QUARTER * round((heading - timing.yaw) / QUARTER)
    back = quaternions.exp(np.array([0.0, 0.0, -yaw]))
    turned = replace(
        toss,
        stamps_ns=np.round(seconds * NANOSECONDS).astype(np.int64),
        positions=quaternions.rotate(back, toss.positions),
        orientations_wxyz=quaternions.multiply(back, toss.orientations_wxyz),
        linear_velocities=quaternions.rotate(back, toss.linear_velocities),
    )
    return RestoredToss(turned, yaw, timing)
