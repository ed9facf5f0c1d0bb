"""Whether bodies move as rigid ones in the air: a rigid body has a point, its centre of mass, that falls on a parabola.

    p(t) + R(t) d = c + v t + a t^2 / 2 - k D(t)        D(t) = the double integral of |v| v over the flight

as in `mass_centre`, and with the drag of the air. Where links swing, or a body bends, no point d falls so. How far the best
point departs is measured against how much the same point scatters about a smooth curve, a polynomial of degree 5: this
contains the tracker's noise, that of orientations at a point far from the origin, and stamps that jitter.
"""

from typing import NamedTuple

import numpy as np

from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.survey.falls import Flight, Survey
from contact_curation.motion.survey.mass_centre import FEWEST_FLIGHTS, FEWEST_FRAMES, fall_of, least_squares, residuals_of
from contact_curation.motion.survey.series import PoseSeries

EDGES = 0.013
"""[s] At either end of a flight, in which a hand may have held the body, or a contact begun; two frames at least."""

SMOOTH = 5
"""Degree of the curve that the point scatters about."""


class Departure(NamedTuple):
    """How far the point of bodies that comes nearest to falling on a parabola departs from it.

    Attributes:
        flights: that were used.
        size: root mean square per axis, of the median flight [unit of the poses].
        scatter: likewise, of the same point about a smooth curve.
        times: `size` over `scatter`, or over the least that counts, median of the flights.
        slowed: likewise, what the drag of the air departs by, of |a| = k |v|^2 with k = 1 per unit of length [unit^2].
    """

    flights: int
    size: float
    scatter: float
    times: float
    slowed: float


def departure(survey: Survey, least: float) -> Departure | None:
    """Of the flights of a survey; None where they are too few.

    Args:
        survey: of one body.
        least: scatter that counts as one; simulated poses have none [unit of the poses].
    """
    spans = [(survey.series[one.series], one) for throw in survey.throws for one in throw.flights]
    parts = [(series, part) for series, flight in spans if (part := _inner(series, flight)) is not None]
    equations = [fall_of(series, part, drag=True) for series, part in parts]
    if len(equations) < FEWEST_FLIGHTS:
        return None
    found = least_squares(equations, 7)
    if found is None:
        return None
    values = found[0]
    sizes = residuals_of(equations, values)
    scatters = np.array([_scatter(series, part, values[3:6]) for series, part in parts])
    times = sizes / np.maximum(scatters, least)
    slowed = [np.sqrt(np.mean(one.unknowns[:, 6] ** 2)) for one in equations]
    return Departure(len(parts), *(float(np.median(each)) for each in (sizes, scatters, times, slowed)))


def _inner(series: PoseSeries, flight: Flight) -> slice | None:
    edge = max(2, round(EDGES / series.period))
    frames = slice(flight.first + edge, flight.stop - edge)
    return frames if frames.stop - frames.start >= FEWEST_FRAMES else None


def _scatter(series: PoseSeries, frames: slice, place: Array) -> float:
    """Of a point (3,) of the body about a smooth curve, standard deviation per axis."""
    turns = series.orientations_wxyz[frames]
    points = series.positions[frames] + quaternions.rotate(turns, np.broadcast_to(place, (len(turns), 3)))
    times = series.times[frames]
    powers = np.linalg.qr(np.polynomial.polynomial.polyvander((times - times.mean()) / np.ptp(times), SMOOTH))[0]
    left = points - powers @ (powers.T @ points)
    return float(np.sqrt(np.square(left).sum() / (3 * max(len(times) - SMOOTH - 1, 1))))
