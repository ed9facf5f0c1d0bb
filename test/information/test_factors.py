"""A factor keeps the most of a Fisher matrix that its rows can hold."""

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
    assert len(factor) <= min(rank, size)
    np.testing.assert_allclose(factor.T @ factor, matrix, atol=1e-10 * np.trace(matrix))


@given(st.integers(1, 6), st.integers(0, 1000))
def test_no_factor_of_as_many_rows_keeps_more_of_the_trace(kept: int, seed: int) -> None:
    matrix = fisher(9, 7, seed)
    factor = factor_of_fisher(matrix, Compression(max_rows=kept))
    assert factor.shape == (kept, 7)
    largest = np.sort(np.linalg.eigvalsh(matrix))[::-1][:kept].sum()
    assert np.square(factor).sum() == pytest.approx(largest, rel=1e-10)


def test_rows_below_the_cut_are_dropped() -> None:
    matrix = np.diag([1.0, 1e-3, 1e-6])
    assert len(factor_of_fisher(matrix, Compression(cut=1e-4))) == 2
    assert len(factor_of_fisher(matrix, Compression(cut=1e-7))) == 3


def test_rank_deficiency_leaves_no_rows_of_rounding() -> None:
    assert len(factor_of_fisher(fisher(5, 57, 3))) == 5


def test_signs_do_not_depend_on_the_eigensolver() -> None:
    rows = factor_of_fisher(fisher(6, 6, 4))
    largest = rows[np.arange(6), np.abs(rows).argmax(axis=1)]
    assert (largest > 0.0).all()


def test_each_matrix_of_a_batch_is_compressed_as_if_alone() -> None:
    matrices = np.stack([fisher(rank, 6, rank) for rank in (1, 2, 6, 9, 3)] + [np.zeros((6, 6)), fisher(4, 6, 1)])
    for factor, matrix in zip(factors_of_fishers(matrices), matrices, strict=True):
        np.testing.assert_array_equal(factor, factor_of_fisher(matrix))


def test_no_information_is_no_rows() -> None:
    factor = factor_of_fisher(np.zeros((4, 4)))
    assert factor.shape == (0, 4)


@pytest.mark.parametrize(
    ("matrices", "message"),
    [
        (np.diag([1.0, -0.1])[None], "Fisher matrix: found an eigenvalue of -0.1, expected a positive semidefinite matrix"),
        (-np.eye(2)[None], "Fisher matrix: found an eigenvalue of -1, expected a positive semidefinite matrix"),
        (
            np.diag([1.0, -1.01e-8])[None],
            "Fisher matrix: found an eigenvalue of -1.01e-08, expected a positive semidefinite matrix",
        ),
        (np.array([[[1.0, np.nan], [0.0, 1.0]]]), "Fisher matrices: found a value that is not finite, expected finite numbers"),
        (np.zeros((2, 3)), "Fisher matrices: found shape (2, 3), expected (K, P, P)"),
        (np.zeros((2, 3, 4)), "Fisher matrices: found shape (2, 3, 4), expected (K, P, P)"),
    ],
)
def test_a_matrix_that_is_no_fisher_matrix_is_refused(matrices: Array, message: str) -> None:
    with pytest.raises(InvalidValueError) as refused:
        factors_of_fishers(matrices)
    assert str(refused.value) == message


def test_rounding_below_zero_is_no_information() -> None:
    factor = factor_of_fisher(np.diag([1.0, -0.99e-8]), Compression(cut=0.0))
    np.testing.assert_allclose(factor, [[1.0, 0.0]])


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("max_rows", 0, "a whole number of at least 1"),
        ("cut", -1e-3, "a number from 0 to below 1"),
        ("cut", 1.0, "a number from 0 to below 1"),
        ("cut", np.nan, "a number from 0 to below 1"),
    ],
)
def test_compressions_out_of_range_are_refused(name: str, value: float, expected: str) -> None:
    with pytest.raises(InvalidValueError) as refused:
        Compression(**{name: value})  # type: ignore[arg-type]
    assert str(refused.value) == f"compression.{name}: found {value}, expected {expected}"
    assert Compression(max_rows=1, cut=0.0) == Compression(1, 0.0)


def test_a_factor_is_the_roots_of_the_eigenvalues_times_their_directions_strongest_first() -> None:
    turn = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, -1.0]])  # directions as rows
    factor = factor_of_fisher(turn.T @ np.diag([1.0, 4.0, 9.0]) @ turn, Compression(max_rows=2))
    np.testing.assert_allclose(factor, [[0.0, 0.0, 3.0], [1.6, 1.2, 0.0]], atol=1e-14)
    assert factor.flags.c_contiguous
