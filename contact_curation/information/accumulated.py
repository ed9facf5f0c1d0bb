"""The information gathered so far, and what one more toss would add to it (method.md 2.3).

In coordinates C where the prior A0 is the identity a toss's factor W becomes Z = W C, and a selected set S has

    A = I + sum_S Z^T Z,      f(S) = logdet A = logdet(A0 + sum_S F) - logdet A0        (A0 on the subspace that C spans)
    gain of a toss: logdet(A + Z^T Z) - logdet A = logdet(I_R + Z A^-1 Z^T)              (matrix determinant lemma)

f is zero for the empty set, monotone and submodular. All gains of a batch come from one product, one small Gram matrix and one
small Cholesky factor per toss.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from contact_curation.geometry.quaternions import Array


class Gains(NamedTuple):
    """What each of b tosses would add to a selected set: log-det gain (b,), and tr(A^-1 F) (b,), which is never below it."""

    log_det: Array
    leverage: Array


@dataclass(frozen=True, eq=False)
class Accumulated:
    """The information matrix of a selected set.

    Attributes:
        coordinates: (P, p) C with C^T A0 C = I.
        matrix: (p, p) A.
    """

    coordinates: Array
    matrix: Array

    @staticmethod
    def prior_only(coordinates: Array) -> "Accumulated":
        """Nothing selected yet: A = I."""
        return Accumulated(coordinates, np.eye(coordinates.shape[1]))

    @property
    def dimension(self) -> int:
        """The number p of directions."""
        return int(self.matrix.shape[0])

    @cached_property
    def lower(self) -> Array:
        """(p, p) L with A = L L^T."""
        return np.asarray(np.linalg.cholesky(self.matrix))

    @cached_property
    def half_inverse(self) -> Array:
        """(P, p) H = C L^-T, so that W H H^T W^T = Z A^-1 Z^T."""
        return np.asarray(np.linalg.solve(self.lower, self.coordinates.T).T)

    @property
    def log_det(self) -> float:
        """f(S)."""
        return 2.0 * float(np.log(np.diagonal(self.lower)).sum())

    @property
    def prior_leverage(self) -> float:
        """tr(A^-1 A0): the number of directions that are still the prior's."""
        inverse = np.linalg.inv(self.lower)
        return float((inverse * inverse).sum())

    def gains(self, factors: Array) -> Gains:
        """What each of the tosses with factors (b, R, P) would add."""
        count, rows, parameters = factors.shape
        return gains_of_rows((factors.reshape(-1, parameters) @ self.half_inverse).reshape(count, rows, self.dimension))

    def joined(self, factors: Array) -> "Accumulated":
        """The selected set with the tosses of factors (b, R, P) added."""
        rows = factors.reshape(-1, factors.shape[-1]) @ self.coordinates  # (b R, p)
        return Accumulated(self.coordinates, self.matrix + rows.T @ rows)


def gains_of_rows(scaled: Array) -> Gains:
    """Gains from Y (b, R, p) with Y Y^T = Z A^-1 Z^T, i.e. Y = W H.

    Either Y Y^T (R, R) or Y^T Y (p, p) is used, whichever is smaller: both have the same determinant with I added.
    """
    count, rows, dimension = scaled.shape
    if rows == 0:
        return Gains(np.zeros(count), np.zeros(count))
    turned = scaled.swapaxes(1, 2)
    gram = scaled @ turned if rows <= dimension else turned @ scaled  # (b, n, n), n = min(R, p)
    diagonal = np.einsum("bii->bi", gram)
    leverage = diagonal.sum(axis=1)
    diagonal += 1.0
    lower = np.linalg.cholesky(gram)
    return Gains(2.0 * np.log(np.einsum("bii->bi", lower)).sum(axis=1), leverage)
