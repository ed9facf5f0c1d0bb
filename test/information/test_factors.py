"""A factor keeps the most of a Fisher matrix that its rows can hold, and says how much."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.factors import Compression, factor_of_fisher, factors_of_fishers
from test.information.toss_fishers import fisher_sum


def fisher(rank: int, size: int, seed: int) -> Array:
    rng = np.random.default_rng(seed)
    return fisher_sum(rng.standard_normal((rank, size)) * np.exp(rng.normal(0.0, 2.0, (rank, 1))))


@given(st.integers(1, 12), st.integers(1, 12), st.integers(0, 1000))
def test_all_rows_give_the_matrix_back(rank: int, size: int, seed: int) -> None:
    matrix = fisher(rank, size, seed)
    factor = factor_of_fisher(matrix, Compression(max_rows=size))
    assert len(factor.rows) <= min(rank, size)
    np.testing.assert_allclose(factor.rows.T @ factor.rows, matrix, atol=1e-10 * np.trace(matrix))
    assert factor.trace_share == pytest.approx(1.0, abs=1e-9)


@given(st.integers(1, 6), st.integers(0, 1000))
def test_no_factor_of_as_many_rows_keeps_more_of_the_trace(kept: int, seed: int) -> None:
    matrix = fisher(9, 7, seed)
    factor = factor_of_fisher(matrix, Compression(max_rows=kept))
    assert factor.rows.shape == (kept, 7)
    largest = np.sort(np.linalg.eigvalsh(matrix))[::-1][:kept].sum()
    assert np.square(factor.rows).sum() == pytest.approx(largest, rel=1e-10)
    assert factor.trace_share == pytest.approx(largest / np.trace(matrix), rel=1e-10)


def test_rows_below_the_cut_are_dropped() -> None:
    matrix = np.diag([1.0, 1e-3, 1e-6])
    assert len(factor_of_fisher(matrix, Compression(cut=1e-4)).rows) == 2
    assert len(factor_of_fisher(matrix, Compression(cut=1e-7)).rows) == 3


def test_rank_deficiency_leaves_no_rows_of_rounding() -> None:
    assert len(factor_of_fisher(fisher(5, 57, 3)).rows) == 5


def test_signs_do_not_depend_on_the_eigensolver() -> None:
    rows = factor_of_fisher(fisher(6, 6, 4)).rows
    largest = rows[np.arange(6), np.abs(rows).argmax(axis=1)]
    assert (largest > 0.0).all()


def test_each_matrix_of_a_batch_is_compressed_as_if_alone() -> None:
    matrices = np.stack([fisher(rank, 6, rank) for rank in (1, 2, 6, 9, 3)] + [np.zeros((6, 6)), fisher(4, 6, 1)])
    for factor, matrix in zip(factors_of_fishers(matrices), matrices, strict=True):
        np.testing.assert_array_equal(factor.rows, factor_of_fisher(matrix).rows)


def test_no_information_is_no_rows_and_nothing_lost() -> None:
    factor = factor_of_fisher(np.zeros((4, 4)))
    assert factor.rows.shape == (0, 4)
    assert factor.trace_share == 1.0


def test_a_matrix_that_is_no_fisher_matrix_is_refused() -> None:
    with pytest.raises(InvalidValueError, match="positive semidefinite"):
        factor_of_fisher(np.diag([1.0, -0.1]))
    with pytest.raises(InvalidValueError, match="positive semidefinite"):
        factor_of_fisher(-np.eye(2))
    with pytest.raises(InvalidValueError, match="finite"):
        factor_of_fisher(np.full((2, 2), np.nan))
    with pytest.raises(InvalidValueError, match=r"\(K, P, P\)"):
        factors_of_fishers(np.zeros((2, 3)))


@pytest.mark.parametrize(("name", "value"), [("max_rows", 0), ("cut", -1e-3), ("cut", 1.0), ("cut", np.nan)])
def test_compressions_out_of_range_are_refused(name: str, value: float) -> None:
    with pytest.raises(InvalidValueError, match=f"compression.{name}"):
        Compression(**{name: value})  # type: ignore[arg-type]
