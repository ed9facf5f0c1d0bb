"""Pivoted QR picks new directions; the paper's literal rule picks silence (method.md 1.8, E15, check 9)."""

import numpy as np
import pytest
from scipy.linalg import qr

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.criteria.orthogonal import select_orthogonal, toss_scores
from contact_curation.information.pool import pool_of
from contact_curation.information.ranker import RankingConfig, rank, rank_particles
from test.information.pools import toss, tosses


def picks(scores: Array, top: int, variant: str = "pivoted") -> list[int]:
    return [int(index) for index in select_orthogonal(scores, top, variant).order[:top]]


@pytest.mark.parametrize("seed", range(5))
def test_pivoted_selection_is_qr_with_column_pivoting(seed: int) -> None:
    scores = np.random.default_rng(seed).standard_normal((40, 12))
    _, upper, order = qr(scores.T, mode="economic", pivoting=True)
    selection = select_orthogonal(scores, 12)
    np.testing.assert_array_equal(selection.order[:12], order[:12])
    np.testing.assert_allclose(selection.gains[order[:12]], np.abs(np.diagonal(upper)), rtol=1e-10)


def test_it_starts_again_once_every_direction_is_used_up() -> None:
    scores = np.random.default_rng(6).standard_normal((30, 4))
    first, second = picks(scores, 4), picks(scores, 8)[4:]
    left = np.setdiff1d(np.arange(30), first)
    assert second == [int(left[index]) for index in picks(scores[left], 4)]


def test_it_starts_again_early_when_the_scores_span_less() -> None:
    scores = np.outer([5.0, 4.0, 3.0, 2.0], [1.0, 2.0, 0.0])
    assert picks(scores, 4) == [0, 1, 2, 3]


def test_no_copy_is_picked_before_every_direction_is() -> None:
    distinct = np.random.default_rng(7).standard_normal((6, 6))
    longest = distinct[np.linalg.norm(distinct, axis=1).argmax()]
    chosen = picks(np.concatenate([np.tile(longest, (9, 1)), distinct]), 6)
    assert np.linalg.matrix_rank(np.concatenate([np.tile(longest, (9, 1)), distinct])[chosen]) == 6


def test_the_others_follow_by_the_length_that_is_new() -> None:
    scores = np.diag([4.0, 3.0, 2.0]).repeat(2, axis=0) + np.array([0, 0, 0, 0, 0, 1])[:, None] * np.array([0.0, 0.0, 0.5])
    selection = select_orthogonal(scores, 2)
    np.testing.assert_array_equal(selection.order, [0, 2, 5, 4, 1, 3])
    np.testing.assert_allclose(selection.gains, [4.0, 0.0, 3.0, 0.0, 2.0, 2.5], atol=1e-12)


def test_max_cosine_picks_the_least_aligned() -> None:
    scores = np.random.default_rng(8).standard_normal((25, 4))
    unit = scores / np.linalg.norm(scores, axis=1, keepdims=True)
    chosen = [int(np.linalg.norm(scores, axis=1).argmax())]
    while len(chosen) < 6:
        worst = [max(abs(unit[i] @ unit[j]) for j in chosen) if i not in chosen else np.inf for i in range(25)]
        chosen.append(int(np.argmin(worst)))
    assert picks(scores, 6, "max-cosine") == chosen
    assert picks(1e-7 * scores, 6, "max-cosine") == chosen


def test_the_literal_rule_prefers_tosses_that_say_nothing_and_the_others_do_not() -> None:
    scores = np.random.default_rng(9).standard_normal((20, 4))
    scores[11:15] *= 1e-3
    scores[15] = 0.0
    assert set(picks(scores, 6, "literal")[1:]) == {11, 12, 13, 14, 15}
    assert not {11, 12, 13, 14, 15} & set(picks(scores, 4))
    assert 15 not in picks(scores, 19, "max-cosine")


def test_only_the_known_variants_are_accepted() -> None:
    told = r"^unknown orthogonal variant sideways: expected one of literal, max-cosine, pivoted$"
    with pytest.raises(InvalidValueError, match=told):
        select_orthogonal(np.eye(2), 1, "sideways")


def test_the_numbers_of_the_variants_by_hand() -> None:
    scores = np.array([[3.0, 0.0], [0.0, 2.0], [1.0, 1.0], [0.0, 0.0]])
    pivoted = select_orthogonal(scores, 2)
    np.testing.assert_array_equal(pivoted.scores, [3.0, 2.0, np.sqrt(2.0), 0.0])
    np.testing.assert_allclose(pivoted.gains, [3.0, 2.0, 0.0, 0.0], atol=1e-15)
    assert (pivoted.order[:2].tolist(), pivoted.count) == ([0, 1], 2)
    cosine = select_orthogonal(scores, 2, "max-cosine")
    np.testing.assert_allclose(cosine.gains, [0.0, 0.0, -np.sqrt(0.5), -1.0], atol=1e-15)
    np.testing.assert_array_equal(cosine.scores, pivoted.scores)
    literal = select_orthogonal(scores, 2, "literal")
    np.testing.assert_allclose(literal.gains, [0.0, 0.0, -3.0, 0.0], atol=1e-15)
    assert literal.order[:2].tolist() == [0, 1]
    np.testing.assert_array_equal(literal.scores, pivoted.scores)
    assert select_orthogonal(scores, 9).count == 4


def test_scores_of_several_particles_count_alike_and_the_mean_is_over_transitions() -> None:
    one = [toss("a", np.array([[3.0, 0.0]])), toss("b", np.array([[0.0, 4.0], [0.0, 2.0]]), transitions=3, not_scored=1)]
    np.testing.assert_allclose(toss_scores(pool_of(one), centre=True), [[2.0, -2.0], [-2.0, 2.0]])
    np.testing.assert_allclose(toss_scores(pool_of(one)), [[3.0, 0.0], [0.0, 6.0]])
    large = [toss(info.toss_id, 1e3 * info.factor) for info in one]
    ranking = rank_particles([pool_of(one), pool_of(large)], RankingConfig("orthogonal", top=2))
    mean = np.sqrt(0.5 * (9.0 + 36.0))
    assert [entry.score for entry in ranking.entries] == pytest.approx([np.sqrt(2.0) * 6.0 / mean, np.sqrt(2.0) * 3.0 / mean])


def test_scores_of_zero_are_ranked_by_id() -> None:
    for variant in ("pivoted", "max-cosine", "literal"):
        np.testing.assert_array_equal(select_orthogonal(np.zeros((4, 3)), 2, variant).order, [0, 1, 2, 3])


def test_centring_takes_the_common_gradient_out() -> None:
    """A gradient that all transitions share makes the longest toss the first pick; without it the toss that differs is."""
    drift, rng = np.array([10.0, 0.0, 0.0]), np.random.default_rng(10)
    counts = {"a-long": 40, "b-short": 10, "c-different": 10}
    infos = [toss(name, drift + 0.01 * rng.standard_normal((count, 3))) for name, count in counts.items()]
    infos[2] = toss("c-different", infos[2].factor + np.array([0.0, 5.0, 0.0]))
    assert rank(infos, RankingConfig("orthogonal", top=1)).selected_ids == ("a-long",)
    assert rank(infos, RankingConfig("orthogonal", top=1, centre=True)).selected_ids == ("c-different",)


def test_whitening_makes_the_choice_independent_of_units() -> None:
    infos = tosses(30, 5, 6, seed=11)
    scale = np.array([1e3, 1e-3, 1.0, 10.0, 0.1])
    scaled = [toss(info.toss_id, info.factor * scale) for info in infos]
    whitened = RankingConfig("orthogonal", top=10, whiten=True)
    assert rank(infos, whitened).ids == rank(scaled, whitened).ids
    plain = RankingConfig("orthogonal", top=10)
    assert rank(infos, plain).selected_ids != rank(scaled, plain).selected_ids
