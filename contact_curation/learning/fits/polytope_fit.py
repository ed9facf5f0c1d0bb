"""Fits a polytope to tosses without a prior: the optimum of the weighted loss to rounding, by damped Gauss-Newton steps.

    H = sum_k w_k F_k the Gauss-Newton information,  s = sum_k w_k s_k the score,     over tosses k

Use it for questions about the optimum itself, for example how far it moves when tosses are resampled. Networks have no such
matrices. In the rigid form the transitions keep the variances that they have at the start of the fit.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from contact_curation.contact.evaluation import Estimator, transition_weights
from contact_curation.contact.loss_config import DEFAULT_LOSS, LossConfig
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.fits.damped_descent import DescentLimits, Iterate, descend
from contact_curation.learning.fits.polytope_sums import polytope_sums
from contact_curation.motion.transitions import Transitions


@dataclass(frozen=True)
class FitConfig:
    """When a fit ends.

    Attributes:
        loss: weights and solver of the loss.
        tolerance: the fit has converged when a step lowers the loss by less than this share.
        max_steps: largest number of steps, accepted or not.
        damping: damping of the first step.
        largest_damping: as in `DescentLimits`.
    """

    loss: LossConfig = field(default_factory=lambda: DEFAULT_LOSS)
    tolerance: float = 1e-9
    max_steps: int = 200
    damping: float = 1e-3
    largest_damping: float = 1e6

    def __post_init__(self) -> None:
        for name in ("tolerance", "max_steps", "damping", "largest_damping"):
            if not getattr(self, name) > 0:
                raise InvalidValueError(f"fit.{name}", getattr(self, name), "a positive number")


class PolytopeFit(NamedTuple):
    """Result of a fit.

    Attributes:
        model: fitted model in the physical or the rigid form.
        loss: weighted sum of the losses of all solved transitions.
        steps: number of steps that were tried.
        converged: whether the fit converged within the tolerance.
        not_solved: number of transitions without a certificate at the fitted model.
    """

    model: PolytopeModel
    loss: float
    steps: int
    converged: bool
    not_solved: int


FLOOR = 1e-12
"""Share of H's mean diagonal that is always added to its diagonal, so that a vertex that never came near the board stays."""


def fit_polytope(
    model: PolytopeModel, data: Transitions, config: FitConfig | None = None, weights: ArrayLike | None = None
) -> PolytopeFit:
    """Finds the optimum of the weighted loss from a starting model.

    Args:
        model: model at which the fit starts; it is not changed.
        data: transitions of at least one toss.
        config: when the fit ends.
        weights: (K,) how often each toss counts, at least 0; once each by default.

    Raises:
        InvalidValueError: `weights` have the wrong shape or values, or the geometry has no physical form.
    """
    config = config or FitConfig()
    counts = checked_weights(weights, len(data.toss_ids))
    limits = DescentLimits(config.tolerance, config.max_steps, config.damping, config.largest_damping, FLOOR)
    inverse_variances = transition_weights(model.geometry(), model.body, data.before, data.dt)
    each = np.ones(len(data.dt)) if inverse_variances is None else inverse_variances
    found = descend(model, lambda here: _iterate(here, data, counts, each, config), limits)
    end = found.iterate
    return PolytopeFit(end.model, end.objective, found.steps, found.arrived, end.not_solved)


def _iterate(model: PolytopeModel, data: Transitions, weights: Array, each: Array, config: FitConfig) -> Iterate:
    sums = polytope_sums(model, data, Estimator.GAUSS_NEWTON, config.loss, each)
    information = np.tensordot(weights, sums.fishers, axes=1)
    missing = int(sums.not_solved[weights > 0.0].sum())
    return Iterate(model, float(weights @ sums.losses), weights @ sums.scores, information, missing)


def checked_weights(weights: ArrayLike | None, tosses: int) -> Array:
    """How often each of K tosses counts (K,); once each by default.

    Raises:
        InvalidValueError: the weights do not have shape (K,), one is negative or not finite, or none is above 0.
    """
    counts = np.ones(tosses) if weights is None else np.asarray(weights, dtype=float)
    if counts.shape != (tosses,) or not np.isfinite(counts).all() or counts.min() < 0.0 or not counts.any():
        raise InvalidValueError("weights", f"shape {counts.shape}", f"({tosses},) numbers of at least 0, one above")
    return counts
