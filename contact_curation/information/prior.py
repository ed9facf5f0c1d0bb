"""The prior information A0 that log-det starts from, as coordinates in which it is the identity (method.md 1.6, 2.2).

By default A0 is a small share delta of the pool's mean toss on the identifiable subspace: then nothing depends on the units
of theta. A prior in physical units (a millimetre of a vertex, half a degree of tilt) makes log-det a statement about theta
itself. For a stream the prior and the pivot of the tilt must be known before the first toss: from an earlier pool or from
such units.
"""

from dataclasses import dataclass

import numpy as np

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.pool import Pool, sheared
from contact_curation.information.record import TossInformation
from contact_curation.information.subspace import EIGENVALUE_CUT, pool_subspace


@dataclass(frozen=True, eq=False)
class LogDetPrior:
    """Where log-det starts.

    Attributes:
        coordinates: (P, p) C with C^T A0 C = I.
        pivot: (3,) about which the ground's tilt is taken [characteristic lengths].
    """

    coordinates: Array
    pivot: Array

    def rows(self, info: TossInformation) -> Array:
        """(R, P) factor of a toss about the pivot.

        Raises:
            InvalidValueError: the toss has another number of parameters than the prior.
        """
        if info.parameters != self.coordinates.shape[0]:
            expected = f"{self.coordinates.shape[0]}, as in the prior"
            raise InvalidValueError(f"parameters of toss {info.toss_id}", info.parameters, expected)
        rows = np.asarray(info.factor, dtype=float)
        if not info.tilt_axes.size:
            return rows
        return sheared(rows, info.blocks, info.tilt_axes @ (self.pivot - info.centroid))


def log_det_prior(pool: Pool, share: float, cut: float = EIGENVALUE_CUT) -> LogDetPrior:
    """The prior of a pool.

    Args:
        pool: its own prior is taken where it has one.
        share: delta > 0: otherwise A0 is this share of the mean toss, on the identifiable subspace.
        cut: see `pool_subspace`.

    Raises:
        InvalidValueError: no toss carries information, or the pool's own prior is not positive definite.
    """
    if pool.prior is not None:
        return prior_of_matrix(pool.prior, pool.pivot)
    subspace = pool_subspace(pool, cut)
    return LogDetPrior(subspace.per_mean_toss(len(pool)) / np.sqrt(share), pool.pivot)


def prior_of_matrix(information: Array, pivot: Array) -> LogDetPrior:
    """The prior of a given information matrix A0 (P, P), with the tilt about `pivot` (3,).

    Raises:
        InvalidValueError: A0 is not positive definite.
    """
    try:
        lower = np.linalg.cholesky(information)
    except np.linalg.LinAlgError as error:
        found = f"smallest eigenvalue {np.linalg.eigvalsh(information)[0]:.3g}"
        raise InvalidValueError("prior information", found, "a positive definite matrix") from error
    return LogDetPrior(np.asarray(np.linalg.inv(lower).T), pivot)
