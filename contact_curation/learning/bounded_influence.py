"""Bounded influence: a few transitions with huge losses, glitches first of all, do not rule the gradient (METHOD 2.1).

With a bound c on the loss L = r^2 a transition counts as

    Huber    L                   up to c, then 2 sqrt(c L) - c        weight min(1, sqrt(c / L))
    Geman    L / (1 + L / c)                                          weight (1 + L / c)^-2

c is a quantile of the losses of the batch itself, so that it means the same at a random initialisation and at the optimum.
"""

from dataclasses import dataclass
from enum import StrEnum

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
        quantile: share of a batch's losses that lie under the bound; 1 for no bound.
        shape: of what happens above.
    """

    quantile: float = 1.0
    shape: InfluenceShape = InfluenceShape.HUBER

    def __post_init__(self) -> None:
        if not 0.0 < self.quantile <= 1.0:
            raise InvalidValueError("influence.quantile", self.quantile, "a number over 0, up to 1")

    @property
    def bounds(self) -> bool:
        """Whether there is a bound at all."""
        return self.quantile < 1.0


def bounded(losses: Tensor, influence: InfluenceBound) -> Tensor:
    """Losses (B,) with their influence bounded, differentiable; the bound itself counts as a constant."""
    if not influence.bounds or len(losses) < 2:
        return losses
    bound = torch.quantile(losses.detach(), influence.quantile).clamp(min=torch.finfo(losses.dtype).tiny)
    if influence.shape is InfluenceShape.GEMAN:
        return losses / (1.0 + losses / bound)
    beyond = 2.0 * (bound * losses.clamp(min=bound)).sqrt() - bound
    return torch.where(losses <= bound, losses, beyond)
