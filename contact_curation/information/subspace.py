"""The identifiable subspace of the parameters, and coordinates in which the pooled information is the identity (method.md 1.6).

The pooled F is singular: gauge freedoms are exact null directions, and some parameters were never measured. What the data can
tell is spanned by the eigenvectors of F above a relative cut. The eigenvalues are taken after scaling every parameter to unit
pooled information, D F D with D = diag(F)^(-1/2): then neither the cut nor anything built on it depends on the units of theta,
and the condition number is within a factor P of the best that any scaling reaches (van der Sluis 1969).

A network has more weights than any pool has transitions, so that the smallest eigenvalue of its information is zero by counting
and each transition is the only one to know some direction. There log-det, leverage, the smallest eigenvalue and the diagnostics
are about the directions that the pool as a whole knows best (method.md 2.7).

Once a model was fitted to a set of tosses there are two covariances of the estimate on the subspace (method.md 2.8), with H the
Gauss-Newton information summed over the tosses:

    model:    sigma^2 H^-1                          right where the model and its noise are; the Cramer-Rao bound
    sandwich: H^-1 (sum_tau s_tau s_tau^T) H^-1     right whenever tosses are independent (Huber 1967)

s_tau is a toss's score sum, s = -(1/2) dL/dtheta for a loss L = |r|^2 and H = J^T P J of the same residuals r.
"""

from dataclasses import dataclass

import numpy as np

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.pool import Pool

UNMEASURED = 1e-24
"""A parameter with less than this share of the largest diagonal entry was never measured.

Rounding leaves about 1e-32; a change of units by 1e6 between two parameters moves their ratio by 1e12.
"""

EIGENVALUE_CUT = 1e-8
"""Directions below this share of the largest eigenvalue are not identifiable (method.md 1.6)."""

LARGEST_DENSE = 4096
"""Parameters above which a few eigenvectors are iterated for: reducing the whole matrix takes minutes then."""

LEADING_DIRECTIONS = 64
"""Of a network's pool, in which tosses are compared."""


@dataclass(frozen=True, eq=False)
class IdentifiableSubspace:
    """The directions of theta that a pool of tosses identifies.

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


def pool_subspace(pool: Pool, cut: float = EIGENVALUE_CUT) -> IdentifiableSubspace:
    """The subspace in which a pool's tosses are compared: all identifiable directions, or the leading ones of a network.

    `cut` and errors as in `identifiable_subspace`.
    """
    return fisher_subspace(pool.fisher, pool.sketched, cut)


def fisher_subspace(fisher: Array, sketched: bool, cut: float = EIGENVALUE_CUT) -> IdentifiableSubspace:
    """The same of the pooled Fisher sum (P, P), in whose columns a network's scores are `sketched` or none is."""
    return leading_subspace(fisher, LEADING_DIRECTIONS, cut) if sketched else identifiable_subspace(fisher, cut)


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
    """The leading directions of a pool, for models with more parameters than a pool identifies (method.md 2.7).

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


def model_covariance(subspace: IdentifiableSubspace, noise_variance: float) -> Array:
    """Covariance (P, P) if the residuals are independent, of one variance.

    Args:
        subspace: of the summed Gauss-Newton information H.
        noise_variance: sigma^2 of the residuals, from held-out tosses.

    Raises:
        InvalidValueError: the variance is not positive.
    """
    if not noise_variance > 0.0:
        raise InvalidValueError("noise variance", noise_variance, "a positive number")
    return np.asarray(noise_variance * subspace.whitening @ subspace.whitening.T)


def sandwich_covariance(subspace: IdentifiableSubspace, toss_scores: Array) -> Array:
    """Covariance (P, P) that only needs independent tosses.

    Args:
        subspace: of the summed Gauss-Newton information H.
        toss_scores: (K, P) score sums of the same tosses about the same pivot.

    Raises:
        InvalidValueError: the scores have another number of parameters than the subspace.
    """
    if toss_scores.ndim != 2 or toss_scores.shape[1] != subspace.parameters:
        raise InvalidValueError("toss scores", f"shape {toss_scores.shape}", f"(K, {subspace.parameters})")
    steps = (toss_scores @ subspace.whitening) @ subspace.whitening.T  # (K, P) H^-1 s: how far each toss pulls the estimate
    return np.asarray(steps.T @ steps)


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
