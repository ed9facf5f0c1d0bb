"""Whether what is said to be known is true: theta re-fitted to re-drawn tosses (method.md 2.8, check 6.16).

The bootstrap over tosses needs no model of the noise and no derivative: tosses are drawn with replacement, as many as there
are, theta is fitted to each draw from the optimum of them all, and its standard deviation over the draws is what the sandwich,
which takes one evaluation, should have said.

The sandwich leaves out of the loss's curvature what the Gauss-Newton matrix does, the residuals' own curvature. How much that
matters is told by the same sandwich about the whole Hessian, by differences of the exact scores.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from contact_curation.contact.evaluation import Estimator, transition_weights
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.impacts import as_described
from contact_curation.learning.fits.polytope_fit import FitConfig, fit_polytope
from contact_curation.learning.fits.polytope_sums import moved, physical_difference, polytope_sums
from contact_curation.learning.uncertainty.parameters import Known, KnownConfig, known, unit_sizes
from contact_curation.motion.transitions import Transitions

RESAMPLE_TOLERANCE = 1e-7
"""Relative decrease of the loss at which the fit to a draw has arrived: theta then moves by a hundredth of its deviation."""

DIFFERENCE = 1e-5
"""Of theta on either side, for the Hessian."""


class BootstrapDeviations(NamedTuple):
    """How theta changes when tosses are re-drawn.

    Attributes:
        deviations: (P,) standard deviations in theta's own coordinates.
        converged: how many of the fits arrived.
    """

    deviations: Array
    converged: int


@dataclass(frozen=True, eq=False)
class Calibration:
    """What is known, beside what the bootstrap found.

    Attributes:
        known: at the optimum of all tosses.
        bootstrap: (P,) standard deviations in the parameters' units.
        whole_hessian: (P,) those of the sandwich about the whole Hessian.
        resamples: draws of tosses.
        converged: how many of their fits arrived.
    """

    known: Known
    bootstrap: Array
    whole_hessian: Array
    resamples: int
    converged: int


def calibration(
    model: PolytopeModel,
    fitted: Transitions,
    others: Transitions,
    resamples: int,
    seed: int,
    config: KnownConfig,
) -> Calibration:
    """Compares what is known with the bootstrap.

    Args:
        model: at the optimum of `fitted`.
        fitted: tosses.
        others: tosses that it was not fitted to, for the noise.
        resamples: at least 2.
        seed: of the draws.
        config: loss and prior.
    """
    found = known(model, fitted, others, config)
    fitted = as_described(fitted, model.geometry(), model.body)
    draws = bootstrap_deviations(model, fitted, resamples, seed, FitConfig(config.loss, RESAMPLE_TOLERANCE))
    sizes = unit_sizes(model)
    whole = whole_hessian_deviations(model, fitted, config.loss)
    return Calibration(found, sizes * draws.deviations, sizes * whole, resamples, draws.converged)


def whole_hessian_deviations(model: PolytopeModel, data: Transitions, loss: LossConfig) -> Array:
    """Standard deviations (P,) in theta's own coordinates by the sandwich about the loss's whole Hessian."""
    weights = transition_weights(model.geometry(), model.body, data.before, data.dt)
    each = np.ones(len(data.dt)) if weights is None else weights

    def score(step: Array) -> Array:
        return np.asarray(polytope_sums(moved(model, step), data, Estimator.EMPIRICAL, loss, each).scores.sum(axis=0))

    scores = polytope_sums(model, data, Estimator.EMPIRICAL, loss, each).scores
    slopes = [score(step) - score(-step) for step in DIFFERENCE * np.eye(scores.shape[1])]
    hessian = -0.25 / DIFFERENCE * (np.array(slopes) + np.array(slopes).T)
    pulls = np.linalg.solve(hessian, (scores - scores.mean(axis=0)).T)  # (P, K) how far each toss pulls the optimum
    return np.asarray(np.sqrt(np.square(pulls).sum(axis=1)))


def bootstrap_deviations(
    model: PolytopeModel, data: Transitions, resamples: int, seed: int, config: FitConfig
) -> BootstrapDeviations:
    """How theta changes when tosses are re-drawn, from a model at the optimum of all of them.

    Raises:
        InvalidValueError: fewer than two resamples.
    """
    if resamples < 2:
        raise InvalidValueError("resamples", resamples, "at least 2")
    rng, tosses = np.random.default_rng(seed), len(data.toss_ids)
    thetas, converged = [], 0
    for _ in range(resamples):
        weights = np.bincount(rng.integers(tosses, size=tosses), minlength=tosses)
        fit = fit_polytope(model, data, config, weights)
        thetas.append(physical_difference(fit.model.geometry(), model.geometry()))
        converged += fit.converged
    return BootstrapDeviations(np.std(thetas, axis=0, ddof=1), converged)
