"""Loss, score and Fisher matrix of each toss, for a polytope in the physical or the rigid form.

Theta is fitted with them, and its uncertainty is estimated from them. Unlike the records for ranking
(`information.scoring`) they are full matrices about one pivot, without compression and without a bound on influence.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from torch.nn.utils import parameters_to_vector, vector_to_parameters

from contact_curation.contact.evaluation import Estimator, SolveStatus, fisher_sums, transition_weights
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form, parameter_form
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.transitions import Transitions

RESTITUTION_PLACE = -5
"""Of the rigid form's theta: before friction, tilt (2) and height."""


@dataclass(frozen=True, eq=False)
class PolytopeSums:
    """Sums over the solved transitions of each of K tosses, by the P parameters of the model's form.

    Attributes:
        losses: (K,) weighted sums of the losses.
        scores: (K, P) s = -dL/dtheta / 2.
        fishers: (K, P, P) Fisher matrices.
        not_solved: (K,) numbers of transitions without a certificate, which are left out.
    """

    losses: Array
    scores: Array
    fishers: Array
    not_solved: NDArray[np.int64]


def polytope_sums(
    model: PolytopeModel, data: Transitions, estimator: Estimator, loss: LossConfig, weights: Array | None = None
) -> PolytopeSums:
    """Computes the sums at a model's theta.

    Args:
        model: polytope in the physical or the rigid form; a model in the contactnets form is converted to the physical one.
        data: N transitions of K tosses.
        estimator: estimator of the Fisher matrices.
        loss: weights and solver of the loss.
        weights: (N,) weights of the transitions' losses; by default those that follow from the model's own noise.

    Raises:
        InvalidValueError: the model's geometry has no physical form.
    """
    geometry = model.geometry()
    chart = parameter_form(geometry, fitted_form(model)).chart
    if weights is None:
        weights = transition_weights(geometry, model.body, data.before, data.dt)
    found = fisher_sums(
        geometry, model.body, data.before, data.after, data.dt, data.starts, estimator, config=loss, weights=weights
    )
    solved = found.status == SolveStatus.SOLVED
    losses = found.losses if weights is None else weights * found.losses
    fishers = chart.T @ found.fishers @ chart
    return PolytopeSums(
        losses=np.add.reduceat(np.where(solved, losses, 0.0), data.starts[:-1]),
        scores=found.score_sums @ chart,
        fishers=0.5 * (fishers + fishers.transpose(0, 2, 1)),
        not_solved=np.add.reduceat((~solved).astype(np.int64), data.starts[:-1]),
    )


def moved(model: PolytopeModel, step: Array) -> PolytopeModel:
    """The model with theta changed by `step` (P,), in the coordinates of `polytope_sums`."""
    other = PolytopeModel(model.geometry(), model.body, fitted_form(model))  # tilts are measured from the model's own normal
    theta = parameters_to_vector(other.parameters()).detach()
    vector_to_parameters(theta + theta.new_tensor(step), other.parameters())
    other.limit()
    return other


def fitted_form(model: PolytopeModel) -> Form:
    """The form in which a polytope is fitted: its own, or the physical form for a model in the contactnets form."""
    return Form.RIGID if model.form is Form.RIGID else Form.PHYSICAL


def fixed_restitution(model: PolytopeModel, score: Array, held: bool) -> int | None:
    """The place in theta of a restitution that no step may move: it is held, or the score (P,) points beyond its bound."""
    restitution = model.geometry().restitution
    if restitution is None:
        return None
    place = len(score) + RESTITUTION_PLACE
    beyond = (restitution <= 0.0 and score[place] < 0.0) or (restitution >= 1.0 and score[place] > 0.0)
    return place if held or beyond else None


def physical_difference(geometry: ContactGeometry, origin: ContactGeometry) -> Array:
    """The change of theta (P,) from `origin` to a geometry with the same pivot, in the coordinates of `moved`.

    Raises:
        InvalidValueError: one of the geometries has no physical or rigid form.
    """
    form = Form.PHYSICAL if origin.noise is None else Form.RIGID
    names = [block.name for block in parameter_form(origin, form).blocks if block.name.startswith("vertices")]
    parameter_form(geometry, form)
    friction, own = (float(np.linalg.norm(each.tangents[0])) for each in (geometry, origin))
    tilt = (origin.tangents / own) @ geometry.normal / (origin.normal @ geometry.normal)
    vertices = (getattr(geometry, name) - getattr(origin, name) for name in names)
    shift = geometry.height - origin.height
    bounce = [] if origin.restitution is None else [(geometry.restitution or 0.0) - origin.restitution]
    return np.concatenate([*(each.ravel() for each in vertices), bounce, [np.log(friction / own)], tilt, [shift]])
