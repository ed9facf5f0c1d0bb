"""The three Fisher matrices of a toss are what method.md 1.5 says, and differ by what it says."""

import numpy as np
import pytest

from contact_curation.errors import InvalidValueError
from test.information.toss_fishers import fisher_coherent, fisher_mean, fisher_sum, fisher_sums

SCORES = np.random.default_rng(0).standard_normal((11, 5))
CENTRE = np.random.default_rng(1).standard_normal(5)


def test_the_sum_adds_the_outer_products_of_all_scores() -> None:
    expected = sum(np.outer(g - CENTRE, g - CENTRE) for g in SCORES)
    np.testing.assert_allclose(fisher_sum(SCORES, CENTRE), expected, rtol=1e-12)
    np.testing.assert_allclose(fisher_sum(SCORES), sum(np.outer(g, g) for g in SCORES), rtol=1e-12)


def test_the_mean_is_the_sum_over_the_number_of_transitions() -> None:
    np.testing.assert_array_equal(fisher_mean(SCORES) * len(SCORES), fisher_sum(SCORES) / len(SCORES) * len(SCORES))
    np.testing.assert_allclose(fisher_mean(SCORES, CENTRE) * 11, fisher_sum(SCORES, CENTRE), rtol=1e-15)


def test_the_coherent_matrix_is_the_toss_scores_outer_product() -> None:
    np.testing.assert_allclose(fisher_coherent(SCORES), np.outer(SCORES.sum(axis=0), SCORES.sum(axis=0)), rtol=1e-12)
    assert np.linalg.matrix_rank(fisher_coherent(SCORES, CENTRE)) == 1


def test_centring_on_the_tosss_own_mean_leaves_no_coherent_information() -> None:
    assert np.abs(fisher_coherent(SCORES, SCORES.mean(axis=0))).max() < 1e-25


def test_a_batch_of_tosses_gives_what_each_gives_alone() -> None:
    starts = np.array([0, 1, 1, 8, 11])
    sums = fisher_sums(SCORES, starts, CENTRE)
    for k in range(4):
        np.testing.assert_array_equal(sums[k], fisher_sum(SCORES[starts[k] : starts[k + 1]], CENTRE))
    assert not sums[1].any()


def test_shapes_that_do_not_fit_are_refused() -> None:
    with pytest.raises(InvalidValueError, match=r"scores: found shape \(5,\)"):
        fisher_sum(SCORES[0])
    with pytest.raises(InvalidValueError, match="centre of the scores"):
        fisher_sum(SCORES, CENTRE[:3])
    with pytest.raises(InvalidValueError, match="at least one transition"):
        fisher_mean(SCORES[:0])


@pytest.mark.parametrize("starts", [[1, 11], [0, 12], [0, 5, 4, 11]])
def test_starts_that_do_not_cover_the_scores_are_refused(starts: list[int]) -> None:
    with pytest.raises(InvalidValueError, match="starts"):
        fisher_sums(SCORES, np.array(starts))
