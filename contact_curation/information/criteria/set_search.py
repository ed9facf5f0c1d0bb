"""Sets of small expected error: how `representative` searches for them.

The set is built greedily and then improved by exchanges of one toss for another, until none helps or two rounds are over. There
is no guarantee: the sum is not submodular. At last its tosses are put in the order in which greedy picks would take them.

In each step the tosses are looked at from the lowest bound up, until no bound reaches down to the best value found: the result
is that of looking at all of them. Of a pool of more than `LARGEST_WHOLE` tosses a step looks at every n-th toss only, each step
at others (Mirzasoleiman et al., "Lazier than lazy greedy", 2015): its cost does not grow with the pool. Greedy picks, for which
bounds are of little use, look at fewer tosses then, and there are more exchanges. An exchange never makes the set worse.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.information.criteria.expected_error import ExpectedError, Sums
from contact_curation.information.pool import CHUNK, Indices, Pool
from contact_curation.information.ties import ABSOLUTE, first_of_the_best

EXCHANGES = 2
"""Rounds over the selected tosses, each of which may give way to a better one; twice as many in a pool seen in parts."""

LARGEST_WHOLE = 2048
"""Tosses up to which a step looks at all; of a larger pool an exchange looks at so many, or two for each selected toss."""

FIRST_PICKS = 4
"""Of a larger pool a greedy pick looks at this many times fewer."""

FIRST_BLOCK = 32
"""Tosses looked at closely at first in a step; twice as many at each further try."""

SLACK = 1e-6
"""Share of a value by which its bound may be too high from rounding, and more."""


@dataclass(frozen=True)
class Looks:
    """At which tosses of a pool each step looks.

    Attributes:
        tosses: K.
        top: how many are selected.
        largest_whole: K up to which it is all of them.
    """

    tosses: int
    top: int
    largest_whole: int

    @property
    def rounds(self) -> int:
        """Of exchanges."""
        return EXCHANGES if self.tosses <= self.largest_whole else 2 * EXCHANGES

    def at(self, step: int, fewer: int = 1) -> Indices:
        """All, or every n-th; of a larger pool so many times fewer."""
        if self.tosses <= self.largest_whole:
            return np.arange(self.tosses)
        apart = max(self.tosses // max(self.largest_whole // fewer, 2 * self.top), 1)
        return np.arange(step % apart, self.tosses, apart)


def greedy(errors: "MeanErrors", count: int, looks: Looks) -> list[int]:
    """Each the best beside those before."""
    picks: list[int] = []
    sums = errors.sums([])
    while len(picks) < count:
        picks.append(errors.best(sums, np.setdiff1d(looks.at(len(picks), FIRST_PICKS), picks)))
        sums = errors.with_toss(sums, picks[-1])
    return picks


def exchanged(errors: "MeanErrors", picks: list[int], looks: Looks) -> list[int]:
    """The set after exchanges of one toss for another; a round in which none helped is the last."""
    selected, unmoved = list(picks), 0
    if len(selected) == errors.tosses:
        return selected
    for step in range(looks.rounds * len(selected)):
        place = step % len(selected)
        others = selected[:place] + selected[place + 1 :]
        among = np.setdiff1d(np.union1d(looks.at(len(selected) + step), selected[place]), others)
        best = errors.best(errors.sums(others), among)
        unmoved = unmoved + 1 if best == selected[place] else 0
        selected[place] = best
        if unmoved == len(selected):
            break
    return selected


def in_order(errors: "MeanErrors", selected: Sequence[int]) -> list[int]:
    """The same tosses, each the best of those left beside those before; ties go to the smaller id."""
    left, picks, sums = sorted(selected), list[int](), errors.sums([])
    while left:
        picks.append(left.pop(first_of_the_best(-errors.joined(sums, np.array(left)))))
        sums = errors.with_toss(sums, picks[-1])
    return picks


@dataclass(frozen=True, eq=False)
class MeanErrors:
    """The expected error under every particle; each value is the mean over them."""

    particles: tuple[ExpectedError, ...]

    @staticmethod
    def of(pools: Sequence[Pool], coordinates: Sequence[Array], prior: float) -> "MeanErrors":
        return MeanErrors(tuple(ExpectedError.of(pool, c, prior) for pool, c in zip(pools, coordinates, strict=True)))

    @property
    def tosses(self) -> int:
        """K."""
        return len(self.particles[0].pool)

    def sums(self, selected: Sequence[int]) -> tuple[Sums, ...]:
        return tuple(particle.sums(selected) for particle in self.particles)

    def with_toss(self, sums: Sequence[Sums], index: int) -> tuple[Sums, ...]:
        return tuple(particle.with_toss(one, index) for particle, one in zip(self.particles, sums, strict=True))

    def value(self, sums: Sequence[Sums]) -> float:
        return float(np.mean([particle.value(one) for particle, one in zip(self.particles, sums, strict=True)]))

    def joined(self, sums: Sequence[Sums], indices: Indices) -> Array:
        return _mean([particle.joined(one, indices) for particle, one in zip(self.particles, sums, strict=True)])

    def all_joined(self, sums: Sequence[Sums]) -> Array:
        """(K,) with each toss added."""
        return np.concatenate([self.joined(sums, chunk) for chunk in self.particles[0].pool.chunks()])

    def best(self, sums: Sequence[Sums], among: Indices) -> int:
        """Which of some tosses, in ascending order, is best added; ties go to the smaller id."""
        bounds = _mean([particle.bounds(one, among) for particle, one in zip(self.particles, sums, strict=True)])
        values = np.full(len(among), np.inf)
        left, block = np.argsort(bounds, kind="stable"), FIRST_BLOCK
        while left.size and bounds[left[0]] <= float(values.min()) * (1.0 + SLACK) + ABSOLUTE:
            values[left[:block]] = self.joined(sums, among[left[:block]])
            left, block = left[block:], min(2 * block, CHUNK)
        return int(among[first_of_the_best(-values)])


def _mean(values: Sequence[Array]) -> Array:
    return np.asarray(np.mean(values, axis=0))
