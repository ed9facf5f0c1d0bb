"""Successive poses as arrays, and the parabolas that fit them best.

    p(t) = p0 + v t + a t^2 / 2        by least squares over windows of SPAN, each axis for itself

Nothing is assumed of units, axes or the height of the board: a fall in millimetres, or along y, is a parabola, too.
"""

import hashlib
from dataclasses import dataclass
from functools import cached_property
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from contact_curation.geometry.quaternions import Array
from contact_curation.motion.toss import NANOSECONDS, Rejected, Toss

SPAN = 0.055
"""Length of a window [s]: free flights of thrown bodies last 0.1 s or longer."""

FEWEST = 6
"""Frames of a window."""

THIRD_DIFFERENCE = 0.6745 * sqrt(20.0)
"""Median size of third differences of noise, in its standard deviations."""

UNEVEN, MOSTLY, FEWEST_PAIRS = 0.1, 0.7, 20
"""Of two cameras: share by which steps differ from even ones; share of the pairs of steps that are alike; pairs, at least."""

SAME_CAMERA = 0.75
"""Of a pair of steps: a pose that comes sooner is the other camera's."""

WIDEST_STEP = 1.5
"""Median steps: a window has none that is longer."""


@dataclass(frozen=True, eq=False)
class PoseSeries:
    """T poses of one body in one frame.

    Attributes:
        stamps_ns: (T,) strictly increasing.
        positions: (T, 3) in whatever unit they came.
        orientations_wxyz: (T, 4).
    """

    stamps_ns: NDArray[np.int64]
    positions: Array
    orientations_wxyz: Array

    @cached_property
    def times(self) -> Array:
        """(T,) from the first on [s]."""
        return np.asarray((self.stamps_ns - self.stamps_ns[:1]) / NANOSECONDS)

    @cached_property
    def steps(self) -> Array:
        """(T - 1,) [s]."""
        return np.diff(self.times)

    @cached_property
    def period(self) -> float:
        """Median step [s]; NaN where there is none."""
        return float(np.median(self.steps)) if self.steps.size else float("nan")

    @cached_property
    def pair_period(self) -> float:
        """[s] In which two cameras that see by turns, after uneven steps, have each given a pose; 0 where steps are alike."""
        pairs = self.times[2:] - self.times[:-2]
        if len(pairs) < FEWEST_PAIRS:
            return 0.0
        usual = float(np.median(pairs))
        regular = float(np.mean(np.abs(pairs - usual) < UNEVEN * usual)) > MOSTLY
        uneven = float(np.median(np.abs(self.steps - 0.5 * usual)))
        again = float(np.median(np.abs(self.steps[2:] - self.steps[:-2])))  # after two steps; jitter does not come again
        return usual if regular and uneven > max(UNEVEN * 0.5 * usual, 2.0 * again) else 0.0

    def of_one_camera(self) -> "PoseSeries":
        """Without the poses of the second camera, where two see by turns; else the same."""
        if not self.pair_period:
            return self
        kept, last = [0], 0.0
        for at, time in enumerate(self.times.tolist()):
            if time >= last + SAME_CAMERA * self.pair_period:
                kept.append(at)
                last = time
        return PoseSeries(self.stamps_ns[kept], self.positions[kept], self.orientations_wxyz[kept])

    def period_of(self, first: int, stop: int) -> float:
        """Mean step of the frames `first` to `stop` [s]: the rate of a recording may vary."""
        return float(self.times[stop - 1] - self.times[first]) / (stop - 1 - first)

    def __len__(self) -> int:
        return len(self.stamps_ns)

    def digest(self) -> bytes:
        """Of stamps and poses: equal series have equal digests."""
        state = hashlib.sha256()
        for part in (self.stamps_ns, self.positions, self.orientations_wxyz):
            state.update(np.ascontiguousarray(part).tobytes())
        return state.digest()


@dataclass(frozen=True, eq=False)
class LocalFits:
    """The W parabolas of a series.

    Attributes:
        frames: of each window.
        first: (W,) index of its first frame.
        accelerations: (W, 3).
        velocities: (W, 3) amid the window.
        residuals: (W,) root mean square over frames and axes.
    """

    frames: int
    first: NDArray[np.int64]
    accelerations: Array
    velocities: Array
    residuals: Array

    def noises(self, period: float) -> tuple[float, float]:
        """Standard deviations of velocities and accelerations per axis, for positions with one of 1."""
        frames = self.frames
        return sqrt(12.0 / frames**3) / period, sqrt(720.0 / frames**5) / period**2


def series_of(outcome: Toss | Rejected) -> PoseSeries:
    """The poses of a motion that was cut already."""
    toss = outcome.toss if isinstance(outcome, Rejected) else outcome
    return PoseSeries(toss.stamps_ns, toss.positions, toss.orientations_wxyz)


def local_fits(series: PoseSeries) -> LocalFits:
    """A parabola at every frame that has a window of successive frames behind it; stamps count as even within its own."""
    frames = max(FEWEST, round(SPAN / series.period) + 1) if len(series) > FEWEST else FEWEST
    count = len(series) - frames + 1
    if count < 1:
        return LocalFits(frames, np.zeros(0, dtype=np.int64), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
    centred = series.positions - np.median(series.positions, axis=0)
    time = np.arange(frames) - 0.5 * (frames - 1)
    basis = [np.ones(frames), time, time**2 - np.mean(time**2)]  # orthogonal over even frames
    flat, slope, bend = (_sums(centred, term) / (term @ term) for term in basis)  # (W, 3) each
    squares = _sums(centred**2, np.ones(frames))
    left = squares - sum(part**2 * (term @ term) for part, term in zip((flat, slope, bend), basis, strict=True))
    residuals = np.sqrt(np.maximum(left, 0.0).sum(axis=1) / (3 * frames))
    apart = np.concatenate([[0], np.cumsum(series.steps > WIDEST_STEP * series.period)])
    whole = np.flatnonzero(apart[frames - 1 :] == apart[:count])
    period = ((series.times[whole + frames - 1] - series.times[whole]) / (frames - 1))[:, np.newaxis]
    return LocalFits(frames, whole, 2.0 * bend[whole] / period**2, slope[whole] / period, residuals[whole])


def noise_of(series: PoseSeries) -> float:
    """Standard deviation of a position per axis from frame to frame, by third differences other than 0; 0 if unknown."""
    return _noise(series, series.positions)


def turn_noise_of(series: PoseSeries) -> float:
    """The same of an orientation, about each axis [rad]; in whatever order its numbers are."""
    turns = series.orientations_wxyz
    flips = np.where((turns[1:] * turns[:-1]).sum(axis=1) < 0.0, -1.0, 1.0)  # q and -q are one rotation
    return 2.0 * _noise(series, turns * np.cumprod(np.append(1.0, flips))[: len(turns), np.newaxis])


def _noise(series: PoseSeries, rows: Array) -> float:
    if len(series) < 8:
        return 0.0
    even = np.abs(series.steps - series.period) < 0.2 * series.period
    bent = np.abs(np.diff(rows, n=3, axis=0))[even[2:] & even[1:-1] & even[:-2]]
    bent = bent[bent > 0.0]
    return float(np.median(bent)) / THIRD_DIFFERENCE if bent.size else 0.0


def _sums(values: Array, weights: Array) -> Array:
    """(W, 3) sums over windows of rows (T, 3), weighted."""
    return np.stack([np.correlate(column, weights, mode="valid") for column in values.T], axis=1)
