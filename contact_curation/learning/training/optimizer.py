"""AdamW over a model, the networks' parameters apart from all others, with its moments as named tensors.

At a batch of one, as ContactNets trains, nearly all of a step's time is autograd's and Python's. The kernel does whole rows of
steps instead (`SingleSteps`): the same numbers as along the long way but for rounding, several times as fast
(benchmarks/speed/training_step.py). It knows every published model, those with a polytope in the published form.
"""

from collections.abc import Mapping

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.optim.adamw import adamw

from contact_curation.contact.compiled.descent import (
    CompiledAdamW,
    DescentRows,
    DescentRules,
    DescentTask,
    KernelDescent,
    Moments,
)
from contact_curation.contact.models.model import Model
from contact_curation.errors import InvalidValueError
from contact_curation.learning.training.protocols import AdamWConfig, TrainingConfig
from contact_curation.motion.transitions import Transitions

MOMENTS = ("step", "exp_avg", "exp_avg_sq")
"""What AdamW remembers of each parameter."""

BETAS, EPSILON = (0.9, 0.999), 1e-8
"""AdamW's own defaults."""


class Optimizer:
    """AdamW with a configuration for each kind of parameter. It remembers its moments.

    The parameters of one kind become views of one array, which torch's function sees as a single parameter: at small batches
    its time is the number of parameters, not their size, and torch's class would take three times as long.

    Args:
        model: whose parameters it changes.
        config: learning rates, weight decays and schedule.
    """

    def __init__(self, model: Model, config: TrainingConfig) -> None:
        trained = {name: value for name, value in model.named_parameters() if value.requires_grad}
        inside = {
            id(value) for module in model.modules() if isinstance(module, torch.nn.Linear) for value in module.parameters()
        }
        kinds = (
            ({name: value for name, value in trained.items() if id(value) not in inside}, config.polytope),
            ({name: value for name, value in trained.items() if id(value) in inside}, config.network),
        )
        self._config = config
        self._blocks = [_Block(parameters, own) for parameters, own in kinds if parameters]

    def minimize(self, objective: Tensor, step: int) -> bool:
        """Takes step number `step` of the budget down `objective`, if its gradient is finite; says whether it is."""
        for block in self._blocks:
            block.clear()
        objective.backward()  # type: ignore[no-untyped-call]
        if not all(np.isfinite(block.gradient.numpy().sum()) for block in self._blocks):
            return False
        share = self._config.rate(step)
        for block in self._blocks:
            block.descend(share)
        return True

    def arrays(self) -> dict[str, Moments]:
        """Parameters and moments by name, for whoever takes the steps in its place and says so by `stepped`."""
        return {name: found for block in self._blocks for name, found in block.arrays().items()}

    @property
    def steps(self) -> int:
        """That were taken."""
        return max(int(block.step) for block in self._blocks)

    def stepped(self, steps: int) -> None:
        """So many steps were taken in its place."""
        for block in self._blocks:
            block.step += steps

    def moments(self) -> dict[str, Tensor]:
        """Copies of what it remembers, by ``parameter/moment``; nothing before the first step."""
        return {name: value.clone() for block in self._blocks for name, value in block.moments().items()}

    def restore(self, moments: Mapping[str, Tensor]) -> None:
        """Goes on with the `moments` of another one of the same model.

        Raises:
            InvalidValueError: moments that are missing, too many, of another shape, or not finite.
        """
        known = {key for block in self._blocks for name in block.parameters for key in _keys(name)}
        unknown = set(moments) - known
        if unknown:
            raise InvalidValueError("optimizer", f"moments named {min(unknown)[:60]!r}", "those of the model's parameters")
        for block in self._blocks:
            block.restore(moments)
        if len({int(block.step) for block in self._blocks}) > 1:
            raise InvalidValueError("optimizer", "moments of a part of the parameters", "of all of them, or of none")


class _Block:
    """Parameters of one kind as views of one array, with their gradients and AdamW's moments in arrays like it."""

    def __init__(self, parameters: Mapping[str, torch.nn.Parameter], config: AdamWConfig) -> None:
        self.parameters = dict(parameters)
        self._config = config
        self._flat = torch.cat([value.detach().flatten() for value in parameters.values()])
        self.gradient = torch.zeros_like(self._flat)
        self.step = torch.zeros(())
        self._first, self._second = torch.zeros_like(self._flat), torch.zeros_like(self._flat)
        for name, view in self._pieces(self._flat).items():
            self.parameters[name].data = view
        self._slopes = list(zip(self.parameters.values(), self._pieces(self.gradient).values(), strict=True))

    def clear(self) -> None:
        """Zero gradients, where autograd adds to them."""
        self.gradient.zero_()
        for parameter, slope in self._slopes:
            parameter.grad = slope

    def arrays(self) -> dict[str, Moments]:
        """Views by parameter."""
        pieces = (self._pieces(flat) for flat in (self._flat, self._first, self._second))
        theta, first, second = ({name: piece.numpy() for name, piece in each.items()} for each in pieces)
        return {name: Moments(theta[name], first[name], second[name]) for name in self.parameters}

    def descend(self, share: float) -> None:
        """One step at this share of the learning rate."""
        adamw(
            [self._flat], [self.gradient], [self._first], [self._second], [], [self.step],
            foreach=False, fused=True, amsgrad=False, maximize=False,
            beta1=BETAS[0], beta2=BETAS[1], eps=EPSILON, lr=share * self._config.learning_rate,
            weight_decay=self._config.weight_decay,
        )  # fmt: skip

    def moments(self) -> dict[str, Tensor]:
        """What is remembered, by ``parameter/moment``; nothing before the first step."""
        if not self.step:
            return {}
        first, second = self._pieces(self._first), self._pieces(self._second)
        return {
            key: value
            for name in self.parameters
            for key, value in zip(_keys(name), (self.step, first[name], second[name]), strict=True)
        }

    def restore(self, moments: Mapping[str, Tensor]) -> None:
        """Takes over those of its parameters; with none for any of them it starts over."""
        own = {name: [moments[key] for key in _keys(name) if key in moments] for name in self.parameters}
        for name, found in own.items():
            shape = self.parameters[name].shape
            if [value.shape for value in found] not in ([], [torch.Size([]), shape, shape]):
                raise InvalidValueError("optimizer", f"moments of {name} that do not fit", "three of the parameter's shape")
            if not all(bool(torch.isfinite(value).all()) for value in found):
                raise InvalidValueError("optimizer", f"moments of {name} that are not finite", "finite numbers")
        steps = sorted({float(found[0]) if found else 0.0 for found in own.values()})
        if len(steps) > 1:
            raise InvalidValueError("optimizer", f"moments after {steps} steps", "after as many steps for each parameter")
        self.step.fill_(steps[0])
        for place, pieces in ((1, self._pieces(self._first)), (2, self._pieces(self._second))):
            for name, piece in pieces.items():
                piece.copy_(own[name][place]) if own[name] else piece.zero_()

    def _pieces(self, flat: Tensor) -> dict[str, Tensor]:
        """Views of an array like the parameters' own, by name, in their shapes."""
        pieces = torch.split(flat, [value.numel() for value in self.parameters.values()])
        return {name: piece.view(value.shape) for (name, value), piece in zip(self.parameters.items(), pieces, strict=True)}


def _keys(name: str) -> list[str]:
    return [f"{name}/{moment}" for moment in MOMENTS]


class SingleSteps:
    """Gradient steps of one transition each of one training, in the kernel; made by `of`.

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
            data: what it learns from (`data.checked`).
            config: the protocol.
            optimizer: whose steps they are.
        """
        alone = config.batch == 1 and not config.exact
        if not (alone and all(value.requires_grad for value in model.parameters())):
            return None
        rows = DescentRows(data.before, data.after, data.dt)
        rules = DescentRules(config.loss, config.regularizer, BETAS, EPSILON)
        polytope, network = (CompiledAdamW(each.learning_rate, each.weight_decay) for each in (config.polytope, config.network))
        descent = model.kernel_descent(DescentTask(optimizer.arrays(), rows, rules, polytope, network))
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
