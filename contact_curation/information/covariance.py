"""How sure the parameters are once a model was fitted to a set of tosses (METHOD 2.8).

Two covariances of the estimate, both on the identifiable subspace, with H the Gauss-Newton information summed over the tosses:

    model:    sigma^2 H^-1                          right where the model and its noise are; the Cramer-Rao bound
    sandwich: H^-1 (sum_tau s_tau s_tau^T) H^-1     right whenever tosses are independent (Huber 1967)

s_tau is a toss's score sum, s = -(1/2) dL/dtheta for a loss L = |r|^2 and H = J^T P J of the same residuals r.
"""

import numpy as np

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.subspace import IdentifiableSubspace


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
