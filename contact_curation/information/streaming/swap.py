"""Log-det selection from a stream with k places: swap the toss that is least missed for a better one (METHOD 2.5).

While there is room every toss is kept. Then a toss takes the place of the member j for which f(S - j + toss) is largest, if
that is more than f(S). The value never falls, and memory is the k members. Such exchanges (Fedorov 1972) come out near greedy
selection on real tosses, where a sieve is full too early; but only the sieve promises anything for every stream.
`GuardedSwap` runs both and gives the better set: the practice of the one with the guarantee of the other.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.information.accumulated import Accumulated, gains_of_rows
from contact_curation.information.criteria.ties import tie_floor
from contact_curation.information.prior import LogDetPrior
from contact_curation.information.record import TossInformation
from contact_curation.information.streaming.selector import NO_CHANGE, Change, Seen, checked_top, difference
from contact_curation.information.streaming.sieve import SieveStreaming


@dataclass(frozen=True, eq=False)
class _LeaveOneOut:
    """What is left of a kept set without each of its members.

    Attributes:
        values: (k,) f(S - j).
        half_inverses: (k, P, p) H of S - j, see `Accumulated`.
    """

    values: Array
    half_inverses: Array

    @staticmethod
    def of(factors: Sequence[Array], coordinates: Array) -> "_LeaveOneOut":
        rows = [factor @ coordinates for factor in factors]
        grams = np.stack([np.eye(coordinates.shape[1]), *(r.T @ r for r in rows), np.zeros((coordinates.shape[1],) * 2)])
        earlier = np.cumsum(grams, axis=0)[:-2]  # prior and members before j: sums, so that no digits cancel
        later = np.cumsum(grams[::-1], axis=0)[-3::-1]
        states = [Accumulated(coordinates, matrix) for matrix in earlier + later]
        return _LeaveOneOut(np.array([state.log_det for state in states]), np.stack([state.half_inverse for state in states]))


class SwapStreaming:
    """Keeps k tosses of a large log-det by exchanges."""

    def __init__(self, prior: LogDetPrior, top: int) -> None:
        """Start with nothing kept.

        Args:
            prior: `log_det_prior` of an earlier pool, or `prior_of_matrix`.
            top: k.

        Raises:
            InvalidValueError: `top` is below 1.
        """
        self._top = checked_top(top)
        self._prior = prior
        self._seen = Seen()
        self._members: tuple[TossInformation, ...] = ()
        self._value = 0.0
        self._without: _LeaveOneOut | None = None

    def offer(self, info: TossInformation) -> Change:
        """Look at one toss; say what changed.

        Raises:
            InvalidValueError: it was scored at another theta than the tosses before, or its parameters are not the prior's.
        """
        rows = self._prior.rows(info)
        if not self._seen.is_new(info):
            return NO_CHANGE
        staying = self._members if len(self._members) < self._top else self._best_exchange(rows)
        if staying is None:
            return NO_CHANGE
        before, self._members = self._members, (*staying, info)
        self._value = Accumulated.prior_only(self._prior.coordinates).joined(self._stacked()).log_det
        self._without = None
        return difference(before, self._members)

    @property
    def selected(self) -> tuple[TossInformation, ...]:
        """The tosses kept now, in the order in which they came."""
        return self._members

    @property
    def value(self) -> float:
        """Log-det of the selected set relative to the prior's; it never falls."""
        return self._value

    @property
    def seen(self) -> int:
        """How many different tosses were offered."""
        return len(self._seen)

    def _stacked(self) -> Array:
        """(1, rows of all members, P)."""
        return np.concatenate([self._prior.rows(member) for member in self._members])[None]

    def _best_exchange(self, rows: Array) -> tuple[TossInformation, ...] | None:
        """The members that stay when the toss takes the best place, or None when it is worth no place."""
        if self._without is None:
            self._without = _LeaveOneOut.of([self._prior.rows(member) for member in self._members], self._prior.coordinates)
        values = self._without.values + gains_of_rows(rows @ self._without.half_inverses).log_det  # (k,)
        leaving = int(values.argmax())
        if tie_floor(float(values[leaving])) <= self._value:
            return None
        return (*self._members[:leaving], *self._members[leaving + 1 :])


class GuardedSwap:
    """The better of a sieve and of exchanges, at every time: at least (1/2 - epsilon) of the best set's value."""

    def __init__(self, prior: LogDetPrior, top: int, epsilon: float = 0.2) -> None:
        """Start with nothing kept; arguments and errors as in `SieveStreaming`."""
        self._sieve = SieveStreaming(prior, top, epsilon)
        self._swap = SwapStreaming(prior, top)

    def offer(self, info: TossInformation) -> Change:
        """Look at one toss; say what changed. Errors as in `SieveStreaming.offer`."""
        before = self.selected
        self._sieve.offer(info)
        self._swap.offer(info)
        return difference(before, self.selected)

    @property
    def selected(self) -> tuple[TossInformation, ...]:
        """The tosses of the better set, in the order in which they came."""
        return self._better.selected

    @property
    def value(self) -> float:
        """Log-det of the selected set relative to the prior's; it never falls."""
        return self._better.value

    @property
    def seen(self) -> int:
        """How many different tosses were offered."""
        return self._swap.seen

    @property
    def _better(self) -> SieveStreaming | SwapStreaming:
        return self._sieve if self._sieve.value > self._swap.value else self._swap
