"""Curates scored tosses: the selected set and its diagnostics, which `rank` prints and the curator publishes.

Beside the ranking stand the spectrum of the selected set's information against the pool's (method.md 1.9), the efficiencies of
method.md 2.3, each parameter block's share of the trace (method.md 2.2), and how far the selected set's optimum is from the
pool's.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.information.diagnostics import (
    BlockShare,
    Efficiency,
    SelectedGram,
    block_shares,
    efficiency,
    selected_gram,
    smallest_sufficient_k,
    spectral_distance,
)
from contact_curation.information.optimum_shift import OptimumShift, optimum_shift
from contact_curation.information.pool import Pool, pool_of
from contact_curation.information.ranker import RankingConfig, rank_particles
from contact_curation.information.ranking import Ranking
from contact_curation.information.record import TossInformation
from contact_curation.information.subspace import pool_subspace

SUFFICIENT_EPSILON = 0.5
"""The epsilon for which the smallest sufficient k is reported."""


@dataclass(frozen=True, eq=False)
class Curation:
    """A ranking and its diagnostics; with several parameter particles the diagnostics are at the first one.

    Attributes:
        ranking: all tosses, the selected ones first.
        dimension: p, how many directions of theta the pool identifies, of P.
        spectrum: (p,) of the selected set's information times K / k against the pool's, ascending; all 1 if they agree.
        epsilon: how far that spectrum reaches from 1.
        raw_epsilon: the same for the plain sum: the share of the pool's information that is missing in the worst direction.
        sufficient_k: how many tosses of this ranking bring the plain sum within SUFFICIENT_EPSILON of the pool; None if no
            number does (method.md 0.8: it is most of the pool).
        efficiency: of the selected set per toss, 1 being an average toss.
        frame_efficiency: of the selected set per scored transition.
        block_shares: of the pool's trace.
        optimum_shift: of the selected set's optimum from the pool's.
        warnings: sentences about what to be careful with.
        selected_gram: of the selected tosses' exact scores by a network's weights, where the pool has them; else None.
    """

    ranking: Ranking
    dimension: int
    spectrum: Array
    epsilon: float
    raw_epsilon: float
    sufficient_k: int | None
    efficiency: Efficiency
    frame_efficiency: Efficiency
    block_shares: tuple[BlockShare, ...]
    optimum_shift: OptimumShift
    warnings: tuple[str, ...]
    selected_gram: SelectedGram | None = None


def curate(infos: Iterable[TossInformation], config: RankingConfig) -> Curation:
    """Ranks tosses that were scored at one theta; errors as in `ranker.rank`."""
    return curate_particles([pool_of(infos)], config)


def curate_particles(pools: Sequence[Pool], config: RankingConfig) -> Curation:
    """Ranks tosses that were scored at several thetas; errors as in `ranker.rank_particles`."""
    ranking = rank_particles(pools, config)
    pool, selected = pools[0], ranking.selected_ids
    subspace = pool_subspace(pool, config.cut)
    plain = spectral_distance(pool, subspace, selected)
    scale = len(pool) / len(selected)
    shares = block_shares(pool.infos)
    return Curation(
        ranking=ranking,
        dimension=subspace.dimension,
        spectrum=plain.eigenvalues * scale,
        epsilon=float(np.abs(plain.eigenvalues * scale - 1.0).max()),
        raw_epsilon=plain.epsilon,
        sufficient_k=smallest_sufficient_k(pool, subspace, ranking.ids, SUFFICIENT_EPSILON),
        efficiency=efficiency(pool, subspace, selected),
        frame_efficiency=efficiency(pool, subspace, selected, per_transition=True),
        block_shares=shares,
        optimum_shift=optimum_shift(pool, subspace.per_mean_toss(len(pool)), pool.indices_of(selected), config.prior),
        warnings=ranking.diagnostics,
        selected_gram=None if pool.network_scores is None else selected_gram(pool.toss_scores[pool.indices_of(selected)]),
    )
