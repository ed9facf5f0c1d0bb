"""Factors that wait on disk rank as those in memory do, to the last bit."""

import numpy as np
import pytest

from contact_curation.geometry.quaternions import Array
from contact_curation.information.curation import curate
from contact_curation.information.pool import pool_of
from contact_curation.information.ranker import RankingConfig, criterion_names, rank
from contact_curation.storage.stores.factor_spool import FactorSpool
from test.information.pools import toss, tosses


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_factor_comes_back_bit_for_bit_whatever_came_behind_it(dtype: type) -> None:
    factors: list[Array] = [np.random.default_rng(rows).standard_normal((rows, 5)).astype(dtype) for rows in (3, 0, 1, 7)]
    with FactorSpool() as spool:
        spooled = [spool.with_factor_on_disk(toss(f"{k}", factor)) for k, factor in enumerate(factors)]
        for info, factor in zip(spooled, factors, strict=True):
            found = np.asarray(info.factor)
            assert (found.shape, found.dtype) == (info.factor.shape, info.factor.dtype) == (factor.shape, factor.dtype)
            assert found.tobytes() == factor.tobytes()
            np.testing.assert_array_equal(info.fisher(), toss("other", factor).fisher())


@pytest.mark.parametrize("criterion", criterion_names())
def test_a_ranking_does_not_depend_on_where_the_factors_are(criterion: str) -> None:
    infos = tosses(150, 6, 4, seed=3)
    config = RankingConfig(criterion, top=20)
    with FactorSpool() as spool:
        spooled = [spool.with_factor_on_disk(info) for info in infos]
        assert rank(spooled, config) == rank(infos, config)
        assert curate(spooled, config).epsilon == curate(infos, config).epsilon


def test_once_the_spool_is_closed_no_factor_can_be_taken_for_one() -> None:
    with FactorSpool() as spool:
        info = spool.with_factor_on_disk(tosses(1, 4, 3, seed=0)[0])
    with FactorSpool() as other, pytest.raises(ValueError, match="closed file"):
        other.with_factor_on_disk(tosses(1, 4, 3, seed=1)[0])
        pool_of([info]).stacked([0])
