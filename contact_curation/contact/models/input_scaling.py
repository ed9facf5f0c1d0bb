"""Inputs of a network shifted and scaled to mean 0 and standard deviation 1 over the training data; constants, not trained."""

import numpy as np
import torch
from torch import Tensor

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array

CONSTANT = 1e-9
"""An input with a standard deviation up to this never varies; it is fed as zero."""


class InputScaling(torch.nn.Module):
    """(inputs - mean) * scale over the last axis of D numbers; it passes them as they are until it is fitted or loaded."""

    mean: Tensor
    scale: Tensor

    def __init__(self, width: int) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(width, dtype=torch.float64))
        self.register_buffer("scale", torch.ones(width, dtype=torch.float64))

    def fit(self, inputs: Array) -> "InputScaling":
        """To the N >= 2 rows of `inputs` (N, D), by their mean and unbiased standard deviation.

        Raises:
            InvalidValueError: fewer rows.
        """
        if len(inputs) < 2:
            raise InvalidValueError("data", f"{len(inputs)} transitions", "at least 2 to normalise a network's inputs by")
        deviation = inputs.std(axis=0, ddof=1)
        varies = deviation > CONSTANT
        self.mean.copy_(torch.as_tensor(inputs.mean(axis=0)))
        self.scale.copy_(torch.as_tensor(np.where(varies, 1.0 / np.where(varies, deviation, 1.0), 0.0)))
        return self

    def forward(self, inputs: Tensor) -> Tensor:
        return (inputs - self.mean) * self.scale
