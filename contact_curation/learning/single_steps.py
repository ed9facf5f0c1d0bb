"""Gradient steps of one transition each, a polytope's in the published form, straight from the kernel.

At a batch of one nearly all of a step's time is autograd's and Python's. Here the kernel's score is the gradient, to which the
regulariser's slope is added: the same numbers as along the long way, several times as fast (benchmarks/training_step.py).
"""

import numpy as np

from contact_curation.contact.compiled_evaluation import RowByRow
from contact_curation.contact.evaluation import checked_transitions, kernel_is_there
from contact_curation.contact.model import Model
from contact_curation.contact.parameter_form import Form
from contact_curation.contact.polytope_model import PolytopeModel
from contact_curation.contact.scale_regularizer import excess_and_slopes
from contact_curation.learning.optimizer import Optimizer
from contact_curation.learning.protocols import TrainingConfig
from contact_curation.motion.transitions import Transitions

THETA = ("vertices_normal", "normal", "vertices_tangent", "tangents")
"""The published form's parameters, in the kernel's order."""


class SingleSteps:
    """Steps of one training; made by `of`.

    Args:
        model: a polytope in the published form; its parameters are the optimizer's.
        data: what it learns from.
        config: the protocol, with batches of one.
        optimizer: takes the steps.

    Raises:
        InvalidValueError: data that the loss is not defined for.
    """

    def __init__(self, model: PolytopeModel, data: Transitions, config: TrainingConfig, optimizer: Optimizer) -> None:
        geometry = model.geometry()
        own = {name: value.detach().numpy() for name, value in model.named_parameters()}
        self._theta = {name: own[name] for name in THETA}
        rows = checked_transitions(geometry, data.before, data.after, data.dt)
        self._rows = RowByRow(geometry, self._theta, model.body, config.loss, *rows)
        edges = np.cumsum([0, *(value.size for value in self._theta.values())])
        gradients = {name: value.numpy() for name, value in optimizer.gradients.items()}
        self._slopes = [
            (gradients[name], self._rows.score[first:last].reshape(gradients[name].shape))
            for name, first, last in zip(THETA, edges[:-1], edges[1:], strict=True)
        ]
        self._normal, self._tangents = gradients["normal"], gradients["tangents"]
        self._weight = config.regularizer * geometry.vertex_count  # the same at every contact
        self._optimizer = optimizer

    @staticmethod
    def of(model: Model, data: Transitions, config: TrainingConfig, optimizer: Optimizer) -> "SingleSteps | None":
        """Such steps, where they are what a training does."""
        if not isinstance(model, PolytopeModel) or model.form is not Form.CONTACTNETS:
            return None
        alone = config.batch == 1 and not config.exact and kernel_is_there()
        return SingleSteps(model, data, config, optimizer) if alone else None

    def take(self, row: int, step: int) -> float | None:
        """Takes step number `step` of the budget down the loss of a row, and gives that loss.

        None, and nothing has changed, where the loss is not solved or not finite, or its slope is not.
        """
        loss = self._rows.loss(row)
        if loss is None or not np.isfinite(loss):
            return None
        for slope, score in self._slopes:
            np.multiply(score, -2.0, out=slope)
        _, by_normal, by_tangents = excess_and_slopes(self._theta["normal"], self._theta["tangents"])
        self._normal += self._weight * by_normal
        self._tangents += self._weight * by_tangents
        return loss if self._optimizer.descend(step) else None
