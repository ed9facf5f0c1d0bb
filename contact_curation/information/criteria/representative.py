"""representative: the set whose parameter estimate is nearest to the estimate from the whole pool.

Selected is the set of which `expected_error` is small: what the pool's loss is expected to be above its lowest at what the set
teaches. Where theta is far off the scores are as good as noise and the set is chosen for what it knows (A-optimality); near the
optimum they are known, and the set is chosen so that they cancel as the pool's do.

Why not for what it knows alone: how much a toss knows goes with how it came out. A toss in which the body happened to slide
easily lasts longer and knows more, so that the most informative tosses, and the longest ones, agree on too low a friction
(docs/rule.md). Here they are balanced by tosses that pull the other way.

The set is built greedily and then improved by exchanges of one toss for another, until none helps or two rounds are over. There
is no guarantee: the sum is not submodular. At last its tosses are put in the order in which greedy picks would take them.

In each step the tosses are looked at from the lowest bound up, until no bound reaches down to the best value found: the result
is that of looking at all of them. Of a pool of more than `LARGEST_WHOLE` tosses a step looks at every n-th toss only, each step
at others (Mirzasoleiman et al., "Lazier than lazy greedy", 2015): its cost does not grow with the pool. Greedy picks, for which
bounds are of little use, look at fewer tosses then, and there are more exchanges. An exchange never makes the set worse.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.information.criteria.criterion import Criterion, Explanation, Need, RankingConfig, register
from contact_curation.information.criteria.expected_error import ExpectedError, Sums
from contact_curation.information.pool import CHUNK, Indices, Pool
from contact_curation.information.ranking import Selection, greedy_selection
from contact_curation.information.subspace import pool_subspace
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


@dataclass(frozen=True, eq=False)
class SwapCosts:
    """The expected error of a selected set with one toss more or less, averaged over the particles (`expected_error`).

    Attributes:
        error: of the set.
        without: (k,) of the set without each of its tosses.
        joined: (K,) of the set with each toss of the pool added; of the selected ones the set's.
    """

    error: float
    without: Array
    joined: Array


def select_representative(
    pools: Sequence[Pool], coordinates: Sequence[Array], top: int, prior: float, largest_whole: int = LARGEST_WHOLE
) -> Selection:
    """The set of up to `top` tosses; what a toss gains is by how much it lowers the expected error.

    Args:
        pools: the same tosses, once per parameter particle; errors are averaged over them.
        coordinates: per particle (P, p) in which the pool's mean toss is the identity.
        top: how many tosses to select.
        prior: delta > 0: A0 is this share of the mean toss.
        largest_whole: tosses up to which each step looks at all.
    """
    errors = _Errors.of(pools, coordinates, prior)
    looks = _Looks(errors.tosses, top, largest_whole)
    picks = _in_order(errors, _exchanged(errors, _greedy(errors, min(top, errors.tosses), looks), looks))
    states = list(accumulate(picks, errors.with_toss, initial=errors.sums([])))
    values = [errors.value(state) for state in states]
    singles = values[0] - errors.all_joined(states[0])
    final = values[-1] - errors.all_joined(states[-1])
    return greedy_selection(np.array(picks), -np.diff(values), singles, final)


def swap_costs(pools: Sequence[Pool], coordinates: Sequence[Array], selected: Sequence[int], prior: float) -> SwapCosts:
    """Of k >= 1 tosses of a pool; the other arguments as in `select_representative`."""
    errors = _Errors.of(pools, coordinates, prior)
    sums = errors.sums(selected)
    error, joined = errors.value(sums), errors.all_joined(sums)
    joined[list(selected)] = error
    without = [errors.value(errors.sums([*selected[:place], *selected[place + 1 :]])) for place in range(len(selected))]
    return SwapCosts(error, np.array(without), joined)


@dataclass(frozen=True)
class _Looks:
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


def _greedy(errors: "_Errors", count: int, looks: _Looks) -> list[int]:
    """Each the best beside those before."""
    picks: list[int] = []
    sums = errors.sums([])
    while len(picks) < count:
        picks.append(errors.best(sums, np.setdiff1d(looks.at(len(picks), FIRST_PICKS), picks)))
        sums = errors.with_toss(sums, picks[-1])
    return picks


def _exchanged(errors: "_Errors", picks: list[int], looks: _Looks) -> list[int]:
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


def _in_order(errors: "_Errors", selected: Sequence[int]) -> list[int]:
    """The same tosses, each the best of those left beside those before; ties go to the smaller id."""
    left, picks, sums = sorted(selected), list[int](), errors.sums([])
    while left:
        picks.append(left.pop(first_of_the_best(-errors.joined(sums, np.array(left)))))
        sums = errors.with_toss(sums, picks[-1])
    return picks


@dataclass(frozen=True, eq=False)
class _Errors:
    """The expected error under every particle; each value is the mean over them."""

    particles: tuple[ExpectedError, ...]

    @staticmethod
    def of(pools: Sequence[Pool], coordinates: Sequence[Array], prior: float) -> "_Errors":
        return _Errors(tuple(ExpectedError.of(pool, c, prior) for pool, c in zip(pools, coordinates, strict=True)))

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


def _select(pools: Sequence[Pool], config: RankingConfig) -> Selection:
    coordinates = [pool_subspace(pool, config.cut).per_mean_toss(len(pool)) for pool in pools]
    return select_representative(pools, coordinates, config.top, config.prior)


def _explain(pool: Pool, selected: Mapping[str, float], config: RankingConfig) -> Explanation:
    """What becomes of the expected error without a selected toss, and with another one more."""
    coordinates = pool_subspace(pool, config.cut).per_mean_toss(len(pool))
    costs = swap_costs([pool], [coordinates], pool.indices_of(selected).tolist(), config.prior)
    before = costs.error or 1.0  # 0 of a pool whose information is zero, with or without a toss
    joined = dict(zip(pool.ids, costs.joined.tolist(), strict=True))
    reasons = {one: f"not selected: expected error × {_factor(error / before)} with it" for one, error in joined.items()}
    for one, error in zip(selected, costs.without.tolist(), strict=True):
        reasons[one] = f"selected: expected error × {_factor(error / before)} without it"
    return Explanation({one: costs.error - error for one, error in joined.items()}, reasons)


REPRESENTATIVE = register(
    Criterion(
        "representative",
        "fall of the expected error by the toss alone",
        "variance of the scores",
        _select,
        needs=frozenset({Need.THETA, Need.SUBSPACE, Need.PRIOR}),
        explain=_explain,
    )
)


def _factor(value: float) -> str:
    """Three digits, or all of a larger number."""
    return f"{value:.3g}" if value < 999.5 else f"{value:.0f}"
