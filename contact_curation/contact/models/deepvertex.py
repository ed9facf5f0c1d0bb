"""Deepvertex: vertices that move with the body's orientation over a plane and a friction that are taken as known.

    phi_i(q) = e3 . (R p_i + x)      phi_t,i(q) = mu [e1; e2] (R p_i + x)      p(R) = p0 + 1/3 NN(normalised vec R)

NN is 9-256-256-3V tanh, 74,520 parameters for a cube. p0 (the corners with the published noise), the ground's normal and the
friction are constants: it can learn neither friction nor the ground, and needs no regulariser. It is what ContactNets' code
calls ``deepvertex`` and its documentation experimental; the paper's "DeepVertex" is this one by name and `DeepModel` by
equation (method.md A1).

The network sees the orientation only, so that gaps and Jacobians do not change when the board's origin is moved.
"""

from collections.abc import Mapping
from typing import Self

import numpy as np
import torch
from torch import Tensor

from contact_curation.contact.body import Body
from contact_curation.contact.compiled.descent import DescentTask, KernelDescent
from contact_curation.contact.compiled.network_descent import DescentParts, network_descent
from contact_curation.contact.geometry_parameters import INITIAL_NOISE, UPWARD, ContactGeometry
from contact_curation.contact.models.defaults import ModelDefaults
from contact_curation.contact.models.model import ContactModel, Rows
from contact_curation.contact.models.stream_network import InputScaling, LayerTrace, StreamNetwork, spin_tangents
from contact_curation.contact.parameter_form import Form
from contact_curation.contact.torch_contacts import Contacts, Frames, Theta, gaps_at, jacobians_at
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array

NETWORK_SHARE = 1.0 / 3.0
"""What the network's outputs are multiplied with."""

HIDDEN = (256, 256)


class DeepvertexModel(ContactModel):
    """Vertices by a network; it is zero, and the vertices stay where they are, until it is initialised or loaded.

    Args:
        vertices: (V, 3) p0 in characteristic lengths.
        body: mass, inertia, gravity and friction.
    """

    kind = "deepvertex"
    defaults = ModelDefaults(batch=64, network_rate=1e-3)

    def __init__(self, vertices: Array, body: Body) -> None:
        super().__init__(body)
        theta = Theta.of(ContactGeometry(vertices, UPWARD, vertices, body.friction * np.eye(2, 3)))
        self.register_buffer("vertices", theta.vertices_normal)
        self.register_buffer("normal", theta.normal)
        self.register_buffer("tangents", theta.tangents)
        self.scaling = InputScaling(9)
        self.network = StreamNetwork((9, *HIDDEN, 3 * len(vertices)))

    @classmethod
    def initial(cls, body: Body, form: Form, data: Rows, rng: np.random.Generator) -> Self:
        corners = body.scaled_vertices
        return cls(corners + INITIAL_NOISE * rng.standard_normal(corners.shape), body).initialise(data, rng)

    @classmethod
    def blank(cls, settings: Mapping[str, str], body: Body) -> Self:
        return cls(body.scaled_vertices, body)

    def initialise(self, data: Rows, rng: np.random.Generator) -> Self:
        """The network as published, from `rng`, its inputs normalised over `data`."""
        self.scaling.fit(quaternions.to_matrix(data.before[:, 3:7]).reshape(-1, 9))
        self.network.initialise(rng)
        return self

    def contacts(self, frames: Frames, tape: list[LayerTrace] | None = None) -> Contacts:
        """As `ContactModel.contacts`; a tape takes the network's layers."""
        both = torch.stack([frames.rotations, frames.rotations_next], dim=1)  # (B, 2, 3, 3)
        vertices, slopes = self._vertices(both, tape)
        here, there = self._theta(vertices[:, 0]), self._theta(vertices[:, 1])
        return Contacts(
            gaps_at(here, frames.rotations, frames.positions),
            gaps_at(there, frames.rotations_next, frames.positions_next),
            self._jacobians(here, slopes, frames.rotations),
        )

    def contacts_at(self, rotations: Tensor, positions: Tensor) -> tuple[Tensor, Tensor]:
        vertices, slopes = self._vertices(rotations[:, None], None)
        theta = self._theta(vertices[:, 0])
        return gaps_at(theta, rotations, positions), self._jacobians(theta, slopes, rotations)

    def kernel_descent(self, task: DescentTask) -> KernelDescent | None:
        vertices, normal, tangents = (self.get_buffer(name).numpy() for name in ("vertices", "normal", "tangents"))
        geometry = ContactGeometry(vertices, normal, vertices, tangents)
        return network_descent(DescentParts(self.kind, self.body, geometry, self.networks, NETWORK_SHARE, self.scaling), task)

    def _vertices(self, rotations: Tensor, tape: list[LayerTrace] | None) -> tuple[Tensor, Tensor]:
        """Vertices p (B, S, V, 3) at rotations (B, S, 3, 3), and derivatives (B, 3, V, 3) along turns of the first."""
        scaling = self.scaling
        turns = spin_tangents(rotations[:, 0]) * scaling.scale
        shifts, slopes = self.network(scaling(rotations.flatten(-2)), turns, tape)
        moved = self.get_buffer("vertices") + NETWORK_SHARE * shifts.unflatten(-1, (-1, 3))
        return moved, NETWORK_SHARE * slopes.unflatten(-1, (-1, 3))

    def _theta(self, vertices: Tensor) -> Theta:
        """A polytope per transition, vertices (B, V, 3)."""
        zero = vertices.new_zeros(())
        return Theta(vertices, self.get_buffer("normal"), vertices, self.get_buffer("tangents"), zero, zero.expand(3))

    def _jacobians(self, theta: Theta, slopes: Tensor, rotations: Tensor) -> Tensor:
        """(B, V, 3, 6): those of a rigid polytope, and what the vertices' own motion adds to the turns."""
        in_body = torch.cat([theta.normal[None], theta.tangents]) @ rotations  # (B, 3, 3)
        moving = torch.einsum("bcj,bkvj->bvck", in_body, slopes)
        return jacobians_at(theta, rotations) + torch.nn.functional.pad(moving, (3, 0))
