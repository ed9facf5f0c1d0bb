"""A Fisher matrix as the smallest factor W with F = W^T W (method.md 2.3).

F = V diag(lambda) V^T gives the rows sqrt(lambda_r) v_r^T, strongest first. Keeping the first R of them is the best factor of R
rows there is, in the trace and in every unitarily invariant norm (Eckart and Young 1936).
"""

from dataclasses import dataclass

import numpy as np

from contact_curation.configs import set_whole_numbers
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array

DEFINITENESS = 1e-8
"""An eigenvalue below minus this share of the largest one is no rounding error: the matrix is not a Fisher matrix."""


@dataclass(frozen=True)
class Compression:
    """How small a factor is made.

    Attributes:
        max_rows: largest number of rows of a factor; 24 also hold the weak directions that log-det needs (method.md 2.3).
        cut: rows with eigenvalues below this share of the largest are dropped. Eigenvalues of a rank-deficient matrix come out
            at about P times the rounding unit of the largest, so the default drops just those.
    """

    max_rows: int = 24
    cut: float = 1e-13

    def __post_init__(self) -> None:
        set_whole_numbers(self, ("max_rows",), 1, prefix="compression.")
        if not 0.0 <= self.cut < 1.0:
            raise InvalidValueError("compression.cut", self.cut, "a number from 0 to below 1")


def factor_of_fisher(fisher: Array, compression: Compression | None = None) -> Array:
    """The factor (R, P) of one Fisher matrix (P, P); errors as in `factors_of_fishers`."""
    return factors_of_fishers(fisher[None], compression)[0]


def factors_of_fishers(fishers: Array, compression: Compression | None = None) -> tuple[Array, ...]:
    """The factors W (R, P) of K Fisher matrices: orthogonal rows, strongest first, each with a positive largest entry.

    The factor of a matrix does not depend on the others in the batch.

    Args:
        fishers: (K, P, P) symmetric, positive semidefinite.
        compression: how small; the default when not given.

    Raises:
        InvalidValueError: the shape is wrong, or a matrix is not finite or not positive semidefinite.
    """
    wanted = compression or Compression()
    if fishers.ndim != 3 or fishers.shape[1] != fishers.shape[2]:
        raise InvalidValueError("Fisher matrices", f"shape {fishers.shape}", "(K, P, P)")
    if not np.isfinite(fishers).all():
        raise InvalidValueError("Fisher matrices", "a value that is not finite", "finite numbers")
    values, vectors = np.linalg.eigh(fishers)  # ascending (K, P), columns (K, P, P)
    return tuple(_strongest(v[::-1], u.T[::-1], wanted) for v, u in zip(values, vectors))


def _strongest(values: Array, directions: Array, compression: Compression) -> Array:
    """The factor from eigenvalues (P,), descending, and their directions as rows (P, P)."""
    largest = float(values[0]) if values.size else 0.0
    if values.size and values[-1] < -DEFINITENESS * abs(largest):
        raise InvalidValueError("Fisher matrix", f"an eigenvalue of {values[-1]:.3g}", "a positive semidefinite matrix")
    kept = min(compression.max_rows, int(np.count_nonzero(values > compression.cut * max(largest, 0.0))))
    rows = np.sqrt(values[:kept, None]) * directions[:kept]  # (R, P)
    return signed(rows)


def signed(rows: Array) -> Array:
    """The rows (R, P), turned so that the largest entry of each is positive."""
    strongest = rows[np.arange(len(rows)), np.abs(rows).argmax(axis=1)] if len(rows) else np.zeros(0)
    return np.ascontiguousarray(rows * np.where(strongest < 0.0, -1.0, 1.0)[:, None])
