"""Gradient steps of one transition each, a polytope's in the published form, in the kernel.

At a batch of one nearly all of a step's time is autograd's and Python's. The kernel does whole rows of steps instead: the same
numbers as along the long way but for rounding, fifteen times as fast (benchmarks/training_step.py).
"""

import numpy as np
from numpy.typing import NDArray

from contact_curation.contact.compiled_descent import CompiledDescent
from contact_curation.contact.evaluation import checked_transitions, kernel_is_there
from contact_curation.contact.model import Model
from contact_curation.contact.parameter_form import Form
from contact_curation.contact.polytope_model import PolytopeModel
from contact_curation.learning.optimizer import BETAS, EPSILON, Optimizer
from contact_curation.learning.protocols import TrainingConfig
from contact_curation.motion.transitions import Transitions


class SingleSteps:
    """Steps of one training; made by `of`.

    Args:
        model: a polytope in the published form; its parameters are the optimizer's.
        data: what it learns from.
        config: the protocol, with batches of one.
        optimizer: whose steps they are.

    Raises:
        InvalidValueError: data that the loss is not defined for.
    """

    def __init__(self, model: PolytopeModel, data: Transitions, config: TrainingConfig, optimizer: Optimizer) -> None:
        geometry = model.geometry()
        self._descent = CompiledDescent(
            geometry,
            optimizer.arrays(),
            model.body,
            config.loss,
            *checked_transitions(geometry, data.before, data.after, data.dt),
            regularizer=config.regularizer,
            decay=config.polytope.weight_decay,
            betas=BETAS,
            epsilon=EPSILON,
        )
        self._config, self._optimizer = config, optimizer

    @staticmethod
    def of(model: Model, data: Transitions, config: TrainingConfig, optimizer: Optimizer) -> "SingleSteps | None":
        """Such steps, where they are what a training does."""
        if not isinstance(model, PolytopeModel) or model.form is not Form.CONTACTNETS:
            return None
        alone = config.batch == 1 and not config.exact and kernel_is_there()
        return SingleSteps(model, data, config, optimizer) if alone else None

    def take(self, rows: NDArray[np.int64], step: int, loss_sum: float) -> tuple[int, float]:
        """Takes the steps from number `step` of the budget on down the losses of some rows, one after the other.

        Returns:
            How many: it stops before a row whose loss is not solved or not finite, or whose slope is not. And the sum of their
            losses, added to `loss_sum` in turn.
        """
        rates = self._config.polytope.learning_rate * np.array([self._config.rate(step + k) for k in range(len(rows))])
        taken, loss_sum = self._descent.descend(rows, rates, self._optimizer.steps, loss_sum)
        self._optimizer.stepped(taken)
        return taken, loss_sum
