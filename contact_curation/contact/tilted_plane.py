"""A plane that leans from where it was described: its unit normal and friction times its axes, differentiable by three numbers.

In the frame of the described normal and axes, as rows F (3, 3), with the tilt t (2), s = sqrt(1 + |t|^2) and mu = exp(f):

    [n; axes] = Q F,   Q = [[1/s, t^T/s], [-t/s, I - t t^T / (s (s + 1))]]

which turns the normal the shortest way to F_0 + t F_1:2. The slopes are written out, in NumPy: a step on one transition costs
as much as its operations.
"""

import math
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
        axes, friction = frame.cpu().numpy(), math.exp(float(log_friction))
        turn, by_lean = _turn(*tilt.tolist())
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


def _turn(a: float, b: float) -> tuple[Array, Array]:
    """Q (3, 3) and its derivatives (2, 3, 3) by the tilt t = (a, b)."""
    size = math.sqrt(1.0 + a * a + b * b)
    u, c = 1.0 / size, 1.0 / (size * (size + 1.0))
    turn = [[u, u * a, u * b], [-u * a, 1.0 - c * a * a, -c * a * b], [-u * b, -c * a * b, 1.0 - c * b * b]]
    by_size = -(2.0 * size + 1.0) * c * c  # of c
    ua, ub, ca, cb = -a * u**3, -b * u**3, by_size * a * u, by_size * b * u  # of u and c, by a and by b
    along_a, along_b, cross_a, cross_b = ua * a + u, ub * b + u, ca * a * b + c * b, cb * a * b + c * a
    by_a = [[ua, along_a, ua * b], [-along_a, -ca * a * a - 2.0 * c * a, -cross_a], [-ua * b, -cross_a, -ca * b * b]]
    by_b = [[ub, ub * a, along_b], [-ub * a, -cb * a * a, -cross_b], [-along_b, -cross_b, -cb * b * b - 2.0 * c * b]]
    return np.array(turn), np.array([by_a, by_b])
