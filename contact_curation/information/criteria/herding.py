"""herding: the set whose mean score is nearest to the pool's (Welling 2009; Bach, Lacoste-Julien and Obozinski 2012).

A toss is described by its score sum s, in coordinates in which the pool's mean toss is the identity. The set S starts empty,
and each step adds the toss for which the squared distance

    | sum_S (s - mean s) |^2

is smallest. This is the plainest of the rules that match a set to its pool: it reads how a toss pulls theta, and not how well
the toss determines it. A step needs only the running sum, (p,) numbers, so that a selection costs O(k K p).
"""

from collections.abc import Callable, Sequence

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.information.criteria.criterion import Criterion, Need, RankingConfig, register
from contact_curation.information.optimum_shift import PoolScores
from contact_curation.information.pool import Pool
from contact_curation.information.ranking import Selection, greedy_selection
from contact_curation.information.subspace import pool_subspace
from contact_curation.information.ties import first_of_the_best


def select_by_herding(features: Array, top: int) -> Selection:
    """Up to `top` tosses whose mean feature is near the pool's.

    The score of a toss is minus its own squared distance from the mean; its gain is by how much it lowers the set's.

    Args:
        features: (K, p), in the order of the ids.
        top: how many tosses to select.
    """
    away = features - features.mean(axis=0)  # (K, p)
    lengths = np.square(away).sum(axis=1)
    left = np.ones(len(away), dtype=np.bool_)
    total = np.zeros(away.shape[1])
    picks, gains = list[int](), list[float]()
    for _ in range(min(top, len(away))):
        falls = -2.0 * away @ total - lengths  # (K,)
        pick = first_of_the_best(np.where(left, falls, -np.inf))
        picks.append(pick)
        gains.append(float(falls[pick]))
        left[pick] = False
        total += away[pick]
    return greedy_selection(np.array(picks), np.array(gains), -lengths, -2.0 * away @ total - lengths)


def whitened_scores(pool: Pool, config: RankingConfig) -> Array:
    """(K, p) scores of a pool's tosses in units of what they scatter by, so that no parameter particle outweighs another."""
    return PoolScores.of(pool, pool_subspace(pool, config.cut).per_mean_toss(len(pool)), config.prior).scores


def score_criterion(name: str, label: str, unit: str, select: Callable[[Array, int], Selection]) -> Criterion:
    """Registers a criterion that selects by `whitened_scores`, those of all parameter particles side by side."""

    def selection(pools: Sequence[Pool], config: RankingConfig) -> Selection:
        return select(np.concatenate([whitened_scores(pool, config) for pool in pools], axis=1), config.top)

    return register(Criterion(name, label, unit, selection, needs=frozenset({Need.THETA, Need.SUBSPACE})))


HERDING = score_criterion(
    "herding", "minus the squared distance of the toss's score from the mean", "variance of the scores", select_by_herding
)
