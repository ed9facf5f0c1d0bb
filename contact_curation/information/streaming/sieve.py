"""Log-det selection from a stream with a guarantee: Sieve-Streaming (METHOD 2.5; Badanidiyuru et al. 2014).

The best set's value OPT lies between the largest single value m and k m. For a guess v of it, a sieve takes a toss that gains
at least (v / 2 - f(S_v)) / (k - |S_v|). Guesses are the powers (1 + eps)^i from m to 2 k m: one of them is within 1 + eps of
OPT, and its sieve reaches (1/2 - eps) OPT. m is the largest seen so far; when it grows, sieves of too small guesses go and
sieves of larger ones start empty, which loses nothing, since no earlier toss was worth as much as they ask for.

The best set found so far is kept even when its sieve goes, so its value never falls. Memory: the sieves' sets, O(k log(k) /
eps) tosses. The prior must be known up front: the guarantee is for one function f.
"""

import math
from dataclasses import dataclass

import numpy as np

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.accumulated import Accumulated, gains_of_rows
from contact_curation.information.prior import LogDetPrior
from contact_curation.information.record import TossInformation
from contact_curation.information.streaming.selector import NO_CHANGE, Change, Seen, checked_top, difference


@dataclass(frozen=True, eq=False)
class _Sieve:
    """A guess of the best value, and the tosses taken under it."""

    guess: float
    state: Accumulated
    members: tuple[TossInformation, ...] = ()
    value: float = 0.0

    def demand(self, top: int) -> float:
        """The least gain that it takes a toss for; infinite when it is full."""
        room = top - len(self.members)
        return (0.5 * self.guess - self.value) / room if room else np.inf

    def joined(self, info: TossInformation, rows: Array, gain: float) -> "_Sieve":
        return _Sieve(self.guess, self.state.joined(rows[None]), (*self.members, info), self.value + gain)


class SieveStreaming:
    """Keeps up to k tosses of a large log-det."""

    def __init__(self, prior: LogDetPrior, top: int, epsilon: float = 0.2) -> None:
        """Start with nothing kept.

        Args:
            prior: `log_det_prior` of an earlier pool, or `prior_of_matrix`.
            top: k.
            epsilon: how fine the guesses are, in (0, 0.5).

        Raises:
            InvalidValueError: `top` is below 1, or epsilon is out of its range.
        """
        if not 0.0 < epsilon < 0.5:
            raise InvalidValueError("epsilon", epsilon, "a number between 0 and 0.5")
        self._top = checked_top(top)
        self._epsilon = epsilon
        self._prior = prior
        self._nothing = Accumulated.prior_only(prior.coordinates)
        self._sieves: dict[int, _Sieve] = {}
        self._best = _Sieve(0.0, self._nothing)
        self._largest_single = 0.0
        self._seen = Seen()

    def offer(self, info: TossInformation) -> Change:
        """Look at one toss; say what changed.

        Raises:
            InvalidValueError: it was scored at another theta than the tosses before, or its parameters are not the prior's.
        """
        rows = self._prior.rows(info)
        if not self._seen.is_new(info):
            return NO_CHANGE
        single = float(self._nothing.gains(rows[None]).log_det[0])
        if single > self._largest_single:
            self._largest_single = single
            self._renew_sieves()
        before = self._best
        for power, gain in self._gains(rows, single).items():
            if gain >= self._sieves[power].demand(self._top):
                self._sieves[power] = self._sieves[power].joined(info, rows, gain)
                self._best = max(self._best, self._sieves[power], key=lambda sieve: sieve.value)
        return difference(before.members, self._best.members)

    @property
    def selected(self) -> tuple[TossInformation, ...]:
        """The tosses of the best set found so far, in the order in which they came."""
        return self._best.members

    @property
    def value(self) -> float:
        """Log-det of the selected set relative to the prior's; it never falls."""
        return self._best.value

    @property
    def seen(self) -> int:
        """How many different tosses were offered."""
        return len(self._seen)

    @property
    def stored(self) -> int:
        """How many different tosses are held in memory."""
        return len({info.toss_id for sieve in (*self._sieves.values(), self._best) for info in sieve.members})

    def _renew_sieves(self) -> None:
        """Have a sieve for every power of 1 + eps from m to 2 k m, and no others."""
        base = math.log1p(self._epsilon)
        first = math.ceil(math.log(self._largest_single) / base)
        last = math.floor(math.log(2.0 * self._top * self._largest_single) / base)
        self._sieves = {
            power: self._sieves.get(power) or _Sieve(math.exp(power * base), self._nothing) for power in range(first, last + 1)
        }

    def _gains(self, rows: Array, single: float) -> dict[int, float]:
        """What the toss would add to each sieve that may take it: to an empty one its single value, which no gain exceeds."""
        demands = {power: sieve.demand(self._top) for power, sieve in self._sieves.items()}
        willing = [power for power, demand in demands.items() if demand <= single]
        gains = dict.fromkeys(willing, single)
        filled = [power for power in willing if self._sieves[power].members]
        if filled:
            halves = np.stack([self._sieves[power].state.half_inverse for power in filled])  # (s, P, p)
            gains.update(zip(filled, gains_of_rows(rows @ halves).log_det.tolist()))
        return gains
