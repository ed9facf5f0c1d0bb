"""The smallest mean variance of predictions: against every set there is, and whatever came of the tosses."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from contact_curation.information.criteria.criterion import RankingConfig
from contact_curation.information.pool import Pool, pool_of
from contact_curation.information.ranker import rank_particles
from test.information.pools import tosses

CONFIG = RankingConfig("v-optimal", top=3)


def variance(pool: Pool, picks: tuple[int, ...]) -> float:
    """tr (F / K) (A0 + sum F)^-1 over the tosses, with A0 a share of the mean toss."""
    mean = pool.fisher / len(pool)
    matrix = CONFIG.prior * mean + sum((pool.infos[k].fisher() for k in picks), np.zeros_like(mean))
    return float(np.trace(mean @ np.linalg.inv(matrix)))


@pytest.mark.parametrize("seed", range(4))
def test_its_set_is_among_the_best_2_percent_and_its_gains_are_falls_of_the_variance(seed: int) -> None:
    pool = pool_of(tosses(14, 5, 3, seed))
    ranking = rank_particles([pool], CONFIG)
    picks = pool.indices_of(ranking.selected_ids).tolist()
    everything = [variance(pool, picks) for picks in combinations(range(14), 3)]
    assert variance(pool, tuple(picks)) <= np.quantile(everything, 0.02)
    steps = [variance(pool, tuple(picks[:count])) for count in range(4)]
    np.testing.assert_allclose([entry.marginal_gain for entry in ranking.entries[:3]], -np.diff(steps), rtol=1e-6)


def test_outcomes_change_nothing() -> None:
    infos = tosses(20, 5, 3, seed=0)
    others = [replace(info, score_sum=info.score_sum[::-1].copy()) for info in infos]
    assert rank_particles([pool_of(infos)], CONFIG).entries == rank_particles([pool_of(others)], CONFIG).entries
