"""The smallest eigenvalue is that of the whole selected set, and the pruned search finds what a full search finds."""

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from contact_curation.information.pool import pool_of
from contact_curation.information.ranker import RankingConfig, rank, rank_particles
from contact_curation.information.record import TossInformation
from contact_curation.information.subspace import identifiable_subspace
from test.information.oracles import log_det_value, smallest_eigenvalue
from test.information.pools import toss, tosses

DELTA = 1e-3


def whitened(infos: Sequence[TossInformation]) -> list[TossInformation]:
    """The tosses in coordinates where their mean is the identity."""
    subspace = identifiable_subspace(pool_of(infos).fisher)
    return [toss(info.toss_id, info.factor @ subspace.per_mean_toss(len(infos))) for info in infos]


def full_search(particles: Sequence[Sequence[TossInformation]], top: int) -> list[str]:
    """Greedy by mean smallest eigenvalue, ties by mean log-det gain, then by id."""
    priors = [DELTA * np.eye(infos[0].parameters) for infos in particles]
    left, kept = list(range(len(particles[0]))), list[int]()
    while left and len(kept) < top:
        sets = {i: [[infos[j] for j in [*kept, i]] for infos in particles] for i in left}
        lowest = {i: np.mean([smallest_eigenvalue(s, a0) for s, a0 in zip(sets[i], priors)]) for i in left}
        tied = [i for i in left if lowest[i] >= max(lowest.values()) * (1 - 1e-9) - 1e-12]
        gains = {i: np.mean([log_det_value(s, a0) for s, a0 in zip(sets[i], priors)]) for i in tied}
        pick = next(i for i in tied if gains[i] >= max(gains.values()) - 1e-9)
        left.remove(pick)
        kept.append(pick)
    return [particles[0][i].toss_id for i in kept]


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10_000), st.integers(1, 40), st.integers(1, 6), st.sampled_from([0.0, 1.0, 2.0]))
def test_the_pruned_search_finds_what_the_full_search_finds(seed: int, count: int, rows: int, spread: float) -> None:
    infos = tosses(count, 4, rows, seed, spread)
    ranking = rank(infos, RankingConfig("min-eig", top=7, prior=DELTA))
    assert list(ranking.selected_ids) == full_search([whitened(infos)], 7)


def test_more_directions_than_the_tighter_bound_looks_at() -> None:
    infos = tosses(80, 24, 10, seed=0)
    ranking = rank(infos, RankingConfig("min-eig", top=12, prior=DELTA))
    assert list(ranking.selected_ids) == full_search([whitened(infos)], 12)


@pytest.mark.parametrize("seed", range(6))
def test_a_winner_whose_first_bound_is_not_among_the_largest_is_found(seed: int) -> None:
    infos = tosses(100, 3, 1, seed, spread=0.0)
    ranking = rank(infos, RankingConfig("min-eig", top=10, prior=DELTA))
    assert list(ranking.selected_ids) == full_search([whitened(infos)], 10)


def test_scores_and_gains_are_smallest_eigenvalues_of_sets() -> None:
    infos = tosses(15, 4, 6, seed=1)
    prior = DELTA * np.eye(4)
    by_id = {info.toss_id: info for info in whitened(infos)}
    ranking = rank(infos, RankingConfig("min-eig", top=3, prior=DELTA))
    kept: list[TossInformation] = []
    for entry in ranking.entries:
        info = by_id[entry.toss_id]
        assert entry.score == pytest.approx(smallest_eigenvalue([info], prior), abs=1e-9)
        gain = smallest_eigenvalue([*kept, info], prior) - smallest_eigenvalue(kept, prior)
        assert entry.marginal_gain == pytest.approx(gain, abs=1e-9)
        if entry.selected:
            kept.append(info)


def test_a_set_of_too_low_rank_is_reported() -> None:
    infos = [toss(f"{k}", np.eye(6)[k : k + 1]) for k in range(6)]
    few = rank(infos, RankingConfig("min-eig", top=4))
    assert few.diagnostics == ("the selected tosses' information has rank 4 of 6: their smallest eigenvalue is the prior's",)
    assert rank(infos, RankingConfig("min-eig", top=6)).diagnostics == ()


def test_the_whole_set_knows_every_direction_once_the_gauge_is_gone() -> None:
    rng = np.random.default_rng(2)
    gauge = rng.standard_normal(5)
    gauge /= np.linalg.norm(gauge)
    infos = [toss(f"{k:02d}", f - np.outer(f @ gauge, gauge)) for k, f in enumerate(rng.standard_normal((12, 2, 5)))]
    ranking = rank(infos, RankingConfig("min-eig", top=12, prior=1e-9))
    assert ranking.diagnostics == ()
    total = sum(entry.marginal_gain for entry in ranking.entries)
    assert total == pytest.approx(12.0, rel=1e-6)


def test_equal_tosses_go_by_id() -> None:
    factor = np.random.default_rng(3).standard_normal((2, 5))
    infos = [toss(f"{k:02d}", factor) for k in range(70)]
    assert rank(infos, RankingConfig("min-eig", top=5)).ids == tuple(info.toss_id for info in infos)


def test_particles_average_their_smallest_eigenvalues() -> None:
    particles = [tosses(20, 4, 3, seed) for seed in (4, 5)]
    ranking = rank_particles([pool_of(infos) for infos in particles], RankingConfig("min-eig", top=6, prior=DELTA))
    assert list(ranking.selected_ids) == full_search([whitened(infos) for infos in particles], 6)
