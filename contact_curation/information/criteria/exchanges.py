"""Log-det selection from a stream with k places: swap the toss that is least missed for a better one (method.md 2.5).

While there is room every toss is selected. Then a toss takes the place of the member j for which f(S - j + toss) is largest, if
that is more than f(S). The value never falls, and memory is the k members. Such exchanges (Fedorov 1972) come out near greedy
selection on real tosses; nothing is proven of them for every stream.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.information.accumulated import Accumulated, gains_of_rows
from contact_curation.information.prior import LogDetPrior
from contact_curation.information.record import TossInformation
from contact_curation.information.streaming import Seen, checked_top
from contact_curation.information.ties import tie_floor


@dataclass(frozen=True, eq=False)
class _LeaveOneOut:
    """What is left of a selected set without each of its members.

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
    """Selects k tosses of a large log-det by exchanges."""

    def __init__(self, prior: LogDetPrior, top: int) -> None:
        """Start with nothing selected.

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

    def offer(self, info: TossInformation) -> None:
        """Look at one toss.

        Raises:
            InvalidValueError: it was scored at another theta than the tosses before, or its parameters are not the prior's.
        """
        rows = self._prior.rows(info)
        if not self._seen.is_new(info):
            return
        staying = self._members if len(self._members) < self._top else self._best_exchange(rows)
        if staying is None:
            return
        self._members = (*staying, info)
        self._value = Accumulated.prior_only(self._prior.coordinates).joined(self._stacked()).log_det
        self._without = None

    @property
    def selected(self) -> tuple[TossInformation, ...]:
        """The tosses selected now, in the order in which they came."""
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
