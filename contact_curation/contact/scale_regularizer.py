"""What keeps a contact model's scale in place while it is trained (METHOD 1.2): ContactNets' two regularisers, unweighted.

    R = sum_i (|d phi_i / dx| - 1)^2 + sum_i sum_a (u_i . u_t,i,a)^2

with u the unit vectors along d phi_i / dx and d phi_t,i,a / dx. Without the first, shrinking every gap shrinks the loss; the
second keeps friction across the normal. ContactNets weighs both with 0.3 and sums them over the transitions of a batch, which
is one; here it is their mean: at a batch of one it is the published objective, and at any other the weight means the same.
"""

import torch
from torch import Tensor


def scale_regularizer(jacobians: Tensor) -> Tensor:
    """R (), mean over B transitions with Jacobians (B, K, 3, 6), of which the first three columns count; zero over none."""
    slopes = jacobians[..., :3]  # (B, K, 3, 3): by position
    sizes = torch.linalg.vector_norm(slopes[..., 0, :], dim=-1)
    directions = torch.nn.functional.normalize(slopes, dim=-1)
    overlaps = (directions[..., :1, :] * directions[..., 1:, :]).sum(dim=-1)  # (B, K, 2)
    total: Tensor = (sizes - 1.0).square().sum() + overlaps.square().sum()
    return total / max(1, len(jacobians))
