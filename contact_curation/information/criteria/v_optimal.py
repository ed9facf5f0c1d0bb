"""v-optimal: the set that predicts the pool with the smallest variance (Atkinson, Donev and Tobias 2007, section 10.6).

If the residuals were noise of one variance, parameters that are estimated from the set S would predict the pool with a mean
variance in proportion to

    tr (F_pool / K) (A0 + sum_S F)^-1

which in coordinates where the pool's mean toss is the identity is the trace of the inverse alone: the second of the two terms
that `representative` minimises. So it is that selection with scores of zero, bounds, exchanges and all. It uses no outcomes.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from contact_curation.information.criteria.criterion import Criterion, Need, RankingConfig, register
from contact_curation.information.criteria.expected_error import CAUTION
from contact_curation.information.criteria.representative import select_representative
from contact_curation.information.pool import Pool
from contact_curation.information.ranking import Selection
from contact_curation.information.subspace import pool_subspace


def _without_scores(pool: Pool) -> Pool:
    infos = tuple(replace(info, score_sum=np.zeros_like(info.score_sum)) for info in pool.infos)
    return Pool(infos, pool.pivot, pool.prior)


def _select(pools: Sequence[Pool], config: RankingConfig) -> Selection:
    coordinates = [pool_subspace(pool, config.cut).per_mean_toss(len(pool)) for pool in pools]
    found = select_representative([_without_scores(pool) for pool in pools], coordinates, config.top, config.prior)
    return replace(found, scores=found.scores / CAUTION, gains=found.gains / CAUTION)


V_OPTIMAL = register(
    Criterion(
        "v-optimal",
        "fall of the predictions' variance by the toss alone",
        "noise variance per toss",
        _select,
        needs=frozenset({Need.THETA, Need.SUBSPACE, Need.PRIOR}),
    )
)
