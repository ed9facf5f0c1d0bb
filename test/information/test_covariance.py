"""The sandwich is right where the model's covariance is not, and both agree where the model is right (method.md 2.8)."""

import numpy as np
import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.information.subspace import identifiable_subspace, model_covariance, sandwich_covariance

RNG = np.random.default_rng(0)
DESIGN = RNG.standard_normal((60, 25, 4))
"""Sixty tosses of 25 residuals, linear in four parameters."""
SUBSPACE = identifiable_subspace(np.einsum("kta,ktb->ab", DESIGN, DESIGN))


def estimates(
    noise: np.ndarray[tuple[int, int, int], np.dtype[np.float64]],
) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Least-squares estimates (n, 4) of zero from n draws of noise (n, 60, 25)."""
    return np.asarray(np.einsum("kta,nkt->na", DESIGN, noise) @ (SUBSPACE.whitening @ SUBSPACE.whitening.T))


def test_the_models_covariance_is_that_of_least_squares() -> None:
    spread = np.cov(estimates(0.3 * RNG.standard_normal((4000, 60, 25))).T)
    np.testing.assert_allclose(spread, model_covariance(SUBSPACE, 0.09), atol=0.1 * spread.max())


def test_the_sandwich_sees_that_residuals_of_a_toss_belong_together() -> None:
    shared = RNG.standard_normal((4000, 60, 1)) * DESIGN[None, :, :, 0]
    true = np.sqrt(np.diagonal(np.cov(estimates(shared).T)))
    scores = np.einsum("kta,nkt->nka", DESIGN, shared[:200])
    claimed = np.sqrt(np.mean([np.diagonal(sandwich_covariance(SUBSPACE, each)) for each in scores], axis=0))
    np.testing.assert_allclose(claimed, true, rtol=0.1)
    naive = np.sqrt(np.diagonal(model_covariance(SUBSPACE, float(shared.var()))))
    assert true[0] > 3.0 * naive[0]


def test_a_variance_and_scores_that_make_no_sense_are_refused() -> None:
    with pytest.raises(InvalidValueError, match=r"^noise variance: found 0.0, expected a positive number$"):
        model_covariance(SUBSPACE, 0.0)
    with pytest.raises(InvalidValueError, match=r"^toss scores: found shape \(3, 5\), expected \(K, 4\)$"):
        sandwich_covariance(SUBSPACE, np.ones((3, 5)))
    with pytest.raises(InvalidValueError, match=r"^toss scores: found shape \(4,\), expected \(K, 4\)$"):
        sandwich_covariance(SUBSPACE, np.ones(4))


def test_both_covariances_are_products_of_the_inverse_information() -> None:
    inverse = np.linalg.inv(np.einsum("kta,ktb->ab", DESIGN, DESIGN))
    np.testing.assert_allclose(model_covariance(SUBSPACE, 2.5), 2.5 * inverse, rtol=1e-10)
    scores = DESIGN[:, 0]
    np.testing.assert_allclose(sandwich_covariance(SUBSPACE, scores), inverse @ scores.T @ scores @ inverse, rtol=1e-9)
