"""The polytope as a model to train, in either form of theta (method.md 1.1).

``contactnets`` trains the published 57 numbers and needs a regulariser that keeps the normal's scale in place
(`scale_regularizer`); ``physical`` trains vertices, the tilt of a unit normal about a pivot, one friction coefficient by its
logarithm, and the ground's height; ``rigid`` the same with one set of vertices, and knows how its residuals' variance grows
with impacts (contact/impulse_noise.py); it may bounce, with a restitution that is learned.

The ground leans from where it was described. In the frame of the described normal and axes, as rows F (3, 3), with the tilt
t (2), s = sqrt(1 + |t|^2) and mu = exp(f):

    [n; axes] = Q F,   Q = [[1/s, t^T/s], [-t/s, I - t t^T / (s (s + 1))]]

which turns the normal the shortest way to F_0 + t F_1:2. The slopes are written out, in NumPy: a step on one transition costs
as much as its operations.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Self

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from contact_curation.contact.body import Body
from contact_curation.contact.compiled.descent import DescentTask, KernelDescent, polytope_descent
from contact_curation.contact.geometry_parameters import INITIAL_NOISE, INITIAL_RESTITUTION, UPWARD, ContactGeometry
from contact_curation.contact.impulse_noise import ImpulseNoise
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.explicit_parameters import ExplicitParameters
from contact_curation.contact.models.model import BatchLoss, ContactModel, Rows, setting
from contact_curation.contact.models.stream_network import LayerTrace
from contact_curation.contact.parameter_form import Form, parameter_form, tilt_turn
from contact_curation.contact.rollout import Rollout, rollout
from contact_curation.contact.time_step import DEFAULT_LIMITS, SweepLimits
from contact_curation.contact.torch_contacts import Contacts, Frames, Theta, contacts_of, gaps_at, jacobians_at
from contact_curation.contact.torch_loss import polytope_losses, scale_excess
from contact_curation.geometry.quaternions import Array
from contact_curation.solver.cone_problem import MAX_CONTACTS

FRICTIONS = (1e-9, 1e3)
"""Least and largest friction that a step of a fit may lead to: beyond them nothing moves in another way."""

RESTITUTION = "restitution"
"""Parameter and setting of a polytope that bounces."""


class PolytopeModel(ContactModel):
    """A polytope over a plane.

    Args:
        geometry: theta to begin with.
        body: mass, inertia and gravity.
        form: which numbers are trained.

    Raises:
        InvalidValueError: the physical form is wanted of a geometry that is not (`parameter_form.is_physical`).
    """

    kind = "polytope"

    @property
    def precesses(self) -> bool:
        return self.form is Form.RIGID

    def __init__(self, geometry: ContactGeometry, body: Body, form: Form) -> None:
        super().__init__(body)
        parameter_form(geometry, form)  # refuses what has no such form
        self.form = form
        theta = Theta.of(geometry)
        self.vertices_normal = torch.nn.Parameter(theta.vertices_normal)
        if form is Form.RIGID:
            noise = geometry.noise or ImpulseNoise()
            self.register_buffer("noise", torch.tensor([noise.growth, noise.power], dtype=torch.float64))
            if geometry.restitution is not None:
                self.restitution = torch.nn.Parameter(torch.tensor(geometry.restitution, dtype=torch.float64))
        else:
            self.vertices_tangent = torch.nn.Parameter(theta.vertices_tangent)
        self.register_buffer("pivot", theta.pivot)
        if form is Form.CONTACTNETS:
            self.normal = torch.nn.Parameter(theta.normal)
            self.tangents = torch.nn.Parameter(theta.tangents)
            self.register_buffer("height", theta.height)
            return
        friction = theta.tangents[0].norm()
        self.log_friction = torch.nn.Parameter(friction.log())
        self.tilt = torch.nn.Parameter(torch.zeros(2, dtype=torch.float64))
        self.height = torch.nn.Parameter(theta.height)
        self.register_buffer("frame", torch.cat([theta.normal[None], theta.tangents / friction]))

    @classmethod
    def initial(cls, body: Body, form: Form, data: Rows, rng: np.random.Generator) -> Self:
        return cls(initial_geometry(body, form, below_centroid(data), rng), body, form)

    @classmethod
    def as_described(cls, body: Body, form: Form, data: Rows) -> Self:
        """The body as its user described it, on a level board, whose ground tilts about a point amid the data."""
        return cls(initial_geometry(body, form, below_centroid(data), np.random.default_rng(0), noise=0.0), body, form)

    @classmethod
    def blank(cls, settings: Mapping[str, str], body: Body) -> Self:
        geometry = ContactGeometry.of_body(body)
        if RESTITUTION in settings:
            geometry = replace(geometry, restitution=0.0)
        return cls(geometry, body, setting(settings, "form", Form))

    @classmethod
    def has_exact_fit(cls, form: Form) -> bool:
        return form is not Form.CONTACTNETS

    def theta(self) -> Theta:
        """The polytope, differentiable by the parameters."""
        pivot, height = self.get_buffer("pivot"), torch.as_tensor(self.height)
        vertices_tangent = self.vertices_normal if self.form is Form.RIGID else self.vertices_tangent
        if self.form is Form.CONTACTNETS:
            return Theta(self.vertices_normal, self.normal, vertices_tangent, self.tangents, height, pivot)
        normal, tangents = tilted_plane(self.tilt, self.log_friction, self.get_buffer("frame"))
        return Theta(self.vertices_normal, normal, vertices_tangent, tangents, height, pivot)

    def geometry(self) -> ContactGeometry:
        """The polytope's numbers."""
        geometry = self.theta().geometry()
        if self.form is not Form.RIGID:
            return geometry
        restitution = None if self._restitution is None else min(max(float(self._restitution.detach()), 0.0), 1.0)
        return replace(geometry, noise=ImpulseNoise(*self.get_buffer("noise").tolist()), restitution=restitution)

    def limit(self) -> None:
        """Leaves the restitution within 0 and 1, and the friction within `FRICTIONS`."""
        if self.form is not Form.CONTACTNETS:
            with torch.no_grad():
                self.log_friction.clamp_(*map(math.log, FRICTIONS))
        if self._restitution is not None:
            with torch.no_grad():
                self._restitution.clamp_(0.0, 1.0)

    def with_noise(self, noise: ImpulseNoise) -> "PolytopeModel":
        """The same model in the rigid form with another noise."""
        return PolytopeModel(replace(self.geometry(), noise=noise), self.body, Form.RIGID)

    def bouncing(self, restitution: float | None = None) -> "PolytopeModel":
        """The same model with this restitution; by default its own, or one to begin with.

        Raises:
            InvalidValueError: it is not in the rigid form.
        """
        if restitution is None:
            if self._restitution is not None:
                return self
            restitution = INITIAL_RESTITUTION
        return PolytopeModel(replace(self.geometry(), restitution=restitution), self.body, self.form)

    def batch_loss(self, rows: Rows, config: LossConfig) -> BatchLoss:
        theta = self.theta()
        losses, solved = polytope_losses(theta, self.body, *rows, config, self._restitution, precesses=self.precesses)
        return BatchLoss(losses, solved, self._regularizer(theta))

    def contacts(self, frames: Frames, tape: list[LayerTrace] | None = None) -> Contacts:
        return contacts_of(self.theta(), frames)

    def contacts_at(self, rotations: Tensor, positions: Tensor) -> tuple[Tensor, Tensor]:
        theta = self.theta()
        return gaps_at(theta, rotations, positions), jacobians_at(theta, rotations)

    def settings(self) -> dict[str, str]:
        bounces = {} if self._restitution is None else {RESTITUTION: "learned"}
        return {"form": self.form.value} | bounces

    def roll_out(
        self,
        initial: ArrayLike,
        lengths: ArrayLike,
        dt: ArrayLike,
        limits: SweepLimits = DEFAULT_LIMITS,
        threads: int = 1,
    ) -> Rollout:
        return rollout(self.geometry(), self.body, initial, lengths, dt, limits, threads)

    def explicit_parameters(self) -> ExplicitParameters:
        return PolytopeParameters(self.geometry(), self.form)

    def place(self) -> Array:
        return self.geometry().pivot

    def drawn_vertices(self) -> Array:
        return self.geometry().vertices_normal

    def kernel_descent(self, task: DescentTask) -> KernelDescent | None:
        """The kernel knows the published form."""
        if self.form is not Form.CONTACTNETS or len(self.vertices_normal) > MAX_CONTACTS:
            return None
        return polytope_descent(self.geometry(), self.body, task)

    @property
    def _restitution(self) -> Tensor | None:
        return getattr(self, RESTITUTION, None)

    @property
    def has_own_friction_vertices(self) -> bool:
        return self.form is not Form.RIGID and not torch.equal(self.vertices_normal, self.vertices_tangent)

    def with_shared_vertices(self) -> "PolytopeModel":
        """The same model with friction at the contact vertices, as for a rigid body.

        Where the two were learned apart, it predicts motion better (docs/results.md).
        """
        geometry = self.geometry()
        return PolytopeModel(replace(geometry, vertices_tangent=geometry.vertices_normal), self.body, self.form)

    def _regularizer(self, theta: Theta) -> Tensor:
        if self.form is not Form.CONTACTNETS:
            return torch.zeros((), dtype=torch.float64)
        return len(theta.vertices_normal) * scale_excess(theta.normal, theta.tangents)  # the same at every contact


class PolytopeParameters(ExplicitParameters):
    """Parameters of a polytope, or of the polytope inside a model that adds to its gaps and Jacobians.

    Slopes by the sum are slopes by the polytope's own contacts: there are a few dozen parameters, with names and units, and
    everything that holds for a polytope's information holds.

    Args:
        geometry: theta.
        form: how it is parameterised.
    """

    def __init__(self, geometry: ContactGeometry, form: Form) -> None:
        self._theta, self._form = Theta.of(geometry), parameter_form(geometry, form)
        self.blocks, self.tilt_axes, self.pivot = self._form.blocks, self._form.tilt_axes, geometry.pivot

    def scores(self, rows: Rows, frames: Frames, slopes: tuple[Tensor, ...]) -> Array:
        theta = Theta(*(value.to(frames.dt.device) for value in self._theta))
        each = theta.vector().repeat(len(frames.dt), 1).requires_grad_()  # (B, Q)
        contacts = contacts_of(theta.with_vector(each), frames)
        (found,) = torch.autograd.grad(contacts, each, slopes, is_grads_batched=True)
        return np.asarray(found.cpu().numpy() @ self._form.chart)


def below_centroid(data: Rows) -> Array:
    """The point (3,) of the plane z = 0 under the data's centroid."""
    return np.array([*data.before[:, :2].mean(axis=0), 0.0])


def initial_geometry(
    body: Body, form: Form, pivot: Array, rng: np.random.Generator, noise: float = INITIAL_NOISE
) -> ContactGeometry:
    """ContactNets' random initialisation about the body as described (method.md 1.1).

    Args:
        body: whose corners and friction are known up to noise.
        form: in the physical one the normal tilts by the noise [rad] and friction is noisy by a factor; in the rigid one the
            vertices at which friction acts are those of the gaps, too.
        pivot: (3,) of the plane z = 0, about which the physical form's ground tilts; amid the data, tilt and height keep apart.
        rng: where the noise comes from; the same seed gives the same vertices in both forms.
        noise: standard deviation, in characteristic lengths and as a share of friction.
    """
    corners = body.scaled_vertices
    own, tangent = (corners + noise * rng.standard_normal(corners.shape) for _ in range(2))
    if form is Form.CONTACTNETS:
        normal = UPWARD + noise * rng.standard_normal(3)
        return ContactGeometry(own, normal, tangent, body.friction * (np.eye(2, 3) + noise * rng.standard_normal((2, 3))))
    tangent = own if form is Form.RIGID else tangent
    model = PolytopeModel(ContactGeometry(own, UPWARD, tangent, body.friction * np.eye(2, 3), pivot), body, form)
    with torch.no_grad():
        for value in (model.tilt, model.log_friction, model.height):
            value.add_(torch.as_tensor(noise * rng.standard_normal(tuple(value.shape))))
    return model.geometry()


def tilted_plane(tilt: Tensor, log_friction: Tensor, frame: Tensor) -> tuple[Tensor, Tensor]:
    """Normal (3,) and tangents (2, 3) from a tilt (2,), log friction () and frame (3, 3)."""
    normal, tangents = _TiltedPlane.apply(tilt, log_friction, frame)
    return normal, tangents


class _TiltedPlane(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, tilt: Tensor, log_friction: Tensor, frame: Tensor) -> tuple[Tensor, Tensor]:
        axes, friction = frame.cpu().numpy(), math.exp(float(log_friction))
        turn, by_lean = tilt_turn(*tilt.tolist())
        ctx.slopes, ctx.friction = by_lean @ axes, friction  # (2, 3, 3): of the turned frame
        turned = turn @ axes
        ctx.tangents = friction * turned[1:]
        return torch.from_numpy(turned[0]).to(tilt), torch.from_numpy(ctx.tangents).to(tilt)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, by_normal: Tensor, by_tangents: Tensor) -> tuple[Tensor, Tensor, None]:
        first, rest = by_normal.cpu().numpy(), by_tangents.cpu().numpy()
        by_tilt = ctx.slopes[:, 0] @ first + ctx.friction * (ctx.slopes[:, 1:] * rest).sum(axis=(1, 2))
        by_friction = np.sum(ctx.tangents * rest)
        return torch.from_numpy(by_tilt).to(by_normal), torch.as_tensor(by_friction).to(by_normal), None
