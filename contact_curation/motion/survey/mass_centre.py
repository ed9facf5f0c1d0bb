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
from contact_curation.motion.survey.rig import Estimate
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

NORMAL_95 = 1.96
"""Standard errors of a 95 % interval, on either side."""

UNKNOWNS = 6
"""The acceleration and the place."""

CERTAIN = 16.3
"""The 99.9 % quantile of chi-squared with 3 degrees of freedom: a smaller squared deviation from 0 may be chance."""


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
        sizes, axes = np.linalg.eigh(self.covariance)
        unseen = np.square(axes[:, sizes <= SEEN * sizes.max()]).sum(axis=1) > 0.5
        half = np.where(unseen, np.inf, NORMAL_95 * np.sqrt(np.diag(self.covariance)))
        first, second, third = (Estimate(*map(float, one)) for one in zip(self.place, self.place - half, self.place + half))
        return first, second, third

    def seen_from_described(self, rig: RigCalibration) -> "MassCentre":
        """The same from where a body's centre of mass is described, along its described axes [m].

        Args:
            rig: what corrects the poses.
        """
        turn = quaternions.to_matrix(quaternions.exp(np.array(rig.marker_turn))) * rig.scale
        return self._replace(place=turn @ self.place - rig.marker_offset, covariance=turn @ self.covariance @ turn.T)

    @property
    def distance(self) -> float:
        """From the origin of the poses."""
        return float(np.linalg.norm(self.place))

    @property
    def is_elsewhere(self) -> bool:
        """Whether it is certainly not at the origin of the poses."""
        return float(self.place @ np.linalg.pinv(self.covariance, rcond=SEEN, hermitian=True) @ self.place) > CERTAIN


class _Equations(NamedTuple):
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
    found = _least_squares(equations)
    if found is None:
        return None
    values, covariance, flights_used = found
    return MassCentre(flights_used, values[3:], covariance[3:, 3:], values[:3])


def _least_squares(equations: Sequence[_Equations]) -> tuple[Array, Array, int] | None:
    """The six unknowns, their covariance and how many flights were used; None where these do not determine them."""
    used = equations
    for _ in range(ROUNDS):
        normal = sum((one.unknowns.T @ one.unknowns for one in used), np.zeros((UNKNOWNS, UNKNOWNS)))
        if len(used) < FEWEST_FLIGHTS:
            return None
        inverse = np.linalg.pinv(normal, rcond=SEEN, hermitian=True)
        values = inverse @ sum((one.unknowns.T @ one.seen for one in used), np.zeros(UNKNOWNS))
        residuals = np.array([one.residual(values) for one in equations])
        near = residuals <= OUTLYING * float(np.median(residuals))
        before, used = used, [one for one, is_near in zip(equations, near, strict=True) if is_near]
    pulls = np.array([one.unknowns.T @ (one.seen - one.unknowns @ values) for one in before])
    count = len(before)
    covariance = inverse @ (pulls.T @ pulls) @ inverse * count / max(count - UNKNOWNS, 1)
    return values, covariance, count


def _equations(series: PoseSeries, flight: Flight) -> _Equations | None:
    frames = slice(flight.first + 1, flight.stop - 1)
    times = series.times[frames]
    if len(times) < FEWEST_FRAMES:
        return None
    times = times - times.mean()
    turns = series.orientations_wxyz[frames]
    axes = np.stack([quaternions.rotate(turns, np.broadcast_to(axis, (len(turns), 3))) for axis in np.eye(3)], axis=2)
    falls = 0.5 * (times**2)[:, None, None] * np.eye(3)
    own = np.linalg.qr(np.stack([np.ones(len(times)), times], axis=1))[0]  # (n, 2) of the flight's own c and v
    unknowns = np.concatenate([falls, -axes], axis=2)  # (n, 3, 6)
    unknowns = unknowns - np.einsum("ni,mi,mab->nab", own, own, unknowns)
    seen = series.positions[frames] - own @ (own.T @ series.positions[frames])
    return _Equations(unknowns.reshape(-1, 6), seen.reshape(-1))
