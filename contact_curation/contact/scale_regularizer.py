"""What keeps a contact model's scale in place while it is trained (METHOD 1.2): ContactNets' two regularisers, unweighted.

    R = sum_i (|d phi_i / dx| - 1)^2 + sum_i sum_a (u_i . u_t,i,a)^2

with u the unit vectors along d phi_i / dx and d phi_t,i,a / dx. Without the first, shrinking every gap shrinks the loss; the
second keeps friction across the normal. ContactNets weighs both with 0.3 and sums them over the transitions of a batch, which
is one; here it is their mean: at a batch of one it is the published objective, and at any other the weight means the same.
"""

from typing import Any

import torch
from torch import Tensor

SMALLEST = 1e-12
"""A slope shorter than this has no direction."""


def scale_regularizer(jacobians: Tensor) -> Tensor:
    """R (), mean over B transitions with Jacobians (B, K, 3, 6), of which the first three columns count; zero over none."""
    value: Tensor = _ScaleRegularizer.apply(jacobians[..., :3])
    return value


class _ScaleRegularizer(torch.autograd.Function):
    """Of slopes (B, K, 3, 3) by position, with its own slopes written out: one operation in the graph of each training step."""

    @staticmethod
    def forward(ctx: Any, slopes: Tensor) -> Tensor:
        sizes = torch.linalg.vector_norm(slopes, dim=-1, keepdim=True)  # (B, K, 3, 1)
        units = slopes / sizes.clamp(min=SMALLEST)
        normal, tangents = units[..., :1, :], units[..., 1:, :]
        overlaps = (normal * tangents).sum(dim=-1, keepdim=True)  # (B, K, 2, 1)
        excess = sizes[..., :1, :] - 1.0
        share = 2.0 / max(1, len(slopes))
        by_tangents = overlaps * (normal - overlaps * tangents)
        by_normal = (overlaps * (tangents - overlaps * normal)).sum(dim=-2, keepdim=True)
        by_slopes = torch.cat([by_normal, by_tangents], dim=-2) / sizes.clamp(min=SMALLEST)
        by_slopes[..., :1, :] += excess * normal
        ctx.save_for_backward(by_slopes.mul_(share))
        value: Tensor = 0.5 * share * (excess.square().sum() + overlaps.square().sum())
        return value

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, weight: Tensor) -> Tensor:
        (by_slopes,) = ctx.saved_tensors
        slopes: Tensor = weight * by_slopes
        return slopes
