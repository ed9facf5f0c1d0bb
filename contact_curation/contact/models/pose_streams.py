"""Poses as networks see them, and how these inputs move along the six twists.

A pose enters as position and rotation matrix, [x, vec R], vec row by row. A twist (v in the board's frame, omega in the body's)
moves it along the chart x + v, R exp(hat omega), so that the inputs' directional derivatives are

    d[x, vec R] = [v, vec(R hat omega)]
"""

import torch
from torch import Tensor

_HATS = torch.zeros(3, 3, 3, dtype=torch.float64)
for _axis in range(3):
    _HATS[_axis, (_axis + 2) % 3, (_axis + 1) % 3] = 1.0
    _HATS[_axis, (_axis + 1) % 3, (_axis + 2) % 3] = -1.0


def pose_inputs(rotations: Tensor, positions: Tensor) -> Tensor:
    """Inputs (..., 12) of poses (..., 3, 3) and (..., 3)."""
    return torch.cat([positions, rotations.flatten(-2)], dim=-1)


def spin_tangents(rotations: Tensor) -> Tensor:
    """Derivatives (B, 3, 9) of vec R along turns about the body's three axes, at rotations (B, 3, 3)."""
    return torch.einsum("bij,cjk->bcik", rotations, _HATS.to(rotations)).flatten(-2)


def twist_tangents(rotations: Tensor) -> Tensor:
    """Derivatives (B, 6, 12) of the inputs along the six twists, at rotations (B, 3, 3)."""
    tangents = rotations.new_zeros(len(rotations), 6, 12)
    tangents[:, :3, :3] = torch.eye(3, dtype=rotations.dtype, device=rotations.device)
    tangents[:, 3:, 3:] = spin_tangents(rotations)
    return tangents
