"""Gradient steps of one transition each, as ContactNets trains, in the kernel.

At a batch of one nearly all of a step's time is autograd's and Python's. The kernel does whole rows of steps instead: the same
numbers as along the long way but for rounding, several times as fast (benchmarks/speed/training_step.py). It knows every model,
those with a polytope in the published form.
"""

import numpy as np
from numpy.typing import NDArray

from contact_curation.contact.compiled.descent import DescentRows, DescentRules, KernelDescent, StepPace, polytope_descent
from contact_curation.contact.compiled.network_descent import fits_kernel, network_descent
from contact_curation.contact.evaluation import kernel_is_there
from contact_curation.contact.models.deep import DeepModel
from contact_curation.contact.models.deepvertex import DeepvertexModel
from contact_curation.contact.models.end_to_end import EndToEndModel
from contact_curation.contact.models.model import Model
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form
from contact_curation.learning.training.optimizer import BETAS, EPSILON, Optimizer
from contact_curation.learning.training.protocols import Pace, TrainingConfig
from contact_curation.motion.transitions import Transitions
from contact_curation.solver.cone_problem import MAX_CONTACTS


class SingleSteps:
    """Steps of one training; made by `of`.

    Args:
        descent: takes them.
        config: the protocol, with batches of one.
        optimizer: whose steps they are.
    """

    def __init__(self, descent: KernelDescent, config: TrainingConfig, optimizer: Optimizer) -> None:
        self._descent, self._config, self._optimizer = descent, config, optimizer

    @staticmethod
    def of(model: Model, data: Transitions, config: TrainingConfig, optimizer: Optimizer) -> "SingleSteps | None":
        """Such steps, where they are what a training does.

        Args:
            model: its parameters are the optimizer's.
            data: what it learns from (`training_data.checked`).
            config: the protocol.
            optimizer: whose steps they are.
        """
        alone = config.batch == 1 and not config.exact and kernel_is_there()
        if not (alone and all(value.requires_grad for value in model.parameters())):
            return None
        descent = _descent(model, data, config, optimizer)
        return None if descent is None else SingleSteps(descent, config, optimizer)

    def take(self, rows: NDArray[np.int64], step: int, loss_sum: float) -> tuple[int, float]:
        """Takes the steps from number `step` of the budget on down the losses of some rows, one after the other.

        Returns:
            How many: it stops before a row whose loss is not solved or not finite, or whose slope is not. And the sum of their
            losses, added to `loss_sum` in turn.
        """
        shares = np.array([self._config.rate(step + k) for k in range(len(rows))])
        taken, loss_sum = self._descent.descend(rows, shares, self._optimizer.steps, loss_sum)
        self._optimizer.stepped(taken)
        return taken, loss_sum


def _descent(model: Model, data: Transitions, config: TrainingConfig, optimizer: Optimizer) -> KernelDescent | None:
    rows = DescentRows(data.before, data.after, data.dt)
    rules = DescentRules(config.loss, config.regularizer, BETAS, EPSILON)
    polytope, network = (_step_pace(pace) for pace in (config.polytope, config.network))
    match model:
        case PolytopeModel(form=Form.CONTACTNETS) if model.geometry().vertex_count <= MAX_CONTACTS:
            return polytope_descent(model.geometry(), model.body, optimizer.arrays(), rows, rules, polytope)
        case DeepModel() | DeepvertexModel() | EndToEndModel() if fits_kernel(model):
            return network_descent(model, optimizer.arrays(), rows, rules, polytope, network)
        case _:
            return None


def _step_pace(pace: Pace) -> StepPace:
    return StepPace(pace.learning_rate, pace.weight_decay)
