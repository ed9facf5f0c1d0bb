"""representative: the set whose parameter estimate is nearest to the estimate from the whole pool.

The set minimises `expected_error`: by how much the pool's loss at the set's estimate is expected to exceed its minimum. Where
theta is far off, scores are as good as noise, and the set is selected for its information (A-optimality). Near the optimum they
are known, and the set is selected so that its scores cancel, as those of the pool do.

Information alone would be biased, because it depends on the outcome of a toss: one in which the body happened to slide easily
lasts longer and contains more information. So the most informative tosses, and the longest ones, underestimate friction
(docs/rule.md). Here they are balanced by tosses that move the estimate in the other direction.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.information.criteria.criterion import Criterion, Explanation, Need, RankingConfig, register
from contact_curation.information.criteria.representative_streaming import RepresentativeStreaming
from contact_curation.information.criteria.set_search import LARGEST_WHOLE, Looks, MeanErrors, exchanged, greedy, in_order
from contact_curation.information.pool import Pool, pool_centroid
from contact_curation.information.ranking import Selection, greedy_selection
from contact_curation.information.record import TossInformation
from contact_curation.information.subspace import pool_subspace


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
    errors = MeanErrors.of(pools, coordinates, prior)
    looks = Looks(errors.tosses, top, largest_whole)
    picks = in_order(errors, exchanged(errors, greedy(errors, min(top, errors.tosses), looks), looks))
    states = list(accumulate(picks, errors.with_toss, initial=errors.sums([])))
    values = [errors.value(state) for state in states]
    singles = values[0] - errors.all_joined(states[0])
    final = values[-1] - errors.all_joined(states[-1])
    return greedy_selection(np.array(picks), -np.diff(values), singles, final)


def swap_costs(pools: Sequence[Pool], coordinates: Sequence[Array], selected: Sequence[int], prior: float) -> SwapCosts:
    """Of k >= 1 tosses of a pool; the other arguments as in `select_representative`."""
    errors = MeanErrors.of(pools, coordinates, prior)
    sums = errors.sums(selected)
    error, joined = errors.value(sums), errors.all_joined(sums)
    joined[list(selected)] = error
    without = [errors.value(errors.sums([*selected[:place], *selected[place + 1 :]])) for place in range(len(selected))]
    return SwapCosts(error, np.array(without), joined)


def _select(pools: Sequence[Pool], config: RankingConfig) -> Selection:
    coordinates = [pool_subspace(pool, config.cut).per_mean_toss(len(pool)) for pool in pools]
    return select_representative(pools, coordinates, config.top, config.prior)


def _stream(first: Sequence[TossInformation], config: RankingConfig) -> RepresentativeStreaming:
    selector = RepresentativeStreaming(pool_centroid(first), config.top, config.prior, config.cut)
    for info in first:
        selector.offer(info)
    return selector


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
        stream=_stream,
        explain=_explain,
    )
)


MOST_TOLD = 10**5
"""A factor that is larger is that of a toss that alone determines something."""


def _factor(value: float) -> str:
    """Three digits, or all of a larger number."""
    if value > MOST_TOLD:
        return f"more than {MOST_TOLD}"
    return f"{value:.3g}" if value < 999.5 else f"{value:.0f}"
