"""Factors from rows are those from the Fisher matrix itself."""

import numpy as np
import pytest

from contact_curation.information.factors import Compression, factor_of_fisher
from contact_curation.information.network.scoring import factor_of_rows


@pytest.mark.parametrize("shape", [(5, 40), (40, 12), (30, 30), (1, 6)])
@pytest.mark.parametrize("rows", [3, 24])
def test_the_factor_is_that_of_the_fisher_matrix(shape: tuple[int, int], rows: int) -> None:
    scores = np.random.default_rng(0).standard_normal(shape) * np.exp(np.linspace(0.0, 3.0, shape[1]))
    one, other = factor_of_rows(scores, Compression(rows)), factor_of_fisher(scores.T @ scores, Compression(rows))
    np.testing.assert_allclose(one.rows, other.rows, atol=1e-9 * np.abs(other.rows).max())
    assert one.trace_share == pytest.approx(other.trace_share)


def test_rows_that_repeat_each_other_count_once() -> None:
    scores = np.tile(np.random.default_rng(1).standard_normal((2, 30)), (4, 1))
    factor = factor_of_rows(scores, Compression())
    assert len(factor.rows) == 2
    np.testing.assert_allclose(factor.rows.T @ factor.rows, scores.T @ scores, atol=1e-12)


@pytest.mark.parametrize("count", [0, 3])
def test_silence_has_an_empty_factor(count: int) -> None:
    factor = factor_of_rows(np.zeros((count, 8)), Compression())
    assert factor.rows.shape == (0, 8)
    assert factor.trace_share == 1.0
