"""Trace, leverage, length and chance are sums over tosses (method.md check 6, 2.2)."""

import numpy as np
import pytest

from contact_curation.errors import InvalidValueError, NotScoredError
from contact_curation.information.criteria.trace import TraceHeap, toss_trace
from contact_curation.information.ranker import RankingConfig, rank
from contact_curation.information.ties import descending
from test.information.pools import toss, tosses


def test_the_trace_of_a_union_is_the_sum_of_the_traces() -> None:
    one, other = (np.random.default_rng(seed).standard_normal((5, 4)) for seed in (0, 1))
    union = toss_trace(toss("union", np.concatenate([one, other])))
    assert union == pytest.approx(toss_trace(toss("one", one)) + toss_trace(toss("other", other)), rel=1e-12)


def test_sum_and_mean_differ_by_the_number_of_scored_transitions() -> None:
    info = toss("a", np.random.default_rng(2).standard_normal((9, 4)), transitions=12, not_scored=3)
    assert toss_trace(info, "mean") * 9 == pytest.approx(toss_trace(info, "sum"), rel=1e-15)
    assert toss_trace(info, "sum") == pytest.approx(np.trace(info.fisher()), rel=1e-12)


def test_the_coherent_trace_is_the_squared_length_of_the_toss_score() -> None:
    info = toss("a", np.array([[1.0, 2.0], [-1.0, 1.0]]))
    assert toss_trace(info, "coherent") == 9.0


def test_the_trace_counts_what_truncation_cut_off() -> None:
    assert toss_trace(toss("a", np.ones((1, 2)), block_traces=np.array([1.5, 1.25]))) == 2.75


def test_a_mean_over_no_scored_transition_is_an_error_and_not_zero() -> None:
    unscored = toss("a", np.zeros((0, 2)), transitions=4, not_scored=4)
    with pytest.raises(NotScoredError, match=r"^toss a was not scored: none of its 4 transitions has a certified impulse$"):
        toss_trace(unscored, "mean")
    with pytest.raises(InvalidValueError, match=r"^unknown normalisation median: did you mean mean\?$"):
        toss_trace(unscored, "median")
    with pytest.raises(InvalidValueError, match=r"^unknown normalisation median: did you mean mean\?$"):
        TraceHeap(3, "median")


def test_tosses_of_nearly_the_same_length_are_in_the_order_of_their_lengths() -> None:
    """They do not depend on how tosses are batched, so that nothing but equality is a tie."""
    infos = [toss(name, np.ones((1, 2)), duration=1.0 + k * 1e-15) for k, name in enumerate("abc")]
    assert len({info.duration for info in infos}) == 3
    assert rank(infos, RankingConfig("longest", top=2)).ids == ("c", "b", "a")


@pytest.mark.parametrize("normalisation", ["sum", "mean", "coherent"])
def test_the_trace_ranking_is_the_descending_order_of_traces(normalisation: str) -> None:
    infos = tosses(50, 4, 5, seed=3)
    ranking = rank(infos, RankingConfig("trace", top=7, normalisation=normalisation))
    expected = sorted(infos, key=lambda info: (-toss_trace(info, normalisation), info.toss_id))
    assert ranking.ids == tuple(info.toss_id for info in expected)
    for entry, info in zip(ranking.entries, expected):
        assert entry.score == entry.marginal_gain == toss_trace(info, normalisation)


def test_leverages_add_up_to_the_effective_dimension() -> None:
    infos = tosses(40, 6, 4, seed=4)
    ranking = rank(infos, RankingConfig("leverage", top=5, prior=0.5))
    assert sum(entry.score for entry in ranking.entries) == pytest.approx(6 / (1 + 0.5 / 40), rel=1e-10)


def test_leverage_is_the_trace_in_the_pools_units() -> None:
    infos = tosses(40, 6, 4, seed=5)
    pooled = np.asarray(sum(info.fisher() for info in infos))
    inverse = np.linalg.inv(pooled + 1e-3 / 40 * pooled)
    by_id = {info.toss_id: info for info in infos}
    for entry in rank(infos, RankingConfig("leverage", top=5)).entries:
        assert entry.score == pytest.approx(np.trace(inverse @ by_id[entry.toss_id].fisher()), rel=1e-8)


def test_longest_goes_by_duration() -> None:
    infos = tosses(20, 3, 2, seed=6)
    expected = sorted(infos, key=lambda info: -info.duration)
    assert rank(infos, RankingConfig("longest", top=3)).ids == tuple(info.toss_id for info in expected)


def test_random_depends_on_the_seed_and_the_ids_alone() -> None:
    infos = tosses(30, 3, 2, seed=7)
    one = rank(infos, RankingConfig("random", top=5, seed=1))
    assert one == rank(infos[::-1], RankingConfig("random", top=5, seed=1))
    assert one.ids != rank(infos, RankingConfig("random", top=5, seed=2)).ids
    assert one.ids != tuple(sorted(one.ids))
    firsts = {rank(infos, RankingConfig("random", top=1, seed=seed)).ids[0] for seed in range(200)}
    assert len(firsts) == 30


def test_scores_tie_by_their_own_size_and_then_go_by_id() -> None:
    assert descending(np.array([1.5, 2.0, 1e9])).tolist() == [2, 1, 0]
    assert descending(np.array([1e9, 1e9 + 0.5, 1e9 + 2.0])).tolist() == [2, 0, 1]
    assert descending(np.array([0.0, 0.9e-12, 2e-12])).tolist() == [2, 0, 1]
    assert descending(np.array([1e9, 1e9 + 0.5]), 0.0, 0.0).tolist() == [1, 0]
