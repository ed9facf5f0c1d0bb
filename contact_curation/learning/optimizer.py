"""AdamW over a model, the networks' parameters apart from the polytope's, with its moments as named tensors."""

from collections.abc import Mapping

import numpy as np
import torch
from torch import Tensor

from contact_curation.contact.model import Model
from contact_curation.errors import InvalidValueError
from contact_curation.learning.protocols import Pace, TrainingConfig

MOMENTS = ("step", "exp_avg", "exp_avg_sq")
"""What AdamW remembers of each parameter."""


class Optimizer:
    """AdamW with a pace for each kind of parameter. It remembers its moments.

    Args:
        model: whose parameters it changes.
        config: paces and schedule.
    """

    def __init__(self, model: Model, config: TrainingConfig) -> None:
        trained = {name: value for name, value in model.named_parameters() if value.requires_grad}
        inside = {
            id(value) for module in model.modules() if isinstance(module, torch.nn.Linear) for value in module.parameters()
        }
        groups = (
            ([value for value in trained.values() if id(value) not in inside], config.polytope),
            ([value for value in trained.values() if id(value) in inside], config.network),
        )
        self._config = config
        self._parameters = trained
        self._gradient = torch.zeros(sum(value.numel() for value in trained.values()), dtype=torch.float64)
        pieces = torch.split(self._gradient, [value.numel() for value in trained.values()])
        self._slopes = [piece.view(value.shape) for piece, value in zip(pieces, trained.values())]
        self._paces = [pace for values, pace in groups if values]
        self._adam = torch.optim.AdamW([_group(values, pace) for values, pace in groups if values], fused=True)

    def minimize(self, objective: Tensor, step: int) -> bool:
        """Takes step number `step` of the budget down `objective`, if its gradient is finite; says whether it is."""
        self._gradient.zero_()
        for parameter, slope in zip(self._parameters.values(), self._slopes):
            parameter.grad = slope  # all of one array, so that it is cleared and looked at in one go
        objective.backward()  # type: ignore[no-untyped-call]
        if not np.isfinite(self._gradient.numpy().sum()):
            return False
        share = self._config.rate(step)
        for group, pace in zip(self._adam.param_groups, self._paces, strict=True):
            group["lr"] = share * pace.learning_rate
        self._adam.step()
        return True

    def moments(self) -> dict[str, Tensor]:
        """Copies of what it remembers, by ``parameter/moment``; nothing before the first step."""
        return {
            f"{name}/{moment}": value.clone()
            for name, parameter in self._parameters.items()
            for moment, value in self._adam.state[parameter].items()
        }

    def restore(self, moments: Mapping[str, Tensor]) -> None:
        """Goes on with the `moments` of another one of the same model.

        Raises:
            InvalidValueError: moments that are missing, too many, of another shape, or not finite.
        """
        for name, parameter in self._parameters.items():
            shapes = {"step": torch.Size([]), "exp_avg": parameter.shape, "exp_avg_sq": parameter.shape}
            found = {moment: moments[f"{name}/{moment}"] for moment in MOMENTS if f"{name}/{moment}" in moments}
            if found and {moment: value.shape for moment, value in found.items()} != shapes:
                raise InvalidValueError("optimizer", f"moments of {name} that do not fit", "three of the parameter's shape")
            if not all(bool(torch.isfinite(value).all()) for value in found.values()):
                raise InvalidValueError("optimizer", f"moments of {name} that are not finite", "finite numbers")
            self._adam.state[parameter] = {moment: value.clone() for moment, value in found.items()}
        unknown = set(moments) - {f"{name}/{moment}" for name in self._parameters for moment in MOMENTS}
        if unknown:
            raise InvalidValueError("optimizer", f"moments named {min(unknown)[:60]!r}", "those of the model's parameters")


def _group(parameters: list[torch.nn.Parameter], pace: Pace) -> dict[str, object]:
    return {"params": parameters, "lr": pace.learning_rate, "weight_decay": pace.weight_decay}
