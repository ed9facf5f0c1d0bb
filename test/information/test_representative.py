"""The set whose own answer is the pool's: against plain loops, and where the most informative tosses are all of one mind."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.geometry.quaternions import Array
from contact_curation.information import representative
from contact_curation.information.pool import Pool, pool_of
from contact_curation.information.pool_subspace import pool_subspace
from contact_curation.information.ranker import RankingConfig, rank
from contact_curation.information.record import TossInformation
from contact_curation.information.representative import CAUTION, select_representative
from test.information.pools import rescaled, tosses

PRIOR = 1e-3


def with_scores(infos: list[TossInformation], scale: float, seed: int) -> list[TossInformation]:
    rng = np.random.default_rng(seed)
    return [replace(info, score_sum=scale * rng.standard_normal(info.parameters) @ info.fisher()) for info in infos]


def plain_cost(pool: Pool, kept: list[int]) -> float:
    """The module's sum, toss by toss, with whole matrices."""
    coordinates = pool_subspace(pool).per_mean_toss(len(pool))
    scores = pool.toss_scores @ coordinates
    fishers = [coordinates.T @ info.fisher() @ coordinates for info in pool.infos]
    prior = PRIOR * np.eye(coordinates.shape[1])
    inverse = np.linalg.inv(prior + sum((fishers[k] for k in kept), np.zeros_like(prior)))
    off = inverse @ sum((scores[k] for k in kept), np.zeros(len(prior)))
    off -= np.linalg.solve(prior + sum(fishers), scores.sum(axis=0))
    return float(off @ off + CAUTION * scores.var(axis=0).mean() * np.trace(inverse))


def plain_selection(pool: Pool, top: int) -> list[int]:
    def best(others: list[int]) -> int:
        left = [k for k in range(len(pool)) if k not in others]
        return left[int(np.argmin([plain_cost(pool, [*others, k]) for k in left]))]

    picks: list[int] = []
    while len(picks) < top:
        picks.append(best(picks))
    for _ in range(representative.EXCHANGES):
        for place in range(top):
            picks[place] = best(picks[:place] + picks[place + 1 :])
    return picks


@pytest.mark.parametrize("seed", range(4))
def test_it_picks_what_plain_loops_over_whole_matrices_pick(seed: int) -> None:
    pool = pool_of(with_scores(tosses(25, 5, 3, seed), 0.3, seed))
    found = select_representative([pool], [pool_subspace(pool).per_mean_toss(len(pool))], 5, PRIOR)
    assert found.order[:5].tolist() == plain_selection(pool, 5)
    values = [plain_cost(pool, found.order[:count].tolist()) for count in range(6)]
    np.testing.assert_allclose(found.gains[found.order[:5]], -np.diff(values), rtol=1e-6)
    assert found.scores[7] == pytest.approx(-plain_cost(pool, [7]), rel=1e-6)


def test_exchanges_improve_what_greedy_picks_found(monkeypatch: pytest.MonkeyPatch) -> None:
    costs = []
    for seed in range(6):
        pool = pool_of(with_scores(tosses(25, 5, 3, seed), 0.3, seed))
        coordinates = [pool_subspace(pool).per_mean_toss(len(pool))]
        improved = select_representative([pool], coordinates, 5, PRIOR).order[:5].tolist()
        with monkeypatch.context() as patched:
            patched.setattr(representative, "EXCHANGES", 0)
            greedy = select_representative([pool], coordinates, 5, PRIOR).order[:5].tolist()
        costs.append((plain_cost(pool, improved), plain_cost(pool, greedy)))
    assert all(one <= other * (1.0 + 1e-9) for one, other in costs)
    assert sum(one < 0.9 * other for one, other in costs) >= 2


def opinionated() -> list[TossInformation]:
    """Two parameters; of 40 tosses the ten that know most say 1/2 of the first one, the others -2/3; all together -1/5."""
    infos = []
    for number, info in enumerate(tosses(40, 2, 2, seed=3)):
        weight = 2.0 if number < 10 else 1.0
        opinion = np.array([0.5 if number < 10 else -2.0 / 3.0, 0.0])
        fisher = np.diag([weight, 1.0 + 0.01 * number])
        infos.append(replace(info, factor=np.sqrt(fisher), score_sum=fisher @ opinion))
    return infos


def answer(infos: list[TossInformation]) -> Array:
    return np.asarray(np.linalg.solve(sum(info.fisher() for info in infos), sum(info.score_sum for info in infos)))


def test_it_agrees_with_the_pool_where_the_most_informative_tosses_do_not() -> None:
    infos = opinionated()
    by_id = {info.toss_id: info for info in infos}
    whole = answer(infos)[0]
    off = {}
    for criterion in ("log-det", "representative"):
        kept = rank(infos, RankingConfig(criterion, top=8)).kept_ids
        off[criterion] = abs(answer([by_id[name] for name in kept])[0] - whole)
    assert off["representative"] < 0.1
    assert off["log-det"] > 0.5


def test_units_of_the_parameters_change_nothing() -> None:
    infos = with_scores(tosses(40, 6, 4, seed=5), 0.2, seed=5)
    scale = 10.0 ** np.random.default_rng(0).uniform(-3.0, 3.0, 6)
    config = RankingConfig("representative", top=10)
    there = [rescaled(info, scale) for info in infos]
    assert rank(infos, config).kept_ids == rank(there, config).kept_ids


def test_scores_that_are_all_noise_make_it_choose_for_what_tosses_know() -> None:
    """The prior's share apart, tr (sum F)^-1 is then all there is: the kept set knows more than as many random tosses."""
    infos = tosses(60, 4, 3, seed=8)
    loud = [replace(info, score_sum=np.zeros(4)) for info in infos[:-1]] + [replace(infos[-1], score_sum=np.full(4, 1e-3))]
    kept = set(rank(loud, RankingConfig("representative", top=8)).kept_ids)
    chance = set(rank(loud, RankingConfig("random", top=8)).kept_ids)
    known = [np.trace(np.linalg.inv(sum(i.fisher() for i in infos if i.toss_id in ids))) for ids in (kept, chance)]
    assert known[0] < known[1]
