"""A pool holds comparable tosses in the order of their ids and adds them about one pivot."""

from typing import Any

import numpy as np
import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.information.pool import CHUNK, pool_of
from contact_curation.information.prior import prior_of_matrix
from test.information.pools import blocks_of, toss, tosses


def test_the_order_in_which_tosses_come_does_not_matter() -> None:
    infos = tosses(2 * CHUNK + 3, 4, 3, seed=0)
    shuffled = [infos[i] for i in np.random.default_rng(0).permutation(len(infos))]
    one, other = pool_of(infos), pool_of(shuffled)
    assert one.ids == other.ids == tuple(sorted(info.toss_id for info in infos))
    np.testing.assert_array_equal(one.fisher, other.fisher)
    np.testing.assert_allclose(one.fisher, sum(info.fisher() for info in infos), rtol=1e-12)


def test_shorter_factors_are_filled_up_with_rows_that_say_nothing() -> None:
    infos = [toss("a", np.ones((1, 3))), toss("b", np.ones((4, 3))), toss("c", np.zeros((0, 3)))]
    stack = pool_of(infos).stacked([2, 1, 0])
    assert stack.shape == (3, 4, 3)
    for factor, info in zip(stack, reversed(infos)):
        np.testing.assert_array_equal(factor.T @ factor, info.fisher())


@pytest.mark.parametrize("shape", [(2, 4), (3, 4)])
def test_factors_of_single_precision_are_added_in_double(shape: tuple[int, int]) -> None:
    third = toss("a", np.full((2, 4), 1.0 / 3.0, dtype=np.float32))
    pool = pool_of([third, toss("b", np.ones(shape, dtype=np.float32))])
    assert pool.stacked([0, 1]).dtype == np.dtype(float)
    share = float(np.float32(1.0 / 3.0))
    np.testing.assert_allclose(pool.fisher, np.full((4, 4), 2.0 * share * share + shape[0]), rtol=1e-15)
    np.testing.assert_array_equal(third.fisher(), np.full((4, 4), 2.0 * share * share))
    assert prior_of_matrix(np.eye(4), np.zeros(3)).rows(third).dtype == np.dtype(float)


def test_an_empty_pool_and_a_toss_that_comes_twice_are_refused() -> None:
    with pytest.raises(InvalidValueError, match="tosses to rank: found none"):
        pool_of([])
    with pytest.raises(InvalidValueError, match="b twice"):
        pool_of([toss("b", np.ones((1, 2))), toss("a", np.ones((1, 2))), toss("b", np.ones((2, 2)))])


@pytest.mark.parametrize(
    "change",
    [
        {"parameters_version": "another theta"},
        {"body": "mug"},
        {"estimator": "gauss-newton"},
        {"influence_bound": 0.5},
        {"model": "deep"},
        {"blocks": blocks_of([("all", 4)])},
    ],
)
def test_tosses_scored_at_another_theta_or_in_another_way_are_refused(change: dict[str, Any]) -> None:
    with pytest.raises(InvalidValueError, match=f"{next(iter(change))} of the tosses to rank"):
        pool_of([toss("a", np.ones((1, 4))), toss("b", np.ones((1, 4)), **change)])


def test_a_prior_must_fit_the_parameters() -> None:
    infos = tosses(3, 4, 2, seed=1)
    with pytest.raises(InvalidValueError, match="prior"):
        pool_of(infos, prior=np.eye(3))
    assert pool_of(infos, prior=np.eye(4)).prior is not None


def test_tosses_are_found_by_id() -> None:
    pool = pool_of(tosses(4, 3, 2, seed=2))
    np.testing.assert_array_equal(pool.indices_of(["toss-0003", "toss-0000"]), [3, 0])
    with pytest.raises(InvalidValueError, match="nobody"):
        pool.indices_of(["nobody"])
