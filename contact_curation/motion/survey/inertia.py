"""The shape of a body's inertia, by its free flights: nothing turns it, so its angular momentum keeps still in the world.

    R(t) J w(t) = L         J = I / (tr I / 3), with a trace of 3: how large I is no flight says

R are the orientations of a flight and w the angular velocities in the body's frame, from a cubic in time through the rotation
vectors about the middle one. L belongs to a flight and is projected out; J is the least squares of the rest over all flights.
The covariance is the sandwich over flights, as of the centre of mass.
"""

from typing import NamedTuple

import numpy as np

from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.survey.falls import Flight, Survey
from contact_curation.motion.survey.mass_centre import certainly_off
from contact_curation.motion.survey.series import PoseSeries

FEWEST_FLIGHTS, FEWEST_FRAMES = 12, 12
"""Flights from which anything is estimated; frames of one, without the first and the last."""

FARTHEST = 2.5
"""[rad] A flight that turns further from its middle has no smooth rotation vectors."""

DEGREE = 3
"""Of the polynomial: the spin of a flight of 0.3 s at 10 rad/s bends little."""

OUTLYING, ROUNDS = 16.0, 3
"""Flights are left out whose mean square is so many times the median one; so often."""

SEEN = 1e-6
"""Share of the largest eigenvalue: smaller ones are those of motions that say nothing of some part."""

UNKNOWNS = 5
"""Of the six numbers, whose trace is given."""

PLACES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""Of the six numbers in the matrix."""


class InertiaShape(NamedTuple):
    """Moments and products of inertia relative to the mean moment.

    Attributes:
        flights: that were used.
        values: (6,) xx, yy, zz, xy, xz, yz; the first three add up to 3.
        covariance: (6, 6) of them.
    """

    flights: int
    values: Array
    covariance: Array

    @property
    def matrix(self) -> Array:
        """(3, 3) with a trace of 3."""
        made = np.zeros((3, 3))
        for (row, column), value in zip(PLACES, self.values, strict=True):
            made[row, column] = made[column, row] = value
        return made

    def turned(self, turn: Array) -> "InertiaShape":
        """The same in other axes of the body.

        Args:
            turn: (3, 3) from these axes to those.
        """
        units = [InertiaShape(0, unit, self.covariance).matrix for unit in np.eye(6)]
        change = np.array([[(turn @ unit @ turn.T)[place] for unit in units] for place in PLACES])
        return InertiaShape(self.flights, change @ self.values, change @ self.covariance @ change.T)

    def differs_from(self, inertia: Array) -> bool:
        """Whether the shape of an inertia (3, 3) is certainly another one."""
        return certainly_off(self.values - shape_of(inertia), self.covariance, UNKNOWNS, self.flights - UNKNOWNS)


def shape_of(inertia: Array) -> Array:
    """(6,) of an inertia (3, 3)."""
    return np.asarray(np.array([inertia[place] for place in PLACES]) * 3.0 / np.trace(inertia))


def inertia_shape(survey: Survey) -> InertiaShape | None:
    """The shape by the flights of a survey; None where they are too few, or do not turn so that they tell all of it."""
    flights = [flight for throw in survey.throws for flight in throw.flights]
    parts = [one for flight in flights if (one := _momenta(survey.series[flight.series], flight)) is not None]
    free = _without_trace()
    even = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    used = parts
    for _ in range(ROUNDS):
        if len(used) < FEWEST_FLIGHTS:
            return None
        normal = sum((part.T @ part for part in used), np.zeros((6, 6)))
        reduced = free.T @ normal @ free
        sizes = np.linalg.eigvalsh(reduced)
        if sizes[0] <= SEEN * sizes[-1]:  # both are zero where nothing turns
            return None
        inverse = np.linalg.inv(reduced)
        values = even - free @ (inverse @ (free.T @ (normal @ even)))
        squares = np.array([np.mean((part @ values) ** 2) for part in parts])
        near = squares <= OUTLYING * float(np.median(squares))
        before, used = used, [part for part, is_near in zip(parts, near, strict=True) if is_near]
    pulls = np.array([free.T @ (part.T @ (part @ values)) for part in before])
    spread = inverse @ (pulls.T @ pulls) @ inverse * len(before) / (len(before) - UNKNOWNS)
    return InertiaShape(len(before), values, free @ spread @ free.T)


def _without_trace() -> Array:
    """(6, 5) a basis of the six numbers that add nothing to the trace."""
    basis = np.zeros((6, 5))
    basis[:2, :2] = np.eye(2)
    basis[2, :2] = -1.0
    basis[3:, 2:] = np.eye(3)
    return basis


def _momenta(series: PoseSeries, flight: Flight) -> Array | None:
    """(3 n, 6) what the six numbers make of the angular momenta of a flight, less their mean; None where it says nothing."""
    frames = slice(flight.first + 1, flight.stop - 1)
    times, turns = series.times[frames], series.orientations_wxyz[frames]
    if len(times) < FEWEST_FRAMES:
        return None
    middle = np.broadcast_to(turns[len(turns) // 2], turns.shape)
    vectors = quaternions.log(quaternions.multiply(quaternions.conjugate(middle), turns))
    if quaternions.lengths(vectors).max() > FARTHEST:
        return None
    times = (times - times.mean()) / (times[-1] - times[0])
    powers = np.polynomial.polynomial.polyvander(times, DEGREE)
    terms = np.linalg.lstsq(powers, vectors, rcond=None)[0]
    slopes = np.stack([power * times ** max(power - 1, 0) for power in range(DEGREE + 1)], axis=1)
    vectors, rates = powers @ terms, slopes @ terms
    spins = _spins(vectors, rates)
    x, y, z = spins.T
    zero = np.zeros_like(x)
    products = np.stack([[x, zero, zero, y, z, zero], [zero, y, zero, x, zero, z], [zero, zero, z, zero, x, y]])  # (3, 6, n)
    matrices = quaternions.to_matrix(quaternions.multiply(middle, quaternions.exp(vectors)))
    momenta = np.einsum("nij,jkn->nik", matrices, products)
    return np.asarray((momenta - momenta.mean(axis=0)).reshape(-1, 6))


def _spins(vectors: Array, rates: Array) -> Array:
    """(n, 3) angular velocities in the body's frame, of rotation vectors and their derivatives."""
    angles = np.maximum(quaternions.lengths(vectors), 1e-6)[:, np.newaxis]
    first, second = (1.0 - np.cos(angles)) / angles**2, (angles - np.sin(angles)) / angles**3
    turned = np.cross(vectors, rates)
    return np.asarray(rates - first * turned + second * np.cross(vectors, turned))
