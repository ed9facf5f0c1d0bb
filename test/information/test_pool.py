"""A pool holds comparable tosses in the order of their ids and adds them about one pivot."""

from typing import Any

import numpy as np
import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.information.pool import CHUNK, about_centroids, pool_of
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
    with pytest.raises(InvalidValueError, match=r"^tosses to rank: found none, expected at least one$"):
        pool_of([])
    with pytest.raises(InvalidValueError, match=r"^tosses to rank: found b twice, expected each toss once$"):
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
    ((name, _),) = change.items()
    one, other = toss("a", np.ones((1, 4))), toss("b", np.ones((1, 4)), **change)
    with pytest.raises(InvalidValueError) as refused:
        pool_of([other, one])
    found = f"{getattr(one, name)!r} of a and {getattr(other, name)!r} of b"
    assert str(refused.value) == f"{name} of the tosses to rank: found {found}, expected the same for all"


def test_a_prior_must_fit_the_parameters() -> None:
    infos = tosses(3, 4, 2, seed=1)
    for shape in ((3, 3), (4, 3), (4,)):
        with pytest.raises(InvalidValueError) as refused:
            pool_of(infos, prior=np.zeros(shape))
        assert str(refused.value) == f"prior information: found shape {shape}, expected (4, 4)"
    prior = np.eye(4)
    assert pool_of(infos, prior=prior).prior is prior


def test_scores_of_networks_are_one_for_each_toss() -> None:
    infos = tosses(3, 4, 2, seed=1)
    for shape in ((2, 5), (3,)):
        with pytest.raises(InvalidValueError) as refused:
            pool_of(infos, network_scores=np.zeros(shape))
        assert str(refused.value) == f"network scores: found shape {shape}, expected (3, M)"
    scores = np.ones((3, 5))
    pool = pool_of(infos, network_scores=scores)
    assert pool.network_scores is scores
    np.testing.assert_array_equal(pool.toss_scores[:, :4], [info.score_sum for info in infos])
    np.testing.assert_array_equal(pool.toss_scores[:, 4:], scores)


def test_a_sketchs_columns_give_way_to_the_scores_themselves() -> None:
    blocks = blocks_of([("first", 1), ("gap network", 2), ("last", 1)])
    infos = [toss(name, np.full((1, 4), value), blocks=blocks) for name, value in (("a", 1.0), ("b", 2.0))]
    pool = pool_of(infos, network_scores=np.array([[5.0, 6.0, 7.0], [8.0, 9.0, 10.0]]))
    np.testing.assert_array_equal(pool.toss_scores, [[1.0, 1.0, 5.0, 6.0, 7.0], [2.0, 2.0, 8.0, 9.0, 10.0]])
    assert pool.sketched
    assert not pool_of(tosses(2, 4, 2, seed=1)).sketched


def test_a_pools_centroid_is_the_mean_over_its_transitions_and_moves_the_tilt() -> None:
    """method.md 1.1: d/dtilt_a becomes d/dtilt_a + (b_a . d) d/dheight."""
    blocks, axes = blocks_of([("first", 1), ("tilt", 2), ("height", 1)]), np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    rows = np.array([[1.0, 2.0, 3.0, 4.0]])
    infos = [
        toss("a", rows, blocks=blocks, tilt_axes=axes, transitions=1, not_scored=0, centroid=np.array([1.0, 0.0, 5.0])),
        toss("b", rows, blocks=blocks, tilt_axes=axes, transitions=3, not_scored=2, centroid=np.array([0.0, 4.0, 1.0])),
    ]
    pool = pool_of(infos)
    np.testing.assert_allclose(pool.pivot, [0.25, 3.0, 2.0])
    np.testing.assert_array_equal(pool.scored_transitions, [1, 1])
    moved = np.array([[1.0, 2.0 - 0.75 * 4.0, 3.0 + 3.0 * 4.0, 4.0], [1.0, 2.0 + 0.25 * 4.0, 3.0 - 1.0 * 4.0, 4.0]])
    np.testing.assert_allclose(pool.stacked([0, 1])[:, 0], moved)
    np.testing.assert_allclose(pool.toss_scores, moved)
    np.testing.assert_allclose(pool.fisher, moved.T @ moved)
    np.testing.assert_allclose(
        pool.traces_in(np.diag([1.0, 1.0, 0.0, 2.0])), (moved * [1.0, 1.0, 0.0, 2.0] * moved * [1.0, 1.0, 0.0, 2.0]).sum(axis=1)
    )
    fishers, scores = about_centroids(
        np.stack([rows.T @ rows] * 2), np.repeat(rows, 2, axis=0), blocks, np.array([[-0.75, 3.0], [0.25, -1.0]])
    )
    np.testing.assert_allclose(fishers, moved[:, :, None] * moved[:, None])
    np.testing.assert_allclose(scores, moved)
    np.testing.assert_array_equal(rows, [[1.0, 2.0, 3.0, 4.0]])


def test_tosses_are_found_by_id() -> None:
    pool = pool_of(tosses(4, 3, 2, seed=2))
    np.testing.assert_array_equal(pool.indices_of(["toss-0003", "toss-0000"]), [3, 0])
    with pytest.raises(InvalidValueError, match=r"^toss id: found nobody, expected one of the 4 tosses of the pool$"):
        pool.indices_of(["nobody"])
    assert [chunk.tolist() for chunk in pool_of(tosses(CHUNK + 2, 3, 2, seed=2)).chunks()][1] == [CHUNK, CHUNK + 1]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"block_traces": np.zeros(3)}, "block_traces of toss a: found shape (3,), expected (2,)"),
        ({"score_sum": np.zeros(3)}, "score_sum of toss a: found shape (3,), expected (4,)"),
        ({"centroid": np.zeros(2)}, "centroid of toss a: found shape (2,), expected (3,)"),
        ({"tilt_axes": np.zeros((1, 3))}, "tilt_axes of toss a: found shape (1, 3), expected (2, 3) or (0, 3)"),
        ({"score_sum": np.full(4, np.nan)}, "score_sum of toss a: found a value that is not finite, expected finite numbers"),
        (
            {"tilt_axes": np.full((2, 3), np.inf)},
            "tilt_axes of toss a: found a value that is not finite, expected finite numbers",
        ),
        ({"duration": np.nan}, "duration of toss a: found a value that is not finite, expected finite numbers"),
        ({"blocks": blocks_of([("all", 5)])}, "score_sum of toss a: found shape (4,), expected (5,)"),
        (
            {"blocks": blocks_of([("all", 5)]), "score_sum": np.zeros(5), "block_traces": np.zeros(1)},
            "factor of toss a: found shape (2, 4), expected (R, 5)",
        ),
    ],
)
def test_a_record_that_does_not_fit_together_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidValueError) as refused:
        toss("a", np.ones((2, 4)), **changes)
    assert str(refused.value) == message


def test_a_record_in_words_names_its_trace_its_loss_and_what_was_scored() -> None:
    info = toss("a", np.array([[1.0, 2.0], [3.0, 4.0]]), transitions=5, not_scored=2, mean_loss=0.012345)
    assert info.in_words() == "scored a: trace 30, loss 0.0123, 3 of 5 transitions"
    assert info.parameters == 2
    np.testing.assert_array_equal(info.fisher(), [[10.0, 14.0], [14.0, 20.0]])
