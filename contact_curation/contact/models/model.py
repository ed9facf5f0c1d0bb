"""What every learnable model of contact offers: a loss to train on; and what the contact models offer beside: their contacts.

A model holds its parameters theta and the body whose mass, inertia, gravity and length scale it takes as given. Lengths are
characteristic lengths; parameters are float64.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from contact_curation.contact.body import Body
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.kind import ModelKind
from contact_curation.contact.torch_contacts import Contacts, Frames
from contact_curation.geometry.quaternions import Array


class Rows(NamedTuple):
    """B transitions: states (B, 13) before and after, frame periods (B,) [s]."""

    before: Array
    after: Array
    dt: Array

    def take(self, chosen: ArrayLike | slice) -> "Rows":
        """Some of them."""
        index = chosen if isinstance(chosen, slice) else np.asarray(chosen)
        return Rows(self.before[index], self.after[index], self.dt[index])


class BatchLoss(NamedTuple):
    """What one batch says about theta.

    Attributes:
        losses: (B,) per transition, differentiable by theta; NaN where the impulses carry no certificate.
        solved: (B,) whether they carry one; nothing flows back from the others.
        regularizer: () what keeps theta's scale in place, without its weight; zero where a model needs none. It is no part of
            the likelihood and enters no score (METHOD A4).
    """

    losses: Tensor
    solved: Tensor
    regularizer: Tensor


def over_finite_rows(rows: Rows, losses_of: Callable[[Rows], BatchLoss]) -> BatchLoss:
    """`losses_of` the transitions whose numbers are all finite; the others are not solved.

    For models that differentiate through a network: the slope that comes back to a bad transition is zero, but zero times its
    inputs, which are not numbers, would spoil the gradient of all.
    """
    finite = np.isfinite(rows.before).all(axis=1) & np.isfinite(rows.after).all(axis=1) & np.isfinite(rows.dt)
    if finite.all():
        return losses_of(rows)
    found, kept = losses_of(rows.take(finite)), torch.as_tensor(finite)
    losses, solved = torch.full((len(kept),), torch.nan, dtype=torch.float64), torch.zeros(len(kept), dtype=torch.bool)
    return BatchLoss(losses.index_put((kept,), found.losses), solved.index_put((kept,), found.solved), found.regularizer)


class Model(torch.nn.Module, ABC):
    """A model with parameters theta that can be trained.

    Attributes:
        kind: which of the four.
        body: whose motion it explains.
    """

    kind: ModelKind

    def __init__(self, body: Body) -> None:
        super().__init__()
        self.body = body

    @abstractmethod
    def batch_loss(self, rows: Rows, config: LossConfig) -> BatchLoss:
        """The losses of B transitions."""

    @abstractmethod
    def settings(self) -> dict[str, str]:
        """What, beside its tensors and its body, a model is rebuilt from."""


class ContactModel(Model):
    """A model that gives gaps and Jacobians, from which the impulses follow."""

    @abstractmethod
    def contacts(self, frames: Frames) -> Contacts:
        """Gaps (B, K), gaps one frame later (B, K) and Jacobians (B, K, 3, 6), differentiable by theta."""

    @abstractmethod
    def contacts_at(self, rotations: Tensor, positions: Tensor) -> tuple[Tensor, Tensor]:
        """Gaps (B, K) and Jacobians (B, K, 3, 6) at poses (B, 3, 3) and (B, 3), for rollouts."""
