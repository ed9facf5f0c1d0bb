"""Bounded influence: a few transitions with huge losses, glitches first of all, do not rule the gradient (METHOD 2.1).

With a bound c on the loss L = r^2 a transition counts as

    Huber    L                   up to c, then 2 sqrt(c L) - c        weight min(1, sqrt(c / L))
    Geman    L / (1 + L / c)                                          weight (1 + L / c)^-2

c is a multiple of a quantile of the losses of the batch itself, so that it means the same at a random initialisation and at the
optimum. Impacts, a few in a hundred transitions, have losses of several times the quantile; glitches of the tracker, hundreds.
"""

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import torch
from torch import Tensor

from contact_curation.errors import InvalidValueError


class InfluenceShape(StrEnum):
    """How a large loss is bounded: its root grows on with constant slope, or its slope falls to nothing."""

    HUBER = "huber"
    GEMAN = "geman"


@dataclass(frozen=True)
class InfluenceBound:
    """Which losses count as large, and what becomes of them.

    Attributes:
        quantile: of a batch's losses; 1 for no bound.
        multiple: of the quantile that is the bound.
        least: the bound is no lower, so that where nearly all is explained the rest still counts.
        shape: of what happens above.
    """

    quantile: float = 1.0
    multiple: float = 1.0
    least: float = 0.0
    shape: InfluenceShape = InfluenceShape.HUBER

    def __post_init__(self) -> None:
        if not 0.0 < self.quantile <= 1.0:
            raise InvalidValueError("influence.quantile", self.quantile, "a number over 0, up to 1")
        if not (math.isfinite(self.multiple) and self.multiple > 0.0):
            raise InvalidValueError("influence.multiple", self.multiple, "a positive number")
        if not (math.isfinite(self.least) and self.least >= 0.0):
            raise InvalidValueError("influence.least", self.least, "a number of at least 0")

    @property
    def bounds(self) -> bool:
        """Whether there is a bound at all."""
        return self.quantile < 1.0


def bounded(losses: Tensor, influence: InfluenceBound) -> Tensor:
    """Losses (B,) with their influence bounded, differentiable; the bound itself counts as a constant."""
    if not influence.bounds or len(losses) < 2:
        return losses
    quantile = float(np.quantile(losses.detach().numpy(), influence.quantile))  # ten times as fast as torch's
    bound = max(influence.multiple * quantile, influence.least, float(np.finfo(float).tiny))
    if influence.shape is InfluenceShape.GEMAN:
        return losses / (1.0 + losses / bound)
    beyond = 2.0 * bound**0.5 * losses.clamp(min=bound).sqrt() - bound
    return torch.where(losses <= bound, losses, beyond)
