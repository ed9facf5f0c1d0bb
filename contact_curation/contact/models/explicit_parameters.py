"""Scores by the parameters outside a model's networks: few, with names, so that they are exact columns (METHOD 2.7).

Whatever the estimator, a score is a backward pass from slopes by a model's outputs o, s^T do/dtheta, for each transition by
itself. `ModuleParameters` forms do/dtheta in forward mode, a parameter at a time, for whatever a model computes with torch.
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
        module: a model; its operations have a forward mode, as torch's own do.
        names: of its parameters.
    """

    def __init__(self, module: torch.nn.Module, names: tuple[str, ...]) -> None:
        self._module = module
        self._values = {name: module.get_parameter(name).detach() for name in names}
        self.blocks = tuple(Block(name, value.numel()) for name, value in self._values.items())

    def scores(self, rows: Rows, frames: Frames, slopes: tuple[Tensor, ...]) -> Array:
        def outputs(values: dict[str, Tensor]) -> tuple[Tensor, ...]:
            return tuple(torch.func.functional_call(self._module, values, (rows,)))

        columns = []
        for name, value in self._values.items():
            for direction in torch.eye(value.numel(), dtype=value.dtype):
                along = {each: torch.zeros_like(other) for each, other in self._values.items()}
                along[name] = direction.reshape(value.shape)
                change = torch.func.jvp(outputs, (self._values,), (along,))[1]
                parts = [(one * other).flatten(2).sum(dim=2) for one, other in zip(slopes, change, strict=True)]
                columns.append(torch.stack(parts).sum(dim=0))  # (n, B)
        return torch.stack(columns, dim=-1).numpy()
