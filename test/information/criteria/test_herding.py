"""The set whose mean score is the pool's: against a plain loop over every candidate set."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.geometry.quaternions import Array
from contact_curation.information.criteria.herding import select_by_herding
from contact_curation.information.pool import pool_of
from contact_curation.information.ranker import RankingConfig, rank
from contact_curation.information.subspace import pool_subspace
from test.information.pools import tosses


def plain_herding(features: Array, top: int) -> list[int]:
    """Each step tries every toss that is left."""
    picks: list[int] = []
    for _ in range(top):
        left = [k for k in range(len(features)) if k not in picks]
        means = [features[[*picks, k]].mean(axis=0) for k in left]
        picks.append(left[int(np.argmin([np.linalg.norm(mean - features.mean(axis=0)) for mean in means]))])
    return picks


@pytest.mark.parametrize("seed", range(4))
def test_each_step_takes_the_toss_that_brings_the_mean_nearest(seed: int) -> None:
    features = np.random.default_rng(seed).standard_normal((40, 6)) + 2.0
    found = select_by_herding(features, 9)
    assert found.order[:9].tolist() == plain_herding(features, 9)
    total = (features - features.mean(axis=0))[found.order[:9]].sum(axis=0)
    assert found.gains[found.order[:9]].sum() == pytest.approx(-float(total @ total), rel=1e-12)


def test_it_matches_the_pools_mean_score_better_than_chance_does() -> None:
    infos = [
        replace(info, score_sum=np.random.default_rng(k).standard_normal(info.parameters) @ info.fisher())
        for k, info in enumerate(tosses(80, 6, 4, seed=1))
    ]
    pool = pool_of(infos)
    scores = pool.toss_scores @ pool_subspace(pool).per_mean_toss(len(pool))

    def distance(criterion: str, seed: int = 0) -> float:
        chosen = pool.indices_of(rank(infos, RankingConfig(criterion, top=8, seed=seed)).selected_ids)
        return float(np.linalg.norm(scores[chosen].mean(axis=0) - scores.mean(axis=0)))

    assert distance("herding") < min(distance("random", seed) for seed in range(50))
