"""The identifiable subspace of the parameters, and coordinates in which the pooled information is the identity (METHOD 1.6).

The pooled F is singular: gauge freedoms are exact null directions, and some parameters were never measured. What the data can
tell is spanned by the eigenvectors of F above a relative cut. The eigenvalues are taken after scaling every parameter to unit
pooled information, D F D with D = diag(F)^(-1/2): then neither the cut nor anything built on it depends on the units of theta,
and the condition number is within a factor P of the best that any scaling reaches (van der Sluis 1969).
"""

from dataclasses import dataclass

import numpy as np

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array

UNMEASURED = 1e-24
"""A parameter with less than this share of the largest diagonal entry was never measured.

Rounding leaves about 1e-32; a change of units by 1e6 between two parameters moves their ratio by 1e12.
"""

EIGENVALUE_CUT = 1e-8
"""Directions below this share of the largest eigenvalue are not identifiable (METHOD 1.6)."""

LARGEST_DENSE = 4096
"""Parameters above which a few eigenvectors are iterated for: reducing the whole matrix takes minutes then."""


@dataclass(frozen=True, eq=False)
class IdentifiableSubspace:
    """What a pool of tosses can tell about theta.

    Attributes:
        whitening: (P, p) C with C^T F C = I for the pooled F; a toss's factor W becomes W C.
        eigenvalues: (p,) of the scaled F on the subspace, ascending.
    """

    whitening: Array
    eigenvalues: Array

    @property
    def dimension(self) -> int:
        """The number p of identifiable directions."""
        return int(self.eigenvalues.size)

    @property
    def parameters(self) -> int:
        """P."""
        return int(self.whitening.shape[0])

    def per_mean_toss(self, tosses: int) -> Array:
        """(P, p) coordinates in which the mean of `tosses` tosses' information is the identity."""
        return np.asarray(self.whitening * np.sqrt(tosses))


def identifiable_subspace(fisher: Array, cut: float = EIGENVALUE_CUT) -> IdentifiableSubspace:
    """The identifiable subspace of a pooled Fisher matrix.

    Args:
        fisher: (P, P) pooled Fisher sum.
        cut: eigenvalues above this share of the largest are kept.

    Raises:
        InvalidValueError: nothing is identifiable, because no toss carries information.
    """
    diagonal = np.diagonal(fisher)
    measured = diagonal > UNMEASURED * max(float(diagonal.max(initial=0.0)), np.finfo(float).tiny)
    if not measured.any():
        raise InvalidValueError("pooled information", "zero", "at least one toss that tells something about theta")
    scale = diagonal[measured] ** -0.5
    values, vectors = np.linalg.eigh(scale[:, None] * fisher[np.ix_(measured, measured)] * scale)
    kept = values > cut * values.max()
    whitening = np.zeros((len(diagonal), int(np.count_nonzero(kept))))
    whitening[measured] = scale[:, None] * vectors[:, kept] / np.sqrt(values[kept])
    return IdentifiableSubspace(whitening, eigenvalues=values[kept])


def leading_subspace(fisher: Array, directions: int, cut: float = EIGENVALUE_CUT) -> IdentifiableSubspace:
    """The directions that a pool knows best, for models of more parameters than any pool can tell (METHOD 2.7).

    It is taken in the parameters' own units: the columns of a sketch have none of their own to scale by.

    Args:
        fisher: (P, P) pooled Fisher sum.
        directions: how many at most.
        cut: eigenvalues above this share of the largest are kept.

    Raises:
        InvalidValueError: nothing is identifiable, because no toss carries information.
    """
    if not np.trace(fisher) > 0.0:
        raise InvalidValueError("pooled information", "zero", "at least one toss that tells something about theta")
    values, vectors = _leading_eigenvectors(fisher, directions)
    kept = values > cut * values[-1]
    return IdentifiableSubspace(vectors[:, kept] / np.sqrt(values[kept]), eigenvalues=values[kept])


def _leading_eigenvectors(fisher: Array, directions: int) -> tuple[Array, Array]:
    """The largest eigenvalues, ascending, and their eigenvectors (P, at most `directions`)."""
    import scipy.linalg  # only networks need these
    import scipy.sparse.linalg

    size = len(fisher)
    if size <= LARGEST_DENSE:
        return scipy.linalg.eigh(fisher, subset_by_index=(max(size - directions, 0), size - 1))  # type: ignore[no-any-return]
    values, vectors = scipy.sparse.linalg.eigsh(fisher, k=directions, v0=np.ones(size))
    order = np.argsort(values)
    return values[order], vectors[:, order]
