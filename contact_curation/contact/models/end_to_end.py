"""End to end: a network from the state straight to the net impulse of contact, without gaps or friction.

    f = NN(normalised [x, vec R, v, omega, u]),   v' = v_f + M^-1 f        24-256-256-256-256-6 ReLU, 205,318 parameters

u is the control, zero in a toss. The loss is what the next velocity is missed by: ContactNets' code trains on its norm, the
default here; `ImpulseLoss.SQUARED` is its square, i.e. |M^-1 (f - f_data)|^2. For information the square is the one to use: the
norm's score does not depend on the size of the residual, so that noise in the air counts as much as an impact (METHOD 1.1).

Like `DeepModel` it sees x and R in the board's frame and must be used in the frame in which it was trained.
"""

from enum import StrEnum

import numpy as np
import torch
from torch import Tensor

from contact_curation.contact.body import Body
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.input_scaling import InputScaling
from contact_curation.contact.models.kind import ModelKind
from contact_curation.contact.models.model import BatchLoss, Model, Rows, over_finite_rows
from contact_curation.contact.models.stream_network import Activation, LayerTrace, StreamNetwork
from contact_curation.contact.torch_contacts import Frames
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array

CONTROLS = 6
INPUTS = 18 + CONTROLS
HIDDEN = (256, 256, 256, 256)


class ImpulseLoss(StrEnum):
    """How the missed velocity (6 numbers, characteristic lengths per s and rad/s) becomes a loss."""

    NORM = "norm"
    SQUARED = "squared"


class EndToEndModel(Model):
    """Impulses by a network; it is zero, and nothing touches the body, until it is initialised or loaded.

    Args:
        body: mass, inertia and gravity.
        loss: what it is trained on.
    """

    kind = ModelKind.END_TO_END

    def __init__(self, body: Body, loss: ImpulseLoss = ImpulseLoss.NORM) -> None:
        super().__init__(body)
        self.loss = loss
        self.scaling = InputScaling(INPUTS)
        self.network = StreamNetwork((INPUTS, *HIDDEN, 6), Activation.RELU)

    def initialise(self, data: Rows, rng: np.random.Generator) -> "EndToEndModel":
        """The network as published, from `rng`, its inputs normalised over `data`."""
        self.scaling.fit(_inputs(data.before))
        self.network.initialise(rng)
        return self

    def batch_loss(self, rows: Rows, config: LossConfig) -> BatchLoss:
        """There is nothing to solve, so that `config` is not looked at; what is not finite counts as not solved."""
        return over_finite_rows(rows, self._batch_loss)

    def missed_velocities(self, rows: Rows, tape: list[LayerTrace] | None = None) -> Tensor:
        """Predicted minus measured next velocities (B, 6)."""
        frames = Frames.of(self.body, *rows)
        change = torch.einsum("bij,bj->bi", frames.inverse_mass, self.impulses(rows, tape))
        return frames.free_velocities + change - frames.velocities_next

    def impulses(self, rows: Rows, tape: list[LayerTrace] | None = None) -> Tensor:
        """Net impulses (B, 6) of contact over each transition; a tape takes the network's layers."""
        return self.impulses_at(rows.before, tape)

    def impulses_at(self, states: Array, tape: list[LayerTrace] | None = None) -> Tensor:
        """Net impulses (B, 6) over the frame after states (B, 13): linear in the board's frame, angular in the body's."""
        inputs = self.scaling(torch.as_tensor(_inputs(states), device=self.scaling.mean.device))
        outputs, _ = self.network(inputs[:, None], inputs.new_zeros(len(inputs), 0, INPUTS), tape)
        impulses: Tensor = outputs[:, 0]
        return impulses

    def _batch_loss(self, rows: Rows) -> BatchLoss:
        missed = self.missed_velocities(rows)
        losses = missed.square().sum(dim=1) if self.loss is ImpulseLoss.SQUARED else torch.linalg.vector_norm(missed, dim=1)
        finite = torch.isfinite(losses.detach())
        return BatchLoss(torch.where(finite, losses, torch.nan), finite, torch.zeros((), dtype=torch.float64))

    def settings(self) -> dict[str, str]:
        return {"loss": self.loss.value}


def _inputs(states: Array) -> Array:
    """(B, 24) of states (B, 13)."""
    turns = quaternions.to_matrix(states[:, 3:7]).reshape(-1, 9)
    return np.concatenate([states[:, :3], turns, states[:, 7:], np.zeros((len(states), CONTROLS))], axis=1)
