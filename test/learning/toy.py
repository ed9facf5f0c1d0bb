"""A model of one number that a test can reckon by hand, and transitions that say what it meets."""

from typing import Self

import numpy as np
import torch
from torch import Tensor

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.model import BatchLoss, ContactModel, Rows
from contact_curation.contact.parameter_form import Form
from contact_curation.contact.torch_contacts import Contacts, Frames
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.training.protocols import AdamWConfig, Patience, Schedule, TrainingConfig
from contact_curation.motion.transitions import Transitions

SOLVED, UNSOLVED, DIVERGING, BURSTING, STEEP = 0.0, 1.0, 2.0, 3.0, 4.0
"""What the second number of a state before does: nothing, no certificate, none because gaps are infinite, an infinite loss, a
gradient that is none."""


class Toy(ContactModel):
    """L = (theta - x)^2, where x is the first number of the state before."""

    kind = "toy"

    def __init__(self, theta: float = 0.0) -> None:
        super().__init__(CONTACTNETS_CUBE)
        self.theta = torch.nn.Parameter(torch.tensor(theta, dtype=torch.float64))
        self.rows_seen: list[Array] = []

    def batch_loss(self, rows: Rows, config: LossConfig) -> BatchLoss:
        if torch.is_grad_enabled():
            self.rows_seen.append(rows.before[:, 0])
        losses = torch.stack([self._loss(x, what) for x, what in rows.before[:, :2]])
        return BatchLoss(losses, ~torch.isnan(losses.detach()), self.theta.square())

    def contacts(self, frames: Frames, tape: object = None) -> Contacts:
        """None of any interest, but a gap that is infinite where the loss diverges."""
        gaps = torch.where(frames.positions[:, 1:2] == DIVERGING, torch.inf, 0.0)
        return Contacts(gaps, gaps, torch.zeros((len(gaps), 1, 3, 6)))

    def contacts_at(self, rotations: Tensor, positions: Tensor) -> tuple[Tensor, Tensor]:
        raise NotImplementedError

    @classmethod
    def initial(cls, *_: object) -> Self:
        return cls()

    @classmethod
    def blank(cls, *_: object) -> Self:
        return cls()

    def _loss(self, x: float, what: float) -> Tensor:
        if what in (UNSOLVED, DIVERGING):
            return torch.tensor(torch.nan, dtype=torch.float64)
        if what == STEEP:
            return 0.0 * (self.theta - self.theta.detach()).sqrt()  # a slope of zero times infinity
        return (self.theta - x).square() + (torch.inf if what == BURSTING else 0.0)


def toy_data(targets: list[float], what: list[float] | None = None, tosses: int = 1) -> Transitions:
    """Transitions with these targets, split evenly over the tosses ``a``, ``b``, ..."""
    before = np.zeros((len(targets), 13))
    before[:, 3] = 1.0
    before[:, 0] = targets
    before[:, 1] = SOLVED if what is None else what
    starts = np.linspace(0, len(targets), tosses + 1).astype(np.int64)
    names = tuple("abcdefgh"[:tosses])
    return Transitions(names, before, before.copy(), np.full(len(targets), 0.01), starts)


def toy_config(
    batch: int = 1,
    rate: float = 0.1,
    steps: int | None = None,
    epochs: int | None = 1000,
    evaluation_steps: int | None = None,
    patience: Patience | None = None,
    regularizer: float = 0.0,
) -> TrainingConfig:
    """A plain protocol at constant rate."""
    pace = AdamWConfig(rate)
    return TrainingConfig(
        Form.PHYSICAL, batch, pace, pace, Schedule.CONSTANT, steps, epochs, evaluation_steps, patience, regularizer
    )
