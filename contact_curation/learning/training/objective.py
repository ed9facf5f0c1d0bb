"""The training objective, and statistics of a model's losses (method.md 2.1).

A few transitions with huge losses, tracking outliers first of all, must not rule the gradient. With a bound c on the loss
L = r^2 a transition counts as

    Huber    L                   up to c, then 2 sqrt(c L) - c        weight min(1, sqrt(c / L))
    Geman    L / (1 + L / c)                                          weight (1 + L / c)^-2

c is a multiple of a quantile of the losses of the batch itself, so that it means the same at a random initialisation and at the
optimum. Impacts, a few in a hundred transitions, have losses of several times the quantile; outliers, hundreds.

The ground lies near the zero of the board's frame. A body that is larger by some length over a ground that lies lower by as
much rests at the same height; only edges and corners tell the two apart, and the noise of a tracker is enough to hide it. So
the protocol holds the height, where a model learns one, near zero by w h^2, like a measurement of the board would. It is no
part of the likelihood and enters no score (method.md A4).
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from contact_curation.configs import check_not_negative, check_positive
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.model import Model, Rows
from contact_curation.errors import InvalidValueError

PIECE = 256
"""Transitions whose mean loss is taken at a time: what networks make of so many stays in a cache."""


class InfluenceShape(StrEnum):
    """How a large loss is bounded: its root grows on with constant slope, or its slope falls to nothing."""

    HUBER = "huber"
    GEMAN = "geman"


@dataclass(frozen=True)
class InfluenceBound:
    """Bound on the influence of large losses.

    Attributes:
        quantile: quantile of a batch's losses from which the bound follows; 1 for no bound.
        multiple: the bound is this multiple of the quantile.
        least: smallest bound, so that the other losses still count where nearly all are small.
        shape: how losses above the bound are reduced.
    """

    quantile: float = 1.0
    multiple: float = 1.0
    least: float = 0.0
    shape: InfluenceShape = InfluenceShape.HUBER

    def __post_init__(self) -> None:
        if not 0.0 < self.quantile <= 1.0:
            raise InvalidValueError("influence.quantile", self.quantile, "a number over 0, up to 1")
        check_positive(self, ("multiple",), "influence.")
        check_not_negative(self, ("least",), "influence.")

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


def height_parameters(model: Model) -> tuple[Tensor, ...]:
    """The ground's heights that a model learns, in characteristic lengths; none where it learns none."""
    return tuple(value for name, value in model.named_parameters() if name.rsplit(".", 1)[-1] == "height")


def ground_excess(heights: tuple[Tensor, ...]) -> Tensor:
    """The sum () of their squares; of the only one, where there is one, with no further operation."""
    return sum((height.square() for height in heights[1:]), start=heights[0].square())


class MeanLoss(NamedTuple):
    """Mean loss over the transitions that are solved, NaN if none is, and how many are not."""

    loss: float
    not_solved: int


def mean_loss(model: Model, rows: Rows, config: LossConfig) -> MeanLoss:
    """The loss of a model over B transitions."""
    total, solved = 0.0, 0
    with torch.no_grad():
        for first in range(0, len(rows.dt), PIECE):
            batch = model.batch_loss(rows.take(slice(first, first + PIECE)), config)
            total += float(batch.losses[batch.solved].sum())
            solved += int(batch.solved.sum())
    return MeanLoss(total / solved if solved else float("nan"), len(rows.dt) - solved)


def not_finite(model: Model, rows: Rows) -> Tensor:
    """(B,) which of the transitions that a model could not solve are not even finite.

    It tells what diverged from what the solver could not do: outputs that cannot be squared.
    """
    with torch.no_grad():
        outputs = model.outputs(rows)
    sizes = torch.stack([value.square().flatten(1).sum(dim=1) for value in outputs])
    return ~torch.isfinite(sizes.sum(dim=0))


def not_finite_gradient(model: Model, rows: Rows, config: LossConfig) -> int:
    """The first of B transitions whose own gradient is not finite; the one with the largest, when only their sum is not.

    Slow, since it runs once, when training stops.
    """
    sizes = [_gradient_size(model, rows.take([row]), config) for row in range(len(rows.dt))]
    for row, size in enumerate(sizes):
        if not size < torch.inf:
            return row
    return max(range(len(sizes)), key=sizes.__getitem__)


def _gradient_size(model: Model, row: Rows, config: LossConfig) -> float:
    batch = model.batch_loss(row, config)
    if not bool(batch.solved.all()):
        return 0.0
    trained = [value for value in model.parameters() if value.requires_grad]
    slopes: tuple[Tensor | None, ...] = torch.autograd.grad(batch.losses.sum(), trained, allow_unused=True)
    return float(sum((slope.square().sum() for slope in slopes if slope is not None), start=torch.zeros(())))
