"""Free falls in poses of unknown unit and axes, and the rests behind them.

A body in the air has one acceleration in every toss (survey/shared_acceleration.py): gravity in the unit and the axes of the
poses. Flights are runs of windows that have it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.survey.series import SPAN, LocalFits, PoseSeries, local_fits, noise_of, turn_noise_of
from contact_curation.motion.survey.shared_acceleration import (
    NEAR_SHARED,
    TOGETHER,
    falling,
    is_hidden,
    noise_scatter,
    shared_acceleration,
)

ALLOWED = 5.0
"""Times the noise: a frame that is further from its flight's parabola belongs to it no more."""

STAMPED = 0.8
"""Uneven stamps are right if a parabola over them leaves less than this share of what one over even frames leaves."""

BENT_TOWARDS = 2.0
"""Times `ALLOWED`: frames so far off may belong to a flight all the same, since its parabola bends towards them."""

LONGEST_FALL = 1.5
"""[s] Nothing that is thrown by hand or arm is longer in the air."""

LONGEST_SETTLING = 5.0
"""A rest begins at most so long after the last flight [s]."""

STILL = 0.003
"""A body is still that is slower than what gravity gives it in this time [s]."""

SCATTERED = 3.5
"""Standard deviations per axis that velocities and accelerations at rest seldom exceed."""

ROUNDS = 3
"""How often flights are looked for in much noise, each time by the mean acceleration of the flights before: those found first
have errors that are alike."""

STILL_WINDOWS = 4
"""In a row, for a rest."""

FEWEST_FLIGHTS = 4
"""For the noise."""

REST_FRAMES = 30
"""At most, over which a pose at rest is averaged."""

DWELL, TURNING = 0.25, np.radians(0.5)
"""[s, rad] A body at rest turns by less for so long, or by what noise makes of it; one that rocks stops at turning points."""


class Flight(NamedTuple):
    """A free flight: frames `first` to `stop` of a series."""

    series: int
    first: int
    stop: int


class Rest(NamedTuple):
    """Where a body lies after its last flight.

    Attributes:
        first: frame that the rest begins with.
        stop: the one after its last.
        position: (3,).
        orientation_wxyz: (4,).
    """

    first: int
    stop: int
    position: Array
    orientation_wxyz: Array


@dataclass(frozen=True, eq=False)
class Throw:
    """One throw.

    Attributes:
        flights: the first, and bounces; at least one.
        rest: None where it does not come to rest in sight.
        span: that part of its longest flight which is one parabola.
        acceleration: (3,) over it.
    """

    flights: tuple[Flight, ...]
    rest: Rest | None
    span: Flight
    acceleration: Array

    @property
    def frames(self) -> int:
        """Of the parabola."""
        return self.span.stop - self.span.first


@dataclass(frozen=True, eq=False)
class Survey:
    """What several series show.

    Attributes:
        series: the poses.
        noise: of positions, standard deviation per axis, in their unit.
        gravity: (3,) the shared acceleration, in the unit and axes of the poses; None where none is shared.
        throws: in the order of the series.
        largest_speed: amid any window, in units of the poses per second.
    """

    series: tuple[PoseSeries, ...]
    noise: float
    gravity: Array | None
    throws: tuple[Throw, ...]
    largest_speed: float

    @property
    def up(self) -> Array:
        """(3,) against gravity; z where there is none."""
        if self.gravity is None:
            return np.array([0.0, 0.0, 1.0])
        return -self.gravity / np.linalg.norm(self.gravity)


def survey(series: Sequence[PoseSeries]) -> Survey:
    """Looks through series of poses.

    Args:
        series: each of one body, in one frame for all.
    """
    series = tuple(series)
    fits = [local_fits(one) for one in series]
    noises = [noise for one in series if (noise := noise_of(one))]
    noise = float(np.median(noises)) if noises else 0.0
    speeds = [float(np.linalg.norm(fit.velocities, axis=1).max()) for fit in fits if len(fit.first)]
    shared = shared_acceleration(series, fits, noise)
    if shared is None:
        return Survey(series, noise, None, (), max(speeds, default=0.0))
    for _ in range(ROUNDS if is_hidden(shared, noise_scatter(series, fits, noise)) else 1):
        throws, shared = _found(series, fits, shared, noise)
    return Survey(series, min(noise, noise_in_the_air(series, throws) or noise), shared, throws, max(speeds, default=0.0))


def _found(
    series: Sequence[PoseSeries], fits: Sequence[LocalFits], shared: Array, noise: float
) -> tuple[tuple[Throw, ...], Array]:
    """Throws that fall with the shared acceleration, and (3,) the mean of theirs."""
    flights = [
        flight
        for place, fit in enumerate(fits)
        for flight in _joined(series[place], _flights(place, series[place], fit, shared, noise), shared, noise)
    ]
    throws = tuple(_throws(series, fits, flights, shared, noise))
    weights = np.array([throw.frames**5.0 for throw in throws])
    accelerations = np.array([throw.acceleration for throw in throws])
    return throws, _trimmed_mean(accelerations, weights) if len(throws) else shared


def noise_in_the_air(series: Sequence[PoseSeries], throws: Sequence[Throw]) -> float:
    """As `noise_of`, over flights alone, where no hand moves the body; 0 where they are too few."""
    noises = [noise for throw in throws if (noise := noise_of(_part(series[throw.span.series], throw.span)))]
    return float(np.median(noises)) if len(noises) >= FEWEST_FLIGHTS else 0.0


def _part(series: PoseSeries, span: Flight) -> PoseSeries:
    frames = slice(span.first, span.stop)
    return PoseSeries(series.stamps_ns[frames], series.positions[frames], series.orientations_wxyz[frames])


def _flights(place: int, series: PoseSeries, fit: LocalFits, shared: Array, noise: float) -> list[Flight]:
    """Runs of windows with the shared acceleration."""
    falls = fit.first[falling(series, fit, shared, noise)]
    if not len(falls):
        return []
    parts = np.split(falls, np.flatnonzero(np.diff(falls) > 2) + 1)
    return [Flight(place, int(part[0]), int(part[-1]) + fit.frames) for part in parts]


def _joined(series: PoseSeries, flights: Sequence[Flight], shared: Array, noise: float) -> list[Flight]:
    """Flights with those made one that are on one parabola: in noise, windows amid a fall may have another acceleration."""
    joined: list[Flight] = []
    for flight in flights:
        whole = Flight(flight.series, joined[-1].first, flight.stop) if joined else flight
        frames = np.arange(whole.stop - whole.first)
        if joined and len(frames) * series.period < LONGEST_FALL:
            places = series.positions[whole.first : whole.stop]
            terms = np.linalg.lstsq(_powers(frames), places, rcond=None)[0]
            near = np.linalg.norm(
                terms[2] / series.period_of(whole.first, whole.stop) ** 2 - shared
            ) < NEAR_SHARED * np.linalg.norm(shared)
            if near and np.abs(places - _powers(frames) @ terms).max() <= ALLOWED * noise:
                joined[-1] = whole
                continue
        joined.append(flight)
    return joined


def _throws(
    series: Sequence[PoseSeries], fits: Sequence[LocalFits], flights: Sequence[Flight], shared: Array, noise: float
) -> list[Throw]:
    groups: list[list[Flight]] = []
    for flight in flights:
        last = groups[-1][-1] if groups else None
        times = series[flight.series].times
        if last and last.series == flight.series and times[flight.first] - times[last.stop - 1] < TOGETHER:
            groups[-1].append(flight)
        else:
            groups.append([flight])
    throws, turn_noises = [], [turn_noise_of(one) for one in series]
    for group, after in zip(groups, [*groups[1:], None], strict=False):
        end = after[0].first if after and after[0].series == group[0].series else len(series[group[0].series])
        longest = max(group, key=lambda flight: flight.stop - flight.first)
        one = series[longest.series]
        span = _parabola(one, fits[longest.series], longest, noise)
        rest = _rest(one, fits[longest.series], group[-1].stop, end, shared, noise, turn_noises[longest.series])
        acceleration = acceleration_of(one.positions[span.first : span.stop], one.times[span.first : span.stop])
        throws.append(Throw(tuple(group), rest, span, acceleration))
    return throws


def acceleration_of(positions: Array, times: Array) -> Array:
    """(3,) of positions (n, 3) at times (n,) [s], by the parabola that fits them best.

    Stamps may be off where the frames were even, or right where they were not: what fits far better says which.
    """
    period = float(times[-1] - times[0]) / (len(times) - 1)
    even, stamped = (_fitted(positions, frames) for frames in (np.arange(len(times)), (times - times[0]) / period))
    return np.asarray((stamped if stamped[1] < STAMPED * even[1] else even)[0] / period**2)


def _fitted(positions: Array, frames: NDArray[Any]) -> tuple[Array, float]:
    """The last terms (3,) of a parabola through positions at frames (n,), and the norm of what it leaves."""
    terms = np.linalg.lstsq(_powers(frames), positions, rcond=None)[0]
    return terms[2], float(np.linalg.norm(positions - _powers(frames) @ terms))


def _parabola(series: PoseSeries, fit: LocalFits, flight: Flight, noise: float) -> Flight:
    """As many frames of a flight as one parabola fits; grown from the window that fits best.

    Frames at its ends in which a hand may have held the body, too little to be seen in the noise, are left out.
    """
    inside = _windows(fit, flight.first, flight.stop)
    start = int(fit.first[inside][np.argmin(fit.residuals[inside])])
    stop = start + fit.frames
    allowed = max(ALLOWED * noise, 1e-3 * SPAN**2 * float(np.linalg.norm(fit.accelerations[inside][0])))
    while True:
        terms = np.linalg.lstsq(_powers(np.arange(start, stop) - start), series.positions[start:stop], rcond=None)[0]
        ends = [(start - 1, -1), (stop, stop - start)]
        off = [
            float(np.abs(series.positions[at] - (_powers(np.array([when])) @ terms)[0]).max())
            if flight.first <= at < flight.stop
            else np.inf
            for at, when in ends
        ]
        if min(off) > allowed:
            length = float(np.linalg.norm(fit.accelerations[inside][0]))
            unseen = int(np.ceil(np.sqrt(2.0 * BENT_TOWARDS * allowed / length) / series.period))
            unseen = min(unseen, max(stop - start - fit.frames, 0) // 2)
            return Flight(flight.series, start + unseen, stop - unseen)
        start, stop = (start - 1, stop) if off[0] < off[1] else (start, stop + 1)


def _powers(frames: NDArray[Any]) -> Array:
    """(n, 3) of 1, k, k^2 / 2."""
    return np.stack([np.ones(len(frames)), frames, 0.5 * frames**2], axis=1)


def _rest(
    series: PoseSeries, fit: LocalFits, start: int, end: int, shared: Array, noise: float, turn_noise: float
) -> Rest | None:
    """The first rest between two frames."""
    length = float(np.linalg.norm(shared))
    slow, pulled = (SCATTERED * noise * one for one in fit.noises(series.period))
    latest = np.searchsorted(series.times, series.times[min(start, len(series) - 1)] + LONGEST_SETTLING)
    inside = _windows(fit, start, min(end, int(latest)))
    speeds, pulls = (np.linalg.norm(each[inside], axis=1) for each in (fit.velocities, fit.accelerations))
    places = fit.first[inside][(speeds < max(STILL * length, slow)) & (pulls < max(0.1 * length, pulled))]
    for part in np.split(places, np.flatnonzero(np.diff(places) > 1) + 1):
        at_the_end = len(part) > 0 and part[-1] + 1 not in fit.first  # recordings are cut as soon as the body is still
        for first in part if at_the_end else part[: 1 - STILL_WINDOWS]:
            stop = int(min(part[-1] + fit.frames, first + REST_FRAMES))
            seen_until = int(np.searchsorted(series.times, series.times[first] + DWELL))
            turns = series.orientations_wxyz[first : max(min(seen_until, end), stop)]
            turns = turns * np.where(turns @ turns[0] < 0.0, -1.0, 1.0)[:, np.newaxis]
            if _turned(turns) < max(TURNING, SCATTERED * turn_noise * np.sqrt(6.0 / len(turns))):
                position = np.median(series.positions[first:stop], axis=0)
                return Rest(int(first), stop, position, quaternions.normalized(turns[: stop - first].mean(axis=0)))
    return None


def _turned(turns: Array) -> float:
    """By how much the first, the middle and the last third of some orientations (n, 4) differ at most [rad]."""
    first, middle, last = (np.median(part, axis=0) for part in np.array_split(turns, 3))
    return 2.0 * max(float(np.linalg.norm(one - other)) for one, other in ((first, middle), (middle, last), (first, last)))


def _windows(fit: LocalFits, first: int, stop: int) -> slice:
    """Those between two frames."""
    low, high = np.searchsorted(fit.first, [first, stop - fit.frames + 1])
    return slice(int(low), max(int(high), int(low)))


def _trimmed_mean(values: Array, weights: Array) -> Array:
    """(3,) weighted mean of rows (K, 3) without those far from the median."""
    off = np.linalg.norm(values - np.median(values, axis=0), axis=1)
    near = off <= max(4.0 * float(np.median(off)), 1e-12)
    return np.asarray(weights[near] @ values[near] / weights[near].sum())
