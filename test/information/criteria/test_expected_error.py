"""What a set is expected to cost: one toss more against the set anew, and bounds that are bounds and close."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.information.criteria.expected_error import ExpectedError
from contact_curation.information.optimum_shift import optimum_shift
from contact_curation.information.pool import Pool, pool_of
from contact_curation.information.subspace import pool_subspace
from test.information.pools import tosses

SETS: tuple[list[int], ...] = ([], [3], [3, 17, 20, 4], list(range(0, 60, 2)))


def pool_of_tosses(seed: int, parameters: int = 9) -> Pool:
    rng = np.random.default_rng(seed)
    infos = tosses(70, parameters, 5, seed)
    return pool_of(replace(info, score_sum=rng.standard_normal(parameters) @ info.fisher()) for info in infos)


def expected_error(pool: Pool) -> ExpectedError:
    return ExpectedError.of(pool, pool_subspace(pool).per_mean_toss(len(pool)), 1e-3)


@pytest.mark.parametrize("kept", SETS)
def test_one_toss_more_gives_what_the_set_gives_anew(kept: list[int]) -> None:
    errors = expected_error(pool_of_tosses(1))
    sums, others = errors.sums(kept), np.setdiff1d(np.arange(70), kept)
    anew = [errors.value(errors.sums([*kept, one])) for one in others.tolist()]
    np.testing.assert_allclose(errors.joined(sums, others), anew, rtol=1e-8)
    after = errors.with_toss(sums, 69)
    assert errors.value(after) == pytest.approx(errors.value(errors.sums([*kept, 69])), rel=1e-8)


@pytest.mark.parametrize("parameters", [1, 9, 24])
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kept", SETS)
def test_no_bound_is_above_what_it_bounds(kept: list[int], seed: int, parameters: int) -> None:
    errors = expected_error(pool_of_tosses(seed, parameters))
    sums = errors.sums(kept)
    values = errors.joined(sums, np.arange(70))
    assert (errors.bounds(sums, np.arange(70)) <= values * (1.0 + 1e-9)).all()


def test_bounds_are_close_once_much_is_known() -> None:
    """So that few tosses of a step have to be looked at closely: of 38 tosses beside 32 selected ones less than half."""
    errors = expected_error(pool_of_tosses(2))
    kept = list(range(32))
    sums, others = errors.sums(kept), np.arange(32, 70)
    values = errors.joined(sums, others)
    assert np.count_nonzero(errors.bounds(sums, others) <= values.min()) < others.size / 2


def test_all_tosses_have_the_optimum_of_all_tosses() -> None:
    pool = pool_of_tosses(4)
    coordinates = pool_subspace(pool).per_mean_toss(len(pool))
    whole = optimum_shift(pool, coordinates, list(range(70)), 1e-3)
    assert whole.distance == pytest.approx(0.0, abs=1e-9)
    assert whole.at_random == pytest.approx(0.0, abs=1e-9)
    alone = optimum_shift(pool, coordinates, [5], 1e-3)
    assert min(alone.distance, alone.at_random) > 0.1


def test_random_tosses_that_know_the_same_are_shifted_as_expected_at_random() -> None:
    rng = np.random.default_rng(0)
    infos = [replace(info, factor=np.eye(3), score_sum=rng.standard_normal(3)) for info in tosses(200, 3, 3, seed=0)]
    pool = pool_of(infos)
    coordinates = pool_subspace(pool).per_mean_toss(len(pool))
    shifts = [optimum_shift(pool, coordinates, rng.choice(200, 16, replace=False), 1e-3) for _ in range(200)]
    distances = np.array([one.distance for one in shifts])
    assert np.sqrt(np.mean(distances**2)) == pytest.approx(np.sqrt(1 / 16 - 1 / 200), rel=0.1)
    assert np.median(distances) == pytest.approx(shifts[0].at_random, rel=0.2)


def test_random_sets_that_miss_a_direction_are_as_far_off_as_is_said() -> None:
    """Each toss knows of one direction; tosses that all know the same would be 0.5 off."""
    rng = np.random.default_rng(0)
    infos = [
        replace(info, factor=np.eye(4)[[k % 4]], score_sum=rng.standard_normal(4))
        for k, info in enumerate(tosses(200, 4, 1, seed=0))
    ]
    pool = pool_of(infos)
    coordinates = pool_subspace(pool).per_mean_toss(len(pool))
    shifts = [optimum_shift(pool, coordinates, rng.choice(200, 4, replace=False), 1e-3) for _ in range(200)]
    median = np.median([one.distance for one in shifts])
    assert median > 100.0
    assert shifts[0].at_random == pytest.approx(median, rel=0.5)


def test_where_all_scores_are_zero_no_optimum_is_shifted() -> None:
    infos = [replace(info, score_sum=np.zeros(4)) for info in tosses(6, 4, 4, seed=3)]
    pool = pool_of(infos)
    shift = optimum_shift(pool, pool_subspace(pool).per_mean_toss(6), [0, 1], 1e-3)
    assert (shift.distance, shift.at_random) == (0.0, 0.0)
