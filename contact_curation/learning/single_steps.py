"""Gradient steps of one transition each, as ContactNets trains, in the kernel.

At a batch of one nearly all of a step's time is autograd's and Python's. The kernel does whole rows of steps instead: the same
numbers as along the long way but for rounding, several times as fast (benchmarks/training_step.py). It knows every model, those
with a polytope in the published form.
"""

import numpy as np
from numpy.typing import NDArray

from contact_curation.contact.compiled_descent import CompiledDescent
from contact_curation.contact.compiled_network_descent import CompiledNetworkDescent, NetworkModel, fixed_geometry
from contact_curation.contact.deep_model import DeepModel
from contact_curation.contact.deepvertex_model import DeepvertexModel
from contact_curation.contact.end_to_end_model import EndToEndModel
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
        descent: takes them.
        config: the protocol, with batches of one.
        optimizer: whose steps they are.
        rate: learning rate that `descent` takes with each row: that of the protocol, or 1 where it knows that already.
    """

    def __init__(
        self, descent: CompiledDescent | CompiledNetworkDescent, config: TrainingConfig, optimizer: Optimizer, rate: float
    ) -> None:
        self._descent, self._config, self._optimizer, self._rate = descent, config, optimizer, rate

    @staticmethod
    def of(model: Model, data: Transitions, config: TrainingConfig, optimizer: Optimizer) -> "SingleSteps | None":
        """Such steps, where they are what a training does.

        Args:
            model: its parameters are the optimizer's.
            data: what it learns from.
            config: the protocol.
            optimizer: whose steps they are.

        Raises:
            InvalidValueError: data that the loss is not defined for.
        """
        if config.batch > 1 or config.exact or not kernel_is_there():
            return None
        match model:
            case PolytopeModel(form=Form.CONTACTNETS):
                steps = _of_polytope(model, data, config, optimizer)
                return SingleSteps(steps, config, optimizer, config.polytope.learning_rate)
            case DeepModel(polytope=PolytopeModel(form=Form.CONTACTNETS)) | DeepvertexModel() | EndToEndModel():
                return SingleSteps(_of_networks(model, data, config, optimizer), config, optimizer, 1.0)
            case _:
                return None

    def take(self, rows: NDArray[np.int64], step: int, loss_sum: float) -> tuple[int, float]:
        """Takes the steps from number `step` of the budget on down the losses of some rows, one after the other.

        Returns:
            How many: it stops before a row whose loss is not solved or not finite, or whose slope is not. And the sum of their
            losses, added to `loss_sum` in turn.
        """
        rates = self._rate * np.array([self._config.rate(step + k) for k in range(len(rows))])
        taken, loss_sum = self._descent.descend(rows, rates, self._optimizer.steps, loss_sum)
        self._optimizer.stepped(taken)
        return taken, loss_sum


def _of_polytope(model: PolytopeModel, data: Transitions, config: TrainingConfig, optimizer: Optimizer) -> CompiledDescent:
    geometry = model.geometry()
    return CompiledDescent(
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


def _of_networks(
    model: NetworkModel, data: Transitions, config: TrainingConfig, optimizer: Optimizer
) -> CompiledNetworkDescent:
    geometry = fixed_geometry(model)
    return CompiledNetworkDescent(
        model,
        geometry,
        optimizer.arrays(),
        config.loss,
        *checked_transitions(geometry, data.before, data.after, data.dt),
        regularizer=config.regularizer,
        polytope=(config.polytope.learning_rate, config.polytope.weight_decay),
        network=(config.network.learning_rate, config.network.weight_decay),
        betas=BETAS,
        epsilon=EPSILON,
    )
