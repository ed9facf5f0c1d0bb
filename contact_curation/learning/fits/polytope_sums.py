"""Sums over tosses for a polytope in its physical form: per toss the loss, the score and the Fisher matrix.

Unlike the records that rank (`information.scoring`) these are whole matrices about one pivot, neither compressed nor bounded:
from them theta is fitted, and its uncertainty estimated.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from torch.nn.utils import parameters_to_vector, vector_to_parameters

from contact_curation.contact.evaluation import Estimator, SolveStatus, fisher_sums
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form, parameter_form
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.transitions import Transitions


@dataclass(frozen=True, eq=False)
class PolytopeSums:
    """Sums over the solved transitions of each of K tosses, by the P parameters of the physical form.

    Attributes:
        losses: (K,).
        scores: (K, P) s = -dL/dtheta / 2.
        fishers: (K, P, P) of one estimator.
        not_solved: (K,) how many transitions were left out.
    """

    losses: Array
    scores: Array
    fishers: Array
    not_solved: NDArray[np.int64]


def polytope_sums(model: PolytopeModel, data: Transitions, estimator: Estimator, loss: LossConfig) -> PolytopeSums:
    """The sums at a model's theta.

    Raises:
        InvalidValueError: its geometry has no physical form.
    """
    geometry = model.geometry()
    chart = parameter_form(geometry, Form.PHYSICAL).chart
    found = fisher_sums(
        geometry, model.body, data.before, data.after, data.dt, data.starts, estimator, influence_bound=np.inf, config=loss
    )
    solved = found.status == SolveStatus.SOLVED
    fishers = chart.T @ found.fishers @ chart
    return PolytopeSums(
        losses=np.add.reduceat(np.where(solved, found.losses, 0.0), data.starts[:-1]),
        scores=found.score_sums @ chart,
        fishers=0.5 * (fishers + fishers.transpose(0, 2, 1)),
        not_solved=np.add.reduceat((~solved).astype(np.int64), data.starts[:-1]),
    )


def moved(model: PolytopeModel, step: Array) -> PolytopeModel:
    """Another model, whose physical theta is `step` (P,) further on, in the coordinates of `polytope_sums`."""
    other = PolytopeModel(model.geometry(), model.body, Form.PHYSICAL)  # its tilt is zero: the chart is taken about its normal
    theta = parameters_to_vector(other.parameters()).detach()
    vector_to_parameters(theta + theta.new_tensor(step), other.parameters())
    return other


def physical_difference(geometry: ContactGeometry, origin: ContactGeometry) -> Array:
    """(P,) from `origin` to a geometry with the same pivot, in the physical coordinates about the former; see `moved`.

    Raises:
        InvalidValueError: one of them has no physical form.
    """
    for each in (geometry, origin):
        parameter_form(each, Form.PHYSICAL)
    friction, own = (float(np.linalg.norm(each.tangents[0])) for each in (geometry, origin))
    tilt = (origin.tangents / own) @ geometry.normal / (origin.normal @ geometry.normal)
    vertices = (getattr(geometry, name) - getattr(origin, name) for name in ("vertices_normal", "vertices_tangent"))
    shift = geometry.height - origin.height
    return np.concatenate([*(each.ravel() for each in vertices), [np.log(friction / own)], tilt, [shift]])
