"""Gains are differences of log-dets, and log-det is monotone and submodular."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from contact_curation.geometry.quaternions import Array
from contact_curation.information.accumulated import Accumulated
from contact_curation.information.pool import Pool, pool_of
from contact_curation.information.prior import prior_of_matrix
from test.information.oracles import log_det_value
from test.information.pools import toss, tosses

SIZE = 5
PRIOR = np.diag([0.1, 0.5, 1.0, 2.0, 0.01])
COORDINATES = prior_of_matrix(PRIOR, np.zeros(3)).coordinates


def kept(pool: Pool, indices: list[int]) -> Accumulated:
    state = Accumulated.prior_only(COORDINATES)
    return state.joined(pool.stacked(indices)) if indices else state


@pytest.mark.parametrize("rows", [1, 3, 12])
@pytest.mark.parametrize("count", [1, 7])
def test_gains_are_what_log_det_grows_by(count: int, rows: int) -> None:
    infos = tosses(count + 4, SIZE, rows, seed=rows)
    infos[1] = toss(infos[1].toss_id, np.zeros((rows, SIZE)))
    pool = pool_of(infos)
    state = kept(pool, [0, 1, 2, 3])
    gains = state.gains(pool.stacked(range(4, 4 + count)))
    value = log_det_value(infos[:4], PRIOR)
    assert state.log_det == pytest.approx(value, rel=1e-10)
    inverse = np.linalg.inv(PRIOR + sum(info.fisher() for info in infos[:4]))
    for gain, leverage, info in zip(gains.log_det, gains.leverage, infos[4:], strict=True):
        assert gain == pytest.approx(log_det_value([*infos[:4], info], PRIOR) - value, rel=1e-8)
        assert leverage == pytest.approx(np.trace(inverse @ info.fisher()), rel=1e-8)
    assert state.prior_leverage == pytest.approx(np.trace(inverse @ PRIOR), rel=1e-8)


def test_tosses_without_rows_add_nothing() -> None:
    gains = Accumulated.prior_only(COORDINATES).gains(np.zeros((3, 0, SIZE)))
    assert gains.log_det.tolist() == gains.leverage.tolist() == [0.0, 0.0, 0.0]


@given(st.data())
def test_log_det_is_monotone_and_submodular(data: st.DataObject) -> None:
    pool = pool_of(tosses(8, SIZE, 3, seed=data.draw(st.integers(0, 200))))
    small = data.draw(st.sets(st.integers(0, 6)))
    more = data.draw(st.sets(st.integers(0, 6)))
    newcomer = pool.stacked([7])
    fewer = kept(pool, sorted(small)).gains(newcomer).log_det[0]
    later = kept(pool, sorted(small | more)).gains(newcomer).log_det[0]
    assert 0.0 <= later <= fewer + 1e-9


def test_the_mean_of_several_thetas_is_submodular_too() -> None:
    pools = [pool_of(tosses(6, SIZE, 3, seed=seed)) for seed in range(3)]

    def gain(indices: list[int]) -> float:
        return float(np.mean([kept(pool, indices).gains(pool.stacked([5])).log_det[0] for pool in pools]))

    assert gain([]) >= gain([0]) >= gain([0, 1]) >= gain([0, 1, 2, 3, 4]) >= 0.0


def test_joining_at_once_is_joining_one_by_one() -> None:
    pool = pool_of(tosses(4, SIZE, 3, seed=1))
    step_by_step: Array = kept(pool, [0]).joined(pool.stacked([1])).joined(pool.stacked([2, 3])).matrix
    np.testing.assert_allclose(step_by_step, kept(pool, [0, 1, 2, 3]).matrix, rtol=1e-12)
