"""A plane that leans from where it was described: its unit normal and friction times its axes, differentiable by three numbers.

In the frame of the described normal and axes, as rows F (3, 3), with the tilt t (2), s = sqrt(1 + |t|^2) and mu = exp(f):

    [n; axes] = Q F,   Q = [[1/s, t^T/s], [-t/s, I - t t^T / (s (s + 1))]]

which turns the normal the shortest way to F_0 + t F_1:2. The slopes are written out, in NumPy: a step on one transition costs
as much as its operations.
"""

from typing import Any

import numpy as np
import torch
from torch import Tensor

from contact_curation.geometry.quaternions import Array


def tilted_plane(tilt: Tensor, log_friction: Tensor, frame: Tensor) -> tuple[Tensor, Tensor]:
    """Normal (3,) and tangents (2, 3) from a tilt (2,), log friction () and frame (3, 3)."""
    normal, tangents = _TiltedPlane.apply(tilt, log_friction, frame)
    return normal, tangents


class _TiltedPlane(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, tilt: Tensor, log_friction: Tensor, frame: Tensor) -> tuple[Tensor, Tensor]:
        lean, axes = tilt.detach().cpu().numpy(), frame.cpu().numpy()
        friction = np.exp(log_friction.detach().cpu().numpy())
        turn, by_lean = _turn(lean)
        ctx.slopes, ctx.friction = by_lean @ axes, friction  # (2, 3, 3): of the turned frame
        turned = turn @ axes
        ctx.tangents = friction * turned[1:]
        return torch.as_tensor(turned[0]).to(tilt), torch.as_tensor(ctx.tangents).to(tilt)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, by_normal: Tensor, by_tangents: Tensor) -> tuple[Tensor, Tensor, None]:
        first, rest = by_normal.cpu().numpy(), by_tangents.cpu().numpy()
        by_tilt = ctx.slopes[:, 0] @ first + ctx.friction * (ctx.slopes[:, 1:] * rest).sum(axis=(1, 2))
        by_friction = np.sum(ctx.tangents * rest)
        return torch.as_tensor(by_tilt).to(by_normal), torch.as_tensor(by_friction).to(by_normal), None


def _turn(lean: Array) -> tuple[Array, Array]:
    """Q (3, 3) and its derivatives (2, 3, 3) by the tilt (2,)."""
    outer = np.outer(lean, lean)
    size = np.sqrt(1.0 + outer[0, 0] + outer[1, 1])
    inverse, bend = 1.0 / size, 1.0 / (size * (size + 1.0))
    turn, slopes = np.empty((3, 3)), np.empty((2, 3, 3))
    turn[0, 0], turn[0, 1:], turn[1:, 0] = inverse, inverse * lean, -inverse * lean
    turn[1:, 1:] = np.eye(2) - bend * outer
    by_inverse, by_bend = -(inverse**3) * lean, -(2.0 * size + 1.0) * bend**2 * inverse * lean  # (2,), by the tilt
    sideways = by_inverse[:, None] * lean + inverse * np.eye(2)  # (2, 2)
    slopes[:, 0, 0], slopes[:, 0, 1:], slopes[:, 1:, 0] = by_inverse, sideways, -sideways
    slopes[:, 1:, 1:] = -by_bend[:, None, None] * outer - bend * _OUTER_SLOPES @ lean
    return turn, slopes


_OUTER_SLOPES: Array = np.einsum("ki,jl->kijl", np.eye(2), np.eye(2)) + np.einsum("kj,il->kijl", np.eye(2), np.eye(2))
"""(2, 2, 2, 2): applied to t, d (t t^T) / dt_k = e_k t^T + t e_k^T."""
