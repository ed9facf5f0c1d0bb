"""What keeps a contact model's scale in place while it is trained (METHOD 1.2): ContactNets' two regularisers, unweighted.

    R_i = (|n_i| - 1)^2 + sum_a (u_i . u_t,i,a)^2

with n_i = d phi_i / dx, and u_i and u_t,i,a the unit vectors along it and along d phi_t,i,a / dx. Without the first, shrinking
every gap shrinks the loss; the second keeps friction across the normal. ContactNets weighs both with 0.3 and sums them over the
contacts, and over the transitions of a batch, which is one. Here it is the mean over transitions: at a batch of one that is the
published objective, and at any other the weight means the same.
"""

from typing import Any

import numpy as np
import torch
from torch import Tensor

from contact_curation.geometry.quaternions import Array

SMALLEST = 1e-12
"""A slope shorter than this has no direction."""


def scale_regularizer(jacobians: Tensor) -> Tensor:
    """Mean () over B transitions with Jacobians (B, K, 3, 6) of the sum over contacts; zero over none."""
    each = scale_excess(jacobians[..., 0, :3], jacobians[..., 1:, :3])
    total: Tensor = each.sum() / max(1, len(jacobians))
    return total


def scale_excess(normals: Tensor, tangents: Tensor) -> Tensor:
    """R_i (...) of the gaps' slopes by position (..., 3) and those of the tangential places (..., 2, 3)."""
    value: Tensor = _ScaleExcess.apply(normals, tangents)
    return value


def _excess_and_slopes(normal: Array, side: Array) -> tuple[Array, Array, Array]:
    """R_i (...) of `scale_excess`, and its slopes by the normals (..., 3) and the tangents (..., 2, 3)."""
    size = np.sqrt((normal * normal).sum(axis=-1))  # (...)
    width = np.sqrt((side * side).sum(axis=-1, keepdims=True)).clip(SMALLEST)  # (..., 2, 1)
    unit, across = normal / size[..., None].clip(SMALLEST), side / width
    overlap = (unit[..., None, :] * across).sum(axis=-1, keepdims=True)  # (..., 2, 1)
    apart = unit[..., None, :] * overlap
    by_normal = (overlap * (across - apart)).sum(axis=-2) / size[..., None].clip(SMALLEST) + (size - 1.0)[..., None] * unit
    by_tangents = overlap * (unit[..., None, :] - overlap * across) / width
    excess = np.square(size - 1.0) + (overlap * overlap).sum(axis=(-2, -1))
    return excess, 2.0 * by_normal, 2.0 * by_tangents


class _ScaleExcess(torch.autograd.Function):
    """With its slopes written out, in NumPy: few and cheap operations, since they are all that a small batch costs."""

    @staticmethod
    def forward(ctx: Any, normals: Tensor, tangents: Tensor) -> Tensor:
        excess, *slopes = _excess_and_slopes(*(value.detach().cpu().numpy() for value in (normals, tangents)))
        ctx.slopes = tuple(torch.from_numpy(value).to(normals.device) for value in slopes)
        return torch.as_tensor(excess).to(normals.device)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, weight: Tensor) -> tuple[Tensor, Tensor]:
        by_normal, by_tangents = ctx.slopes
        return weight[..., None] * by_normal, weight[..., None, None] * by_tangents
