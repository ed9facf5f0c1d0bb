"""The selected set's eigenvalues are those of its information, however many parameters there are."""

import numpy as np
import pytest

from contact_curation.information.curation import curate_particles
from contact_curation.information.diagnostics import SelectedGram, selected_gram
from contact_curation.information.pool import pool_of
from contact_curation.information.ranker import RankingConfig
from test.information import pools


def test_its_eigenvalues_are_the_non_zero_ones_of_the_sum_of_outer_products() -> None:
    scores = np.random.default_rng(0).standard_normal((4, 9))
    values = np.linalg.eigvalsh(scores.T @ scores)[-4:]
    found = selected_gram(scores)
    assert (found.smallest, found.largest) == pytest.approx((values[0], values[-1]), rel=1e-12)
    assert found.rank == 4
    shares = values / values.sum()
    assert found.effective_rank == pytest.approx(np.prod(shares**-shares), rel=1e-10)


def test_tosses_in_directions_of_their_own_count_each_and_repetitions_do_not() -> None:
    own = selected_gram(3.0 * np.eye(5)[:3])
    assert (own.smallest, own.largest, own.rank, own.effective_rank) == pytest.approx((9.0, 9.0, 3, 3.0))
    same = selected_gram(np.ones((3, 5)))
    assert (same.smallest, same.largest, same.rank, same.effective_rank) == pytest.approx((15.0, 15.0, 1, 1.0))
    assert selected_gram(np.zeros((3, 5))) == SelectedGram(0.0, 0.0, 0, 0.0)


def test_what_single_precision_leaves_is_no_eigenvalue() -> None:
    scores = np.random.default_rng(1).standard_normal((3, 50)).astype(np.float32).astype(float)
    repeated = np.concatenate([scores, (scores[:1] * (1.0 + 3e-8))])
    assert selected_gram(repeated).rank == 3


def test_a_curation_has_it_of_the_kept_tosses_where_the_exact_scores_are_known() -> None:
    infos = pools.tosses(6, parameters=4, rows=2, seed=0)
    config = RankingConfig(criterion="orthogonal", top=3)
    assert curate_particles([pool_of(infos)], config).selected_gram is None
    exact = np.random.default_rng(2).standard_normal((6, 11))
    pool = pool_of(infos, network_scores=exact)
    curation = curate_particles([pool], config)
    assert curation.selected_gram == selected_gram(pool.toss_scores[pool.indices_of(curation.ranking.selected_ids)])
    assert curation.selected_gram is not None
    assert curation.selected_gram.rank == 3
