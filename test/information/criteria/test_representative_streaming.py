"""In every order that was tried the streamed set comes out where the selection from the whole pool does."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.geometry.quaternions import Array
from contact_curation.information.criteria.expected_error import ExpectedError
from contact_curation.information.criteria.representative_streaming import RepresentativeStreaming
from contact_curation.information.optimum_shift import PoolScores, TossSums
from contact_curation.information.pool import Pool, pool_of
from contact_curation.information.ranker import RankingConfig, rank
from contact_curation.information.record import TossInformation
from contact_curation.information.subspace import pool_subspace
from test.information.criteria.test_exchanges import orders
from test.information.criteria.test_representative import with_scores
from test.information.pools import tosses
from test.information.test_recentring import scored

TOP, HELD, PRIOR = 8, 128, 1e-3
POOL = pool_of(with_scores(tosses(300, 8, 4, seed=0, spread=1.0), 0.3, seed=0))
RANDOM = ("random 0", "random 1", "random 2", "random 3")
ORDERS = {name: order for name, order in orders(list(POOL.infos)).items() if name in RANDOM or "random" not in name}


def streamed(infos: list[TossInformation], held: int = HELD, pivot: Array | None = None) -> RepresentativeStreaming:
    selector = RepresentativeStreaming(np.zeros(3) if pivot is None else pivot, TOP, PRIOR, most_held=held)
    for info in infos:
        selector.offer(info)
    return selector


def expected_error(pool: Pool, ids: list[str]) -> float:
    errors = ExpectedError.of(pool, pool_subspace(pool).per_mean_toss(len(pool)), PRIOR)
    return errors.value(errors.sums(pool.indices_of(ids).tolist()))


@pytest.mark.parametrize("name", ORDERS)
def test_the_expected_error_is_near_that_of_the_whole_pools_selection_in_every_order(name: str) -> None:
    pool, config = pool_of(ORDERS[name]), RankingConfig(top=TOP, prior=PRIOR)
    selector = streamed(ORDERS[name])
    exact = expected_error(pool, list(rank(pool.infos, config).selected_ids))
    assert expected_error(pool, [info.toss_id for info in selector.selected]) <= 1.1 * exact
    assert selector.held < HELD


def test_as_long_as_all_tosses_are_held_the_selection_is_as_good_as_that_of_the_whole_pool() -> None:
    selected = [info.toss_id for info in streamed(list(POOL.infos), held=301).selected]
    exact = rank(POOL.infos, RankingConfig(top=TOP, prior=PRIOR)).selected_ids
    assert expected_error(POOL, selected) <= expected_error(POOL, list(exact)) * (1.0 + 1e-9)


def test_asking_for_the_selection_changes_nothing_later() -> None:
    asked = RepresentativeStreaming(np.zeros(3), TOP, PRIOR, most_held=HELD)
    for place, info in enumerate(POOL.infos):
        asked.offer(info)
        _ = asked.selected if place % 50 == 0 else ()
    assert asked.selected == streamed(list(POOL.infos)).selected


def test_sums_over_tosses_that_come_one_by_one_give_the_pools_shift_and_scatter() -> None:
    coordinates = pool_subspace(POOL).per_mean_toss(len(POOL))
    sums = TossSums.of(pool_of(POOL.infos[:1]))
    for info in POOL.infos[1:]:
        sums = sums + TossSums.of(pool_of([info]))
    part = Pool(POOL.infos[40:50], POOL.pivot)
    found, known = PoolScores.of_sums(part, sums, coordinates, PRIOR), PoolScores.of(POOL, coordinates, PRIOR)
    np.testing.assert_allclose(sums.fisher, POOL.fisher, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(found.shift, known.shift, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.scores, known.scores[40:50], rtol=1e-9)
    assert found.scatter == known.scatter == 1.0


def test_scores_that_are_all_the_same_scatter_by_nothing() -> None:
    alike = pool_of([replace(info, score_sum=np.ones(8)) for info in POOL.infos[:30]])
    assert PoolScores.of_sums(alike, TossSums.of(alike), np.eye(8), PRIOR).scatter == 0.0


def test_the_pivot_changes_nothing() -> None:
    infos = [scored(f"toss-{k:03d}", k) for k in range(100)]
    one, other = (streamed(infos, held=40, pivot=pivot).selected for pivot in (np.zeros(3), np.array([3.0, -2.0, 1.0])))
    assert [info.toss_id for info in one] == [info.toss_id for info in other]
