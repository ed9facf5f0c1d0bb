"""The mean loss of a model over data that it does not learn from."""

from typing import NamedTuple

import torch

from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.model import Model, Rows

PIECE = 256
"""Transitions at a time: what networks make of so many stays in a cache."""


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
