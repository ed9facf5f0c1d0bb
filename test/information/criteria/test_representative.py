"""The set whose own answer is the pool's: against plain loops, and where the most informative tosses are all of one mind."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.geometry.quaternions import Array
from contact_curation.information.criteria import expected_error, set_search
from contact_curation.information.criteria.expected_error import CAUTION
from contact_curation.information.criteria.representative import select_representative, swap_costs
from contact_curation.information.pool import Pool, pool_of
from contact_curation.information.ranker import RankingConfig, rank
from contact_curation.information.record import TossInformation
from contact_curation.information.subspace import pool_subspace
from test.information.pools import rescaled, tosses

PRIOR = 1e-3


def with_scores(infos: list[TossInformation], scale: float, seed: int) -> list[TossInformation]:
    rng = np.random.default_rng(seed)
    return [replace(info, score_sum=scale * rng.standard_normal(info.parameters) @ info.fisher()) for info in infos]


def plain_cost(pool: Pool, kept: list[int]) -> float:
    """The expected error, toss by toss, with whole matrices."""
    coordinates = pool_subspace(pool).per_mean_toss(len(pool))
    scores = pool.toss_scores @ coordinates
    fishers = [coordinates.T @ info.fisher() @ coordinates for info in pool.infos]
    prior = PRIOR * np.eye(coordinates.shape[1])
    inverse = np.linalg.inv(prior + sum((fishers[k] for k in kept), np.zeros_like(prior)))
    off = inverse @ sum((scores[k] for k in kept), np.zeros(len(prior)))
    off -= np.linalg.solve(prior + sum(fishers), scores.sum(axis=0))
    return float(off @ off / scores.var(axis=0).mean() + CAUTION * np.trace(inverse))


def plain_selection(pool: Pool, top: int) -> list[int]:
    def best(others: list[int], among: list[int]) -> int:
        left = [k for k in among if k not in others]
        return left[int(np.argmin([plain_cost(pool, [*others, k]) for k in left]))]

    def greedy(among: list[int]) -> list[int]:
        picks: list[int] = []
        while len(picks) < top:
            picks.append(best(picks, among))
        return picks

    kept = greedy(list(range(len(pool))))
    for _ in range(set_search.EXCHANGES):
        for place in range(top):
            kept[place] = best(kept[:place] + kept[place + 1 :], list(range(len(pool))))
    return greedy(sorted(kept))


@pytest.mark.parametrize("seed", range(4))
def test_it_picks_what_plain_loops_over_whole_matrices_pick(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(set_search, "FIRST_BLOCK", 1)  # so that bounds decide what is looked at
    pool = pool_of(with_scores(tosses(25, 5, 3, seed), 0.3, seed))
    found = select_representative([pool], [pool_subspace(pool).per_mean_toss(len(pool))], 5, PRIOR)
    assert found.order[:5].tolist() == plain_selection(pool, 5)
    values = [plain_cost(pool, found.order[:count].tolist()) for count in range(6)]
    np.testing.assert_allclose(found.gains[found.order[:5]], -np.diff(values), rtol=1e-6)
    assert found.scores[7] == pytest.approx(plain_cost(pool, []) - plain_cost(pool, [7]), rel=1e-6)
    others = found.order[5:]
    final = [values[-1] - plain_cost(pool, [*found.order[:5], k]) for k in others.tolist()]
    np.testing.assert_allclose(found.gains[others], final, rtol=1e-6, atol=1e-9)
    assert np.diff(final).max() <= 1e-9


def test_how_a_kept_set_stands_is_what_it_would_cost_without_and_with_a_toss() -> None:
    pool = pool_of(with_scores(tosses(12, 5, 3, seed=4), 0.3, seed=4))
    kept = [7, 2, 9]
    standing = swap_costs([pool], [pool_subspace(pool).per_mean_toss(len(pool))], kept, PRIOR)
    assert standing.error == pytest.approx(plain_cost(pool, kept), rel=1e-9)
    assert standing.without == pytest.approx([plain_cost(pool, [other for other in kept if other != one]) for one in kept])
    joined = [plain_cost(pool, kept if one in kept else [*kept, one]) for one in range(12)]
    assert standing.joined == pytest.approx(joined, rel=1e-6)


def test_exchanges_improve_what_greedy_picks_found(monkeypatch: pytest.MonkeyPatch) -> None:
    costs = []
    for seed in range(6):
        pool = pool_of(with_scores(tosses(25, 5, 3, seed), 0.3, seed))
        coordinates = [pool_subspace(pool).per_mean_toss(len(pool))]
        improved = select_representative([pool], coordinates, 5, PRIOR).order[:5].tolist()
        with monkeypatch.context() as patched:
            patched.setattr(set_search, "EXCHANGES", 0)
            greedy = select_representative([pool], coordinates, 5, PRIOR).order[:5].tolist()
        costs.append((plain_cost(pool, improved), plain_cost(pool, greedy)))
    assert all(one <= other * (1.0 + 1e-9) for one, other in costs)
    assert sum(one < 0.9 * other for one, other in costs) >= 2


def test_a_pool_that_is_seen_in_parts_gives_nearly_as_good_a_set() -> None:
    """Every step looks at a quarter of the tosses; the error of random sets of as many is several times that of the whole."""
    ratios, random = [], []
    rng = np.random.default_rng(0)
    for seed in range(3):
        pool = pool_of(with_scores(tosses(160, 5, 3, seed), 0.3, seed))
        coordinates = [pool_subspace(pool).per_mean_toss(len(pool))]
        whole, parts = (select_representative([pool], coordinates, 5, PRIOR, most).order[:5].tolist() for most in (160, 40))
        assert len(set(parts)) == 5
        cost = plain_cost(pool, whole)
        ratios.append(plain_cost(pool, parts) / cost)
        random.append(plain_cost(pool, rng.choice(160, 5, replace=False).tolist()) / cost)
    assert np.median(ratios) < 1.5 < 3.0 < np.median(random)


def test_steps_over_a_pool_that_is_seen_in_parts_reach_every_toss() -> None:
    looks = set_search.Looks(tosses=1000, top=3, largest_whole=100)
    seen = [looks.at(step).tolist() for step in range(10)]
    assert {len(each) for each in seen} == {100}
    assert sorted(number for each in seen for number in each) == list(range(1000))


def test_more_tosses_can_be_selected_than_a_step_would_look_at() -> None:
    infos = with_scores(tosses(90, 4, 3, seed=1), 0.3, seed=1)
    pool = pool_of(infos)
    coordinates = [pool_subspace(pool).per_mean_toss(90)]
    for top in (30, 90):
        assert sorted(select_representative([pool], coordinates, top, PRIOR, 10).order.tolist()) == list(range(90))


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
        kept = rank(infos, RankingConfig(criterion, top=8)).selected_ids
        off[criterion] = abs(answer([by_id[name] for name in kept])[0] - whole)
    assert off["representative"] < 0.1
    assert off["log-det"] > 0.5


def test_units_of_the_parameters_change_nothing() -> None:
    infos = with_scores(tosses(40, 6, 4, seed=5), 0.2, seed=5)
    scale = 10.0 ** np.random.default_rng(0).uniform(-3.0, 3.0, 6)
    config = RankingConfig("representative", top=10)
    there = [rescaled(info, scale) for info in infos]
    assert rank(infos, config).selected_ids == rank(there, config).selected_ids


def test_where_no_toss_says_anything_it_chooses_for_what_tosses_know() -> None:
    """tr (sum F)^-1 is then all there is: the selected set knows more than any of some random sets of as many."""
    silent = [replace(info, score_sum=np.zeros(4)) for info in tosses(60, 4, 3, seed=8)]
    ranking = rank(silent, RankingConfig("representative", top=8))
    random = [rank(silent, RankingConfig("random", top=8, seed=seed)).selected_ids for seed in range(5)]
    known = [
        np.trace(np.linalg.inv(sum(i.fisher() for i in silent if i.toss_id in ids))) for ids in (ranking.selected_ids, *random)
    ]
    assert known[0] < min(known[1:])
    assert np.isfinite([(entry.score, entry.marginal_gain) for entry in ranking.entries]).all()


@pytest.mark.parametrize("scale", [1e-9, 1e9])
def test_units_of_the_loss_change_nothing(scale: float) -> None:
    """Scores that are small or large as a whole do not tie: they are measured by what they scatter by."""
    infos = with_scores(tosses(40, 6, 4, seed=5), 0.2, seed=5)
    config = RankingConfig("representative", top=10)
    there = [replace(info, score_sum=info.score_sum * scale) for info in infos]
    assert rank(infos, config).ids == rank(there, config).ids


@pytest.mark.parametrize("count", [1, 2, 9])
def test_copies_of_one_toss_are_ranked_by_their_ids(count: int) -> None:
    first = with_scores(tosses(1, 4, 4, seed=2), 0.3, seed=2)[0]
    copies = [replace(first, toss_id=f"copy-{k}") for k in range(count)]
    ranking = rank(copies, RankingConfig("representative", top=3))
    assert ranking.ids == tuple(f"copy-{k}" for k in range(count))
    assert np.isfinite([(entry.score, entry.marginal_gain) for entry in ranking.entries]).all()


def test_a_pool_whose_factors_are_not_held_is_ranked_as_one_whose_are(monkeypatch: pytest.MonkeyPatch) -> None:
    infos = with_scores(tosses(150, 6, 4, seed=6), 0.3, seed=6)
    config = RankingConfig("representative", top=12)
    held = rank(infos, config)
    monkeypatch.setattr(expected_error, "LARGEST_HELD", 100)
    anew = rank(infos, config)
    assert anew.ids == held.ids
    gains, again = ([entry.marginal_gain for entry in ranking.entries] for ranking in (held, anew))
    np.testing.assert_allclose(again, gains, rtol=1e-8, atol=1e-10)
