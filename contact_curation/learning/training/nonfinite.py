"""Which transition made a loss or a gradient that is not finite. Slow, since it runs once, when training stops."""

import torch
from torch import Tensor

from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.model import ContactModel, Model, Rows
from contact_curation.contact.torch_contacts import Frames


def not_finite(model: Model, rows: Rows) -> Tensor:
    """(B,) which of the transitions that a model could not solve are not even finite.

    It tells what diverged from what the solver could not do: gaps and Jacobians that cannot be squared. An end-to-end model has
    nothing to solve: what it says is unsolved is not finite.
    """
    if not isinstance(model, ContactModel):
        return torch.ones(len(rows.dt), dtype=torch.bool)
    with torch.no_grad():
        contacts = model.contacts(Frames.of(model.body, *rows))
    sizes = torch.stack([value.square().flatten(1).sum(dim=1) for value in contacts])
    return ~torch.isfinite(sizes.sum(dim=0))


def not_finite_gradient(model: Model, rows: Rows, config: LossConfig) -> int:
    """The first of B transitions whose own gradient is not finite; the one with the largest, when only their sum is not."""
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
