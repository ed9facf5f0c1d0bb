"""Learns how the variance of residuals grows with impacts, by likelihood (contact/impulse_noise.py).

With sigma_0^2 at its optimum, the Gaussian likelihood of N transitions with losses L and relative variances v is largest where

    log mean_t (L_t / v_t) + mean_t log v_t

is smallest. The number of residuals of a transition does not matter, as long as all transitions have the same.
"""

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import minimize

from contact_curation.contact.evaluation import predicted_impulses
from contact_curation.contact.impulse_noise import LARGEST_GROWTH, LARGEST_POWER, LEAST_POWER, ImpulseNoise
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.models.rows import Rows
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.evaluation.evaluation import transition_losses
from contact_curation.motion.transitions import Transitions

STARTS = (ImpulseNoise(), ImpulseNoise(10.0, 1.0))
"""Starting points of the search: the likelihood may have several maxima, and the best result counts."""


def noise_of_model(model: PolytopeModel, data: Transitions, loss: LossConfig) -> ImpulseNoise:
    """The noise under which a model's residuals on tosses are most likely."""
    losses, solved = transition_losses(model, Rows(data.before, data.after, data.dt), loss)
    impulses = predicted_impulses(model.geometry(), model.body, data.before, data.dt)
    return learned_noise(losses[solved], impulses[solved])


def learned_noise(losses: ArrayLike, impulses: ArrayLike) -> ImpulseNoise:
    """The noise under which the losses of N transitions are most likely.

    Args:
        losses: (N,) losses of solved transitions.
        impulses: (N,) predicted normal impulses, relative to those of the body at rest.

    Raises:
        InvalidValueError: there is no transition, or the shapes differ.
    """
    each, relative = np.asarray(losses, dtype=float), np.nan_to_num(np.asarray(impulses, dtype=float))
    if each.shape != relative.shape or each.ndim != 1 or not each.size:
        raise InvalidValueError("losses and impulses", f"shapes {each.shape} and {relative.shape}", "(N,) both, N at least 1")
    if not each.any() or relative.max() <= 1.0:
        return ImpulseNoise(0.0)

    def surprise(coordinates: Array) -> float:
        variances = _noise(coordinates).exact_variances(relative)
        return float(np.log(np.mean(each / variances)) + np.mean(np.log(variances)))

    starts = [np.array([np.log(noise.growth), noise.power]) for noise in STARTS]
    ends = [minimize(surprise, start, method="Nelder-Mead", options={"xatol": 1e-3, "fatol": 1e-6}) for start in starts]
    best = min(ends, key=lambda end: float(end.fun))
    uniform = float(np.log(np.mean(each)))
    return _noise(best.x) if best.fun < uniform else ImpulseNoise(0.0)


def _noise(coordinates: Array) -> ImpulseNoise:
    """The noise with the parameters (log a, p), clipped to their bounds."""
    growth = np.exp(np.clip(coordinates[0], -20.0, np.log(LARGEST_GROWTH)))
    return ImpulseNoise(min(float(growth), LARGEST_GROWTH), float(np.clip(coordinates[1], LEAST_POWER, LARGEST_POWER)))
