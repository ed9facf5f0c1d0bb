"""End to end: a network from the state straight to the net impulse of contact, without gaps or friction.

    f = NN(normalised [x, vec R, v, omega, u]),   v' = v_f + M^-1 f        24-256-256-256-256-6 ReLU, 205,318 parameters

u is the control, zero in a toss. The loss is what the next velocity is missed by: ContactNets' code trains on its norm, the
default here; `ImpulseLoss.SQUARED` is its square, i.e. |M^-1 (f - f_data)|^2. For information the square is the one to use: the
norm's score does not depend on the size of the residual, so that noise in the air counts as much as an impact (method.md 1.1).
A rollout steps without contacts:

    v' = v - g dt e3 + M^-1 f,    x' = x + dt v',    q' = q * exp(dt omega').

Like `DeepModel` it sees x and R in the board's frame and must be used in the frame in which it was trained.
"""

from collections.abc import Iterator, Mapping
from enum import StrEnum
from typing import Self

import numpy as np
import torch
from torch import Tensor

from contact_curation.contact.body import Body
from contact_curation.contact.compiled.descent import DescentTask, KernelDescent
from contact_curation.contact.compiled.network_descent import DescentParts, network_descent
from contact_curation.contact.geometry_parameters import UPWARD, ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.defaults import ModelDefaults
from contact_curation.contact.models.model import BatchLoss, Model, Rows, setting
from contact_curation.contact.models.rows import over_finite_rows
from contact_curation.contact.models.stream_network import Activation, InputScaling, LayerTrace, StreamNetwork
from contact_curation.contact.parameter_form import Form
from contact_curation.contact.time_step import Steps, StepStatus, SweepLimits
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

    kind = "end_to_end"
    defaults = ModelDefaults(3e-5, 1e-3, network_rate=1e-3, steps=4000, bounds_influence=False, sketch_rows=32)
    """Its loss is a norm, whose slope is bounded already. Five layers of ReLU are less alike: with 8 random rows the leverages'
    Spearman correlation is below 0.95; more leading rows mend less."""

    def __init__(self, body: Body, loss: ImpulseLoss = ImpulseLoss.NORM) -> None:
        super().__init__(body)
        self.loss = loss
        self.scaling = InputScaling(INPUTS)
        self.network = StreamNetwork((INPUTS, *HIDDEN, 6), Activation.RELU)

    @classmethod
    def initial(cls, body: Body, form: Form, data: Rows, rng: np.random.Generator) -> Self:
        return cls(body).initialise(data, rng)

    @classmethod
    def blank(cls, settings: Mapping[str, str], body: Body) -> Self:
        return cls(body, setting(settings, "loss", ImpulseLoss))

    def initialise(self, data: Rows, rng: np.random.Generator) -> Self:
        """The network as published, from `rng`, its inputs normalised over `data`."""
        self.scaling.fit(_inputs(data.before))
        self.network.initialise(rng)
        return self

    def batch_loss(self, rows: Rows, config: LossConfig) -> BatchLoss:
        """Losses without an inner problem; `config` is ignored, and values that are not finite count as not solved."""
        return over_finite_rows(rows, self._batch_loss)

    def outputs(self, rows: Rows, tape: list[LayerTrace] | None = None) -> tuple[Tensor, ...]:
        return (self.missed_velocities(rows, tape),)

    def steps(self, states: Array, dt: Array, limits: SweepLimits) -> Iterator[Steps]:
        """Without contacts there is nothing to solve: a step fails only where it is not finite."""
        none = np.empty((len(states), 0, 3))
        while True:
            with torch.no_grad():
                impulses = self.impulses_at(states).numpy()
            states = _pushed(self.body, states, dt, impulses)
            finite = np.isfinite(states[:, 0])
            status = np.where(finite, StepStatus.CONVERGED, StepStatus.NOT_FINITE).astype(np.int32)
            yield Steps(states, none, status, np.where(finite, 0.0, np.nan))

    def place(self) -> Array:
        return np.array([*self.scaling.mean[:2].tolist(), 0.0])

    def kernel_descent(self, task: DescentTask) -> KernelDescent | None:
        nowhere = np.zeros((1, 3))
        none = ContactGeometry(nowhere, UPWARD, nowhere, self.body.friction * np.eye(2, 3))
        squared = self.loss is ImpulseLoss.SQUARED
        return network_descent(
            DescentParts(self.kind, self.body, none, self.networks, scaling=self.scaling, squared=squared), task
        )

    def missed_velocities(self, rows: Rows, tape: list[LayerTrace] | None = None) -> Tensor:
        """Predicted minus measured next velocities (B, 6)."""
        frames = Frames.of(self.body, *rows, self.device)
        change = torch.einsum("bij,bj->bi", frames.inverse_mass, self.impulses(rows, tape))
        return frames.free_velocities + change - frames.velocities_next

    def impulses(self, rows: Rows, tape: list[LayerTrace] | None = None) -> Tensor:
        """Net impulses (B, 6) of contact over each transition; a tape takes the network's layers."""
        return self.impulses_at(rows.before, tape)

    def impulses_at(self, states: Array, tape: list[LayerTrace] | None = None) -> Tensor:
        """Net impulses (B, 6) over the frame after states (B, 13): linear in the board's frame, angular in the body's."""
        inputs = self.scaling(torch.as_tensor(_inputs(states), device=self.device))
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


def _pushed(body: Body, states: Array, dt: Array, impulses: Array) -> Array:
    """States (B, 13) after net impulses (B, 6); all NaN where one number is not finite."""
    period = dt[:, None]
    with np.errstate(over="ignore", invalid="ignore"):  # a motion that runs away becomes NaN below
        linear = states[:, 7:10] + impulses[:, :3] / body.mass
        linear[:, 2] -= body.scaled_gravity * dt
        angular = states[:, 10:] + impulses[:, 3:] @ body.scaled_inverse_inertia.T
        turned = quaternions.multiply(states[:, 3:7], quaternions.exp(period * angular))
        after = np.concatenate([states[:, :3] + period * linear, quaternions.normalized(turned), linear, angular], axis=1)
    after[~np.isfinite(after).all(axis=1)] = np.nan
    return after
