"""Gaps and Jacobians of a polytope in torch, differentiable by theta (method.md 1.1).

    phi_i = n . (R p_i + x - pivot) - height      J_n,i = [n, p_i x R^T n]      J_t,i,a = [T_a, p^t_i x R^T T_a]

All functions broadcast over leading axes, those of theta too: a theta per transition gives a gradient per transition.
"""

from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from contact_curation.contact.body import Body
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.geometry import quaternions


class Theta(NamedTuple):
    """A `ContactGeometry` as float64 tensors with the same shapes; the pivot is a constant."""

    vertices_normal: Tensor
    normal: Tensor
    vertices_tangent: Tensor
    tangents: Tensor
    height: Tensor
    pivot: Tensor

    @staticmethod
    def of(geometry: ContactGeometry, device: str | torch.device = "cpu") -> "Theta":
        return Theta(*(torch.tensor(getattr(geometry, name), dtype=torch.float64, device=device) for name in Theta._fields))

    def geometry(self) -> ContactGeometry:
        """The same numbers without their history."""
        numbers = {name: value.detach().cpu().numpy() for name, value in self._asdict().items()}
        return ContactGeometry(**{**numbers, "height": float(numbers["height"])})

    def vector(self) -> Tensor:
        """(..., 6V + 10) in the order of the kernel's scores: vertices_normal, normal, vertices_tangent, tangents, height."""
        matrices = (self.vertices_normal, self.vertices_tangent, self.tangents)
        first, second, third = (matrix.flatten(-2) for matrix in matrices)
        return torch.cat([first, self.normal, second, third, self.height[..., None]], dim=-1)

    def with_vector(self, vector: Tensor) -> "Theta":
        """Another theta from vectors (..., 6V + 10)."""
        own = self.vertices_normal.shape[-2] * 3
        sizes, shapes = [own, 3, own, 6, 1], [(-1, 3), (3,), (-1, 3), (2, 3), ()]
        pieces = torch.split(vector, sizes, dim=-1)
        parts = [piece.reshape((*vector.shape[:-1], *shape)) for piece, shape in zip(pieces, shapes)]
        return Theta(parts[0], parts[1], parts[2], parts[3], parts[4], self.pivot)


class Frames(NamedTuple):
    """Measured states of B transitions, in characteristic lengths.

    Attributes:
        rotations, rotations_next: (B, 3, 3) body to board.
        positions, positions_next: (B, 3).
        free_velocities: (B, 6) v_f = v - g dt e3, and with the gyroscopic term where it is wanted.
        velocities_next: (B, 6) v'.
        dt: (B,) [s].
        inverse_mass: (B, 6, 6) M^-1, the same for all.
    """

    rotations: Tensor
    positions: Tensor
    rotations_next: Tensor
    positions_next: Tensor
    free_velocities: Tensor
    velocities_next: Tensor
    dt: Tensor
    inverse_mass: Tensor

    @staticmethod
    def of(
        body: Body,
        before: ArrayLike,
        after: ArrayLike,
        dt: ArrayLike,
        device: str | torch.device = "cpu",
        *,
        precesses: bool = False,
    ) -> "Frames":
        """From states (B, 13) and time steps (B,); spins precess in models of the rigid form (`ContactGeometry.is_rigid`)."""
        first, second, periods = (np.asarray(given, dtype=float) for given in (before, after, dt))
        free = first[:, 7:].copy()
        free[:, 2] -= body.scaled_gravity * periods
        if precesses and body.gyroscopic_inertia is not None:
            spins = first[:, 10:]
            torques = np.cross(spins, spins @ body.gyroscopic_inertia.T)
            free[:, 3:] -= periods[:, np.newaxis] * (torques @ body.scaled_inverse_inertia.T)
        inverse_mass = np.zeros((len(first), 6, 6))
        inverse_mass[:, :3, :3] = np.eye(3) / body.mass
        inverse_mass[:, 3:, 3:] = body.scaled_inverse_inertia
        turns, turns_next = quaternions.to_matrix(first[:, 3:7]), quaternions.to_matrix(second[:, 3:7])
        values = (turns, first[:, :3], turns_next, second[:, :3], free, second[:, 7:], periods, inverse_mass)
        return Frames(*(torch.tensor(value, dtype=torch.float64, device=device) for value in values))

    def rows(self, chosen: slice | Tensor) -> "Frames":
        """Some of the transitions."""
        return Frames(*(value[chosen] for value in self))


class Contacts(NamedTuple):
    """Gaps (..., K) before and after, and Jacobians (..., K, 3, 6) before, as [normal, tangent 1, tangent 2]."""

    gaps: Tensor
    gaps_next: Tensor
    jacobians: Tensor


def contacts_of(theta: Theta, frames: Frames) -> Contacts:
    """Gaps and Jacobians of a polytope at measured poses."""
    return Contacts(
        gaps_at(theta, frames.rotations, frames.positions),
        gaps_at(theta, frames.rotations_next, frames.positions_next),
        jacobians_at(theta, frames.rotations),
    )


def gaps_at(theta: Theta, rotations: Tensor, positions: Tensor) -> Tensor:
    """Gaps (..., V) at poses (..., 3, 3) and (..., 3)."""
    normal_in_body = torch.einsum("...ji,...j->...i", rotations, theta.normal)
    reach = torch.einsum("...vi,...i->...v", theta.vertices_normal, normal_in_body)
    offset = (theta.normal * (positions - theta.pivot)).sum(dim=-1) - theta.height
    return reach + offset[..., None]


def jacobians_at(theta: Theta, rotations: Tensor) -> Tensor:
    """Jacobians (..., V, 3, 6) at orientations (..., 3, 3)."""
    directions = torch.cat([theta.normal[..., None, :], theta.tangents], dim=-2)  # (..., 3, 3)
    in_body = torch.einsum("...ji,...cj->...ci", rotations, directions)
    points = torch.stack([theta.vertices_normal, theta.vertices_tangent, theta.vertices_tangent], dim=-2)  # (..., V, 3, 3)
    points, levers = torch.broadcast_tensors(points, in_body[..., None, :, :])  # type: ignore[no-untyped-call]
    turning = torch.linalg.cross(points, levers)
    pushing = directions[..., None, :, :].expand(turning.shape)
    return torch.cat([pushing, turning], dim=-1)
