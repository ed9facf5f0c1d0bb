"""The interface of all learnable contact models: loss, outputs, rollouts, and parameters.

A model holds its parameters theta and the body whose mass, inertia, gravity and length scale it takes as given. Lengths are
characteristic lengths; parameters are float64. What a model must say of itself is abstract here; all else has a default that
holds for a model that is no polytope and has no kernel of its own. `ContactModel` is for those that give gaps and Jacobians:
one formula, `contacts_at`, makes the rest.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from enum import StrEnum
from functools import partial
from typing import ClassVar, Self

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from contact_curation.contact.body import Body
from contact_curation.contact.compiled.descent import DescentTask, KernelDescent
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.defaults import ModelDefaults
from contact_curation.contact.models.explicit_parameters import ExplicitParameters, ModuleParameters
from contact_curation.contact.models.rollout import roll_out_steps
from contact_curation.contact.models.rows import BatchLoss as BatchLoss
from contact_curation.contact.models.rows import Rows as Rows
from contact_curation.contact.models.rows import over_finite_rows
from contact_curation.contact.models.stream_network import LayerTrace, StreamNetwork
from contact_curation.contact.parameter_form import Form
from contact_curation.contact.rollout import Rollout
from contact_curation.contact.time_step import DEFAULT_LIMITS, Steps, SweepLimits, step_at_contacts
from contact_curation.contact.torch_contacts import Contacts, Frames
from contact_curation.contact.torch_loss import contact_losses, solve_contacts
from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.solver.cone_problem import ConeSolutions


class Model(torch.nn.Module, ABC):
    """A model with parameters theta that can be trained.

    Attributes:
        kind: its name in the registry.
        defaults: how it is trained and scored where nothing else is said.
        body: whose motion it explains.
    """

    kind: ClassVar[str]
    defaults: ClassVar[ModelDefaults] = ModelDefaults()

    def __init__(self, body: Body) -> None:
        super().__init__()
        self.body = body

    @property
    def networks(self) -> dict[str, StreamNetwork]:
        """Its networks by name, in the order in which a tape has them."""
        return {name: module for name, module in self.named_children() if isinstance(module, StreamNetwork)}

    @property
    def device(self) -> torch.device:
        """Where its parameters are."""
        return next(self.parameters()).device

    @classmethod
    @abstractmethod
    def initial(cls, body: Body, form: Form, data: Rows, rng: np.random.Generator) -> Self:
        """A model at its random initialisation (method.md 1.1).

        Args:
            body: what is known of the object.
            form: of the polytope in it, where there is one that is trained.
            data: what it will be trained on, for the point about which the ground tilts and the networks' normalisation.
            rng: where the noise comes from; the same seed gives the same bytes.

        Raises:
            InvalidValueError: fewer than two transitions to normalise a network's inputs by.
        """

    @classmethod
    @abstractmethod
    def blank(cls, settings: Mapping[str, str], body: Body) -> Self:
        """A model whose numbers are still to be loaded, from what `settings` gave.

        Raises:
            InvalidValueError: settings that are missing or unknown.
        """

    @abstractmethod
    def batch_loss(self, rows: Rows, config: LossConfig) -> BatchLoss:
        """The losses of B transitions."""

    @abstractmethod
    def outputs(self, rows: Rows, tape: list[LayerTrace] | None = None) -> tuple[Tensor, ...]:
        """The outputs that the loss of B transitions depends on, each (B, ...); a tape takes the layers of its networks."""

    @abstractmethod
    def steps(self, states: Array, dt: Array, limits: SweepLimits) -> Iterator[Steps]:
        """Iterates over time steps from states (B, 13) with periods (B,) [s], without end."""

    def settings(self) -> dict[str, str]:
        """Settings from which a model is rebuilt, beside its tensors and its body; none by default."""
        return {}

    def forward(self, rows: Rows) -> tuple[Tensor, ...]:
        return self.outputs(rows)

    def solve(self, outputs: tuple[Tensor, ...], frames: Frames, config: LossConfig) -> ConeSolutions | None:
        """The impulses that explain B transitions best; None for a model that has none to solve for.

        The squares of such a model's only output (B, R) are its loss.
        """
        return None

    def roll_out(
        self,
        initial: ArrayLike,
        lengths: ArrayLike,
        dt: ArrayLike,
        limits: SweepLimits = DEFAULT_LIMITS,
        threads: int = 1,
    ) -> Rollout:
        """Rolls out B initial states; where there are contacts, each step starts from the impulses of the step before.

        Args:
            initial: (B, 13).
            lengths: one or (B,) frames, the initial one included.
            dt: one or (B,) time steps [s].
            limits: when a step's sweeps over the contacts stop.
            threads: how many trajectories, or blocks of them, are rolled out at once; torch's own threads are extra.

        Returns:
            The rollout, without impulses.

        Raises:
            InvalidValueError: a wrong shape, length, time step or quaternion norm.
        """
        return roll_out_steps(partial(self.steps, limits=limits), initial, lengths, dt, threads)

    def explicit_parameters(self) -> ExplicitParameters | None:
        """The parameters outside its networks as they are now, whose scores are exact columns; None where there are none."""
        inside = tuple(f"{name}." for name in self.networks)
        outside = [name for name, _ in self.named_parameters() if not name.startswith(inside)]
        return ModuleParameters(self, tuple(outside)) if outside else None

    def place(self) -> Array:
        """The point (3,) of the board about which it was trained, as far as it knows; the origin."""
        return np.zeros(3)

    def geometry(self) -> ContactGeometry | None:
        """The polytope of theta; None for other models."""
        return None

    def drawn_vertices(self) -> Array:
        """Vertices (V, 3) to draw it with; those of the body as described."""
        return self.body.scaled_vertices

    @property
    def precesses(self) -> bool:
        """Whether its spins precess in the air (method.md 1.2), as the published ones do not."""
        return False

    @property
    def has_own_friction_vertices(self) -> bool:
        """Whether friction acts at other vertices than those that the gaps depend on; by default not."""
        return False

    def with_shared_vertices(self) -> "Model":
        """The same with friction at the vertices of the gaps, as of a rigid body; itself where it has no others."""
        return self

    @classmethod
    def has_exact_fit(cls, form: Form) -> bool:
        """Whether an exact fit to data exists in a form of the polytope (`learning.fits`); by default not."""
        return False

    def kernel_descent(self, task: DescentTask) -> KernelDescent | None:
        """Gradient steps of one transition each, in the kernel; None for a model that it does not know."""
        return None

    def tensors(self) -> dict[str, Array]:
        """Parameters and constants by name."""
        return {name: value.detach().cpu().numpy().copy() for name, value in self.state_dict().items()}

    @classmethod
    def of_tensors(cls, settings: Mapping[str, str], tensors: Mapping[str, Array], body: Body) -> Self:
        """The model that `settings` and `tensors` came from.

        Raises:
            InvalidValueError: settings that are missing or unknown; tensors that are missing, too many, of another shape or
                type, or not finite.
        """
        model = cls.blank(settings, body)
        expected = model.state_dict()
        differing = sorted(set(expected) ^ set(tensors))
        if differing:
            there = "no" if differing[0] in expected else "an unknown"
            raise InvalidValueError(f"{cls.kind} parameters", f"{there} array {differing[0]!r}", f"{len(expected)} known ones")
        for name, value in expected.items():
            found = np.asarray(tensors[name])
            if found.shape != tuple(value.shape) or found.dtype != np.float64:
                shape = f"float64 of shape {tuple(value.shape)} for a body with {len(body.vertices)} vertices"
                raise InvalidValueError(f"{cls.kind} parameter {name}", f"{found.dtype} of shape {found.shape}", shape)
            if not np.isfinite(found).all():
                raise InvalidValueError(f"{cls.kind} parameter {name}", "a value that is not finite", "finite numbers")
        model.load_state_dict({name: torch.as_tensor(np.array(value)) for name, value in tensors.items()})
        return model

    def with_tensors(self, tensors: Mapping[str, Array]) -> Self:
        """A copy with other numbers; errors as of `of_tensors`."""
        return self.of_tensors(self.settings(), tensors, self.body)


class ContactModel(Model):
    """A model that gives gaps and Jacobians, from which the impulses follow."""

    @abstractmethod
    def contacts_at(self, rotations: Tensor, positions: Tensor) -> tuple[Tensor, Tensor]:
        """Gaps (B, K) and Jacobians (B, K, 3, 6) at poses (B, 3, 3) and (B, 3), differentiable by theta.

        A Jacobian's rows are [normal, tangent 1, tangent 2], friction included in the tangents; its columns are the body's
        velocity in the board's frame and its angular velocity in its own.
        """

    def contacts(self, frames: Frames, tape: list[LayerTrace] | None = None) -> Contacts:
        """Gaps (B, K), gaps one frame later (B, K) and Jacobians (B, K, 3, 6), differentiable by theta."""
        gaps, jacobians = self.contacts_at(frames.rotations, frames.positions)
        return Contacts(gaps, self.contacts_at(frames.rotations_next, frames.positions_next)[0], jacobians)

    def regularizer(self, jacobians: Tensor) -> Tensor:
        """Regulariser of theta's scale, () of Jacobians (B, K, 3, 6); zero for a model whose contacts keep theirs."""
        return torch.zeros((), dtype=torch.float64)

    def batch_loss(self, rows: Rows, config: LossConfig) -> BatchLoss:
        return over_finite_rows(rows, partial(self._batch_loss, config=config))

    def outputs(self, rows: Rows, tape: list[LayerTrace] | None = None) -> tuple[Tensor, ...]:
        return self.contacts(Frames.of(self.body, *rows, self.device, precesses=self.precesses), tape)

    def solve(self, outputs: tuple[Tensor, ...], frames: Frames, config: LossConfig) -> ConeSolutions | None:
        return solve_contacts(Contacts(*outputs), frames, config)

    def steps(self, states: Array, dt: Array, limits: SweepLimits) -> Iterator[Steps]:
        impulses = None
        while True:
            rotations, positions = torch.as_tensor(quaternions.to_matrix(states[:, 3:7])), torch.as_tensor(states[:, :3])
            with torch.no_grad():
                gaps, jacobians = self.contacts_at(rotations, positions)
            steps = step_at_contacts(self.body, states, dt, gaps.numpy(), jacobians.numpy(), impulses, limits)
            states, impulses = steps.states, steps.impulses
            yield steps

    def _batch_loss(self, rows: Rows, config: LossConfig) -> BatchLoss:
        frames = Frames.of(self.body, *rows, precesses=self.precesses)
        contacts = self.contacts(frames)
        losses, solved = contact_losses(contacts, frames, config)
        return BatchLoss(losses, solved, self.regularizer(contacts.jacobians[solved]))


def setting[Choice: StrEnum](settings: Mapping[str, str], name: str, choices: type[Choice]) -> Choice:
    """One of a model's settings.

    Raises:
        InvalidValueError: it is missing or unknown.
    """
    found = settings.get(name)
    if found not in [choice.value for choice in choices]:
        raise InvalidValueError(f"setting {name}", found, f"one of {', '.join(choices)}")
    return choices(found)
