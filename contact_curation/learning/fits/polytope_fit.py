"""Fits a polytope to tosses to the last digit: the optimum of the weighted loss, by damped Gauss-Newton steps.

    H = sum_k w_k F_k the Gauss-Newton information,  s = sum_k w_k s_k the score,     over tosses k

That makes it the tool for questions about the optimum itself, such as how far it moves when tosses are re-drawn; a network
has no such matrices. In the rigid form the transitions keep the variances that they have where the fit begins.
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
        loss: what is minimised.
        tolerance: relative decrease of the loss by a step that counts as arrival.
        max_steps: tried ones, taken or not.
        damping: d of the first step.
        largest_damping: where a step as small as this makes it finds no lower loss, there is none that rounding can tell.
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
        model: in the physical or the rigid form.
        loss: weighted sum over all solved transitions.
        steps: how many were tried.
        converged: whether the last one was as small as wanted.
        not_solved: transitions without a certificate there.
    """

    model: PolytopeModel
    loss: float
    steps: int
    converged: bool
    not_solved: int


FLOOR = 1e-12
"""Share of the mean diagonal that is always added: a vertex that never came near the board stays where it is."""


def fit_polytope(
    model: PolytopeModel, data: Transitions, config: FitConfig | None = None, weights: ArrayLike | None = None
) -> PolytopeFit:
    """The optimum next to a model.

    Args:
        model: where to begin; it is not changed.
        data: at least one toss.
        config: when to end.
        weights: (K,) how often each toss counts, at least 0; once each by default.

    Raises:
        InvalidValueError: weights that do not fit, or a geometry that is not physical.
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
    """How often each of K tosses counts (K,); once by default.

    Raises:
        InvalidValueError: weights that do not fit.
    """
    counts = np.ones(tosses) if weights is None else np.asarray(weights, dtype=float)
    if counts.shape != (tosses,) or not np.isfinite(counts).all() or counts.min() < 0.0 or not counts.any():
        raise InvalidValueError("weights", f"shape {counts.shape}", f"({tosses},) numbers of at least 0, one above")
    return counts
