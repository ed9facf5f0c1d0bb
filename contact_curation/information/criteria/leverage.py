"""leverage: tr((F_pool + A0)^-1 F), the trace in units in which the pool knows all directions equally well.

See method.md 1.6, 2.2.

With A0 a share of the pooled F it is the same under every linear change of parameters, and over all tosses it sums to the
effective dimension.
"""

from collections.abc import Sequence

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.information.criteria.criterion import Criterion, Need, RankingConfig, register
from contact_curation.information.pool import Pool
from contact_curation.information.ranking import Selection, mean_over_particles, modular_selection
from contact_curation.information.subspace import pool_subspace


def _select(pools: Sequence[Pool], config: RankingConfig) -> Selection:
    return modular_selection(mean_over_particles([_with_ridge(pool, config) for pool in pools]), config.top)


def _with_ridge(pool: Pool, config: RankingConfig) -> Array:
    """Leverages (K,) with the ridge A0, a share of the mean toss: F_pool + A0 = (1 + delta / K) F_pool."""
    ridge = 1.0 + config.prior / len(pool)
    return pool.traces_in(pool_subspace(pool, config.cut).whitening / np.sqrt(ridge))


LEVERAGE = register(
    Criterion(
        "leverage", "leverage of the toss", "parameters", _select, needs=frozenset({Need.THETA, Need.SUBSPACE, Need.PRIOR})
    )
)
