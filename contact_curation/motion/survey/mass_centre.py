"""Where a body's centre of mass is, by its free flights: the point that falls on a parabola while the body turns about it.

    p(t) = c + v t + a t^2 / 2 - R(t) d

p and R are the poses, d is the centre of mass seen from the origin of the poses, in the body's frame. c and v belong to a
flight, the acceleration a and d to all. It is linear in all of them: c and v are projected out of each flight, and a and d
are the least squares of the rest. Where the body turns about one axis alone, nothing is seen of d along it, which counts as 0.
The covariance is the sandwich over flights: the residuals within a flight need not be independent.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.calibration import RigCalibration
from contact_curation.motion.survey.falls import Flight, Survey
from contact_curation.motion.survey.rig import AT_ORIGIN, CONFIDENCE, Estimate
from contact_curation.motion.survey.series import PoseSeries

FEWEST_FLIGHTS = 8
"""From which anything is estimated."""

FEWEST_FRAMES = 8
"""Of a flight, without the first and the last, over which a contact may have begun or ended."""

OUTLYING = 4.0
"""Flights are left out whose residual is so many times the median one."""

ROUNDS = 3
"""Of leaving flights out."""

SEEN = 1e-9
"""Share of the largest eigenvalue: along smaller ones nothing is seen, as along the axis of a motion in a plane."""

UNKNOWNS = 6
"""Of a and d."""

CERTAIN = 0.999
"""Share of the squared deviations by chance that are smaller than one that is taken for certain."""


class MassCentre(NamedTuple):
    """The centre of mass.

    Attributes:
        flights: that were used.
        place: (3,) seen from the origin of the poses, in the body's frame [unit of the poses].
        covariance: (3, 3) of it.
        acceleration: (3,) of the centre of mass in free flight.
    """

    flights: int
    place: Array
    covariance: Array
    acceleration: Array

    @property
    def intervals(self) -> tuple[Estimate, Estimate, Estimate]:
        """The place with its 95 % intervals; infinite along an axis of which nothing is seen."""
        from scipy.special import stdtrit  # takes a quarter of a second to import

        sizes, axes = np.linalg.eigh(self.covariance)
        unseen = np.square(axes[:, sizes <= SEEN * sizes.max()]).sum(axis=1) > 0.5
        errors = float(stdtrit(max(self.flights - UNKNOWNS, 1), CONFIDENCE))
        half = np.where(unseen, np.inf, errors * np.sqrt(np.diag(self.covariance)))
        first, second, third = (Estimate(*map(float, one)) for one in zip(self.place, self.place - half, self.place + half))
        return first, second, third

    def seen_from_described(self, rig: RigCalibration, described: Array = AT_ORIGIN) -> "MassCentre":
        """The same from where a body's centre of mass is described, along its described axes [m].

        Args:
            rig: what corrects the poses.
            described: (3,) that place in the tracked frame, to which poses were moved as if their lengths were true [m].
        """
        turn = quaternions.to_matrix(quaternions.exp(np.array(rig.marker_turn))) * rig.scale
        place = turn @ (self.place + described - described / rig.scale) - rig.marker_offset
        return self._replace(place=place, covariance=turn @ self.covariance @ turn.T)

    @property
    def distance(self) -> float:
        """From the origin of the poses."""
        return float(np.linalg.norm(self.place))

    @property
    def is_elsewhere(self) -> bool:
        """Whether it is certainly not at the origin of the poses."""
        return certainly_off(self.place, self.covariance, 3, self.flights - UNKNOWNS)


def certainly_off(off: Array, covariance: Array, directions: int, freedom: int) -> bool:
    """Whether numbers are certainly not 0; by Hotelling's test, as of few flights it is hard to tell.

    Args:
        off: (n,) the numbers.
        covariance: (n, n) of them.
        directions: in which they may differ from 0, at most n.
        freedom: degrees of freedom of the covariance: flights less unknowns.
    """
    from scipy.special import fdtri  # takes a quarter of a second to import

    left = freedom - directions + 1
    if left < 1:
        return False
    squared = float(off @ np.linalg.pinv(covariance, rcond=SEEN, hermitian=True) @ off)
    return squared > directions * freedom / left * float(fdtri(directions, left, CERTAIN))


class Fall(NamedTuple):
    """Of a flight: what `unknowns` (n, 6), a and d, have to add up to (n,)."""

    unknowns: Array
    seen: Array

    def residual(self, found: Array) -> float:
        """Root mean square."""
        return float(np.sqrt(np.mean((self.seen - self.unknowns @ found) ** 2)))


def mass_centre(survey: Survey) -> MassCentre | None:
    """The centre of mass by the flights of a survey; None where they are too few, or the body does not turn in them."""
    flights = [flight for throw in survey.throws for flight in throw.flights]
    equations = [one for flight in flights if (one := _equations(survey.series[flight.series], flight)) is not None]
    if len(equations) < FEWEST_FLIGHTS:
        return None
    found = least_squares(equations, UNKNOWNS)
    if found is None:
        return None
    values, covariance, used = found
    return MassCentre(used, values[3:], covariance[3:, 3:], values[:3])


def least_squares(equations: Sequence[Fall], unknowns: int) -> tuple[Array, Array, int] | None:
    """Unknowns, their covariance and how many flights were used; None where these do not determine them."""
    used = equations
    for _ in range(ROUNDS):
        normal = sum((one.unknowns.T @ one.unknowns for one in used), np.zeros((unknowns, unknowns)))
        if len(used) < FEWEST_FLIGHTS:
            return None
        inverse = np.linalg.pinv(normal, rcond=SEEN, hermitian=True)
        values = inverse @ sum((one.unknowns.T @ one.seen for one in used), np.zeros(unknowns))
        residuals = residuals_of(equations, values)
        near = residuals <= OUTLYING * float(np.median(residuals))
        before, used = used, [one for one, is_near in zip(equations, near, strict=True) if is_near]
    pulls = np.array([one.unknowns.T @ (one.seen - one.unknowns @ values) for one in before])
    count = len(before)
    covariance = inverse @ (pulls.T @ pulls) @ inverse * count / max(count - unknowns, 1)
    return values, covariance, count


def residuals_of(equations: Sequence[Fall], values: Array) -> Array:
    """(n,) root mean squares of flights."""
    return np.array([one.residual(values) for one in equations])


def _equations(series: PoseSeries, flight: Flight) -> Fall | None:
    frames = slice(flight.first + 1, flight.stop - 1)
    return fall_of(series, frames) if frames.stop - frames.start >= FEWEST_FRAMES else None


def fall_of(series: PoseSeries, frames: slice, *, drag: bool = False) -> Fall:
    """The equations of some frames of a flight; with the drag of the air, relative to the speed squared, as a last unknown."""
    times = series.times[frames]
    times = times - times.mean()
    turns = series.orientations_wxyz[frames]
    axes = np.stack([quaternions.rotate(turns, np.broadcast_to(axis, (len(turns), 3))) for axis in np.eye(3)], axis=2)
    falls = 0.5 * (times**2)[:, None, None] * np.eye(3)
    slows = [_slowed(times, series.positions[frames])[:, :, None]] if drag else []
    own = np.linalg.qr(np.stack([np.ones(len(times)), times], axis=1))[0]  # (n, 2) of the flight's own c and v
    unknowns = np.concatenate([falls, -axes, *slows], axis=2)  # (n, 3, 6 or 7)
    unknowns = unknowns - np.einsum("ni,mi,mab->nab", own, own, unknowns)
    seen = series.positions[frames] - own @ (own.T @ series.positions[frames])
    return Fall(unknowns.reshape(-1, unknowns.shape[2]), seen.reshape(-1))


def _slowed(times: Array, positions: Array) -> Array:
    """(n, 3) what a drag of one per length moves a body, by the parabola of its positions."""
    terms = np.polynomial.polynomial.polyfit(times, positions, 2)
    speeds = terms[1] + 2.0 * times[:, np.newaxis] * terms[2]
    slower = -np.linalg.norm(speeds, axis=1, keepdims=True) * speeds
    steps = np.gradient(times)[:, np.newaxis]
    return np.cumsum(np.cumsum(slower * steps, axis=0) * steps, axis=0)
