"""log-det: the tosses that together reduce theta's uncertainty most, D-optimality (method.md 2.3; Nemhauser 1978, Minoux 1978).

f(S) is monotone and submodular: greedy reaches (1 - 1/e) of the best set's value, and a toss's gain only shrinks while the
set grows. So an old gain is an upper bound. The queue hands out the tosses with the largest bounds, a block at a time; their
gains are recomputed; once no bound reaches the best new gain, the best is the one that a full pass over the pool would
have found. Several parameter particles give the mean of their log-dets, which is submodular too (method.md 2.4).
"""

from collections.abc import Mapping, Sequence
from heapq import heapify, heappop, heappush

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.information.accumulated import Accumulated, Gains
from contact_curation.information.criteria.certificate import certificate_of, log_det_bound
from contact_curation.information.criteria.criterion import Criterion, Explanation, Need, RankingConfig, register
from contact_curation.information.criteria.exchanges import SwapStreaming
from contact_curation.information.criteria.explanation import by_log_det
from contact_curation.information.pool import Indices, Pool, pool_of
from contact_curation.information.prior import log_det_prior
from contact_curation.information.ranking import Selection, greedy_selection
from contact_curation.information.record import TossInformation
from contact_curation.information.ties import tie_floor

FIRST_BLOCK = 8
"""Tosses re-evaluated at first in a step; twice as many at each further try."""

LARGEST_BLOCK = 64


def select_by_log_det(pools: Sequence[Pool], coordinates: Sequence[Array], top: int, certificate_steps: int = 0) -> Selection:
    """The greedy set of up to `top` tosses.

    Args:
        pools: the same tosses, once per parameter particle.
        coordinates: per particle (P, p) C with C^T A0 C = I.
        top: how many tosses to select.
        certificate_steps: steps of `log_det_bound` that tighten the certificate.
    """
    states = [Accumulated.prior_only(c) for c in coordinates]
    singles = gains_in_pool(pools, states).log_det
    queue = [(-gain, index) for index, gain in enumerate(singles.tolist())]
    heapify(queue)
    picks: list[int] = []
    pick_gains: list[float] = []
    while queue and len(picks) < top:
        pick, gain = _pop_best(queue, pools, states)
        states = [state.joined(pool.stacked([pick])) for pool, state in zip(pools, states)]
        picks.append(pick)
        pick_gains.append(gain)
    final = gains_in_pool(pools, states)
    selected = np.array(picks, dtype=np.int64)
    certificate = certificate_of(states, final, selected, log_det_bound(pools, states, selected.size, certificate_steps))
    return greedy_selection(selected, np.array(pick_gains), singles, final.log_det, certificate)


def gains_in_pool(pools: Sequence[Pool], states: Sequence[Accumulated]) -> Gains:
    """What each toss of the pool would add, averaged over the particles."""
    parts = [_mean_gains(pools, states, chunk) for chunk in pools[0].chunks()]
    return Gains(np.concatenate([part.log_det for part in parts]), np.concatenate([part.leverage for part in parts]))


def _pop_best(queue: list[tuple[float, int]], pools: Sequence[Pool], states: Sequence[Accumulated]) -> tuple[int, float]:
    """Take the toss of the largest gain out of the queue; what else was evaluated goes back with its new bound."""
    fresh: list[tuple[float, int]] = []
    best = -np.inf
    block = FIRST_BLOCK
    while queue and (not fresh or -queue[0][0] >= tie_floor(best)):
        candidates = [heappop(queue)[1] for _ in range(min(block, len(queue)))]
        gains = _mean_gains(pools, states, candidates).log_det.tolist()
        fresh.extend(zip(gains, candidates))
        best = max(best, *gains)
        block = min(2 * block, LARGEST_BLOCK)
    gain, pick = min((entry for entry in fresh if entry[0] >= tie_floor(best)), key=lambda entry: entry[1])
    for other_gain, other in fresh:
        if other != pick:
            heappush(queue, (-other_gain, other))
    return pick, gain


def _mean_gains(pools: Sequence[Pool], states: Sequence[Accumulated], indices: Sequence[int] | Indices) -> Gains:
    each = [state.gains(pool.stacked(indices)) for pool, state in zip(pools, states)]
    return Gains(np.mean([gains.log_det for gains in each], axis=0), np.mean([gains.leverage for gains in each], axis=0))


def _select(pools: Sequence[Pool], config: RankingConfig) -> Selection:
    coordinates = [log_det_prior(pool, config.prior, config.cut).coordinates for pool in pools]
    return select_by_log_det(pools, coordinates, config.top, config.certificate_steps)


def _stream(first: Sequence[TossInformation], config: RankingConfig) -> SwapStreaming:
    selector = SwapStreaming(log_det_prior(pool_of(first), config.prior, config.cut), config.top)
    for info in first:
        selector.offer(info)
    return selector


def _explain(pool: Pool, selected: Mapping[str, float], config: RankingConfig) -> Explanation:
    last = list(selected.values())[-1]

    def why(place: int) -> str:
        return "selected: most new by itself" if place == 1 else f"selected: most new beside the {place - 1} above"

    def why_not(gain: float) -> str:
        return f"not selected: less new than the last, {last:.3g}" if gain < last else "not selected: came after"

    return by_log_det(pool, selected, config, why, why_not)


LOG_DET = register(
    Criterion(
        "log-det",
        "log-det gain of the toss alone",
        "nats",
        _select,
        needs=frozenset({Need.THETA, Need.SUBSPACE, Need.PRIOR}),
        stream=_stream,
        certified=True,
        explain=_explain,
    )
)
