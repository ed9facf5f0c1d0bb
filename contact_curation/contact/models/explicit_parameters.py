"""Scores by the parameters outside a model's networks: few, with names, so that they are exact columns (method.md 2.7).

Whatever the estimator, a score is a backward pass from slopes by a model's outputs o, s^T do/dtheta, for each transition by
itself. `ModuleParameters` forms do/dtheta a parameter at a time for whatever a model computes with torch: with weights u on the
outputs, u^T do/dtheta is linear in u, so that its derivative by u is do/dtheta of every transition at once.
"""

from abc import ABC, abstractmethod

import numpy as np
import torch
from torch import Tensor

from contact_curation.contact.models.rows import Rows
from contact_curation.contact.parameter_form import Block
from contact_curation.contact.torch_contacts import Frames
from contact_curation.geometry.quaternions import Array


class ExplicitParameters(ABC):
    """The P parameters of a model outside its networks, at its theta.

    Attributes:
        blocks: names and sizes of the runs of parameters.
        tilt_axes: (2, 3) directions of the board in which block "tilt" moves the ground's normal; (0, 3) without one.
        pivot: (3,) about which it does, characteristic lengths.
    """

    blocks: tuple[Block, ...]
    tilt_axes: Array = np.zeros((0, 3))
    pivot: Array = np.zeros(3)

    @property
    def size(self) -> int:
        """P."""
        return sum(block.size for block in self.blocks)

    @abstractmethod
    def scores(self, rows: Rows, frames: Frames, slopes: tuple[Tensor, ...]) -> Array:
        """Scores (n, B, P) of B transitions, also as frames, from slopes (n, B, ...) by each output."""


class ModuleParameters(ExplicitParameters):
    """Parameters of any module that gives its outputs when it is called with rows.

    Args:
        module: a model; its operations can be differentiated twice, as torch's own.
        names: of its parameters.
    """

    def __init__(self, module: torch.nn.Module, names: tuple[str, ...]) -> None:
        self._module = module
        self._values = {name: module.get_parameter(name).detach() for name in names}
        self.blocks = tuple(Block(name, value.numel()) for name, value in self._values.items())

    def scores(self, rows: Rows, frames: Frames, slopes: tuple[Tensor, ...]) -> Array:
        values = {name: value.clone().requires_grad_() for name, value in self._values.items()}
        outputs = torch.func.functional_call(self._module, values, (rows,))
        parts = [(output, slope) for output, slope in zip(outputs, slopes, strict=True) if output.requires_grad]
        weights = [torch.zeros_like(output, requires_grad=True) for output, _ in parts]
        sums = torch.autograd.grad(
            [output for output, _ in parts], list(values.values()), weights, create_graph=True, materialize_grads=True
        )
        columns = []
        for element in torch.cat([value.flatten() for value in sums]):
            changes = torch.autograd.grad(element, weights, retain_graph=True, materialize_grads=True)  # do/dtheta_p, (B, ...)
            each = [(slope * change).flatten(2).sum(dim=2) for (_, slope), change in zip(parts, changes, strict=True)]
            columns.append(torch.stack(each).sum(dim=0))  # (n, B)
        return torch.stack(columns, dim=-1).cpu().numpy()
