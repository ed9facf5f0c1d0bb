"""Follows the central path of a quadratic over friction cones in torch: a log barrier whose weight mu falls step by step.

    minimise  x^T H x / 2 + q^T x - mu (sum_i log det(l_i) + sum_j log t_j),    x = (l, t)

with det(l) = normal^2 - |tangent|^2 for the circular cone, the product of the facets' gaps for the polyhedral one. It needs
more steps than a primal-dual method, but no multipliers (Boyd, Vandenberghe: Convex Optimization, 2004, 11.3).
"""

import torch
from torch import Tensor

from contact_curation.solver.certificate import FACET_NORMALS
from contact_curation.solver.cone_problem import Cone

FIRST_WEIGHT = 1.0
LAST_WEIGHT = 1e-11
SHRINKING = 0.2
STEPS_PER_WEIGHT = 3
HALVINGS = 40


def follow_central_path(hessian: Tensor, linear: Tensor, cone: Cone) -> tuple[Tensor, int]:
    """Points (B, 4K) near the minima, inside the cones, and how many Newton steps were taken.

    Args:
        hessian: (B, 4K, 4K) positive definite; K impulses first, then K slacks.
        linear: (B, 4K).
        cone: of the impulses.
    """
    contacts = linear.shape[1] // 4
    x = linear.new_tensor([1.0, 0.0, 0.0] * contacts + [1.0] * contacts).repeat(len(linear), 1)
    weight, taken = FIRST_WEIGHT, 0
    while weight > LAST_WEIGHT:
        for _ in range(STEPS_PER_WEIGHT):
            x = _step(hessian, linear, weight, x, cone)
        taken += STEPS_PER_WEIGHT
        weight *= SHRINKING
    return x, taken


def _step(hessian: Tensor, linear: Tensor, weight: float, x: Tensor, cone: Cone) -> Tensor:
    """One Newton step, halved until it stays inside and does not climb."""
    slope, curvature = _barrier_derivatives(x, cone)
    gradient = (hessian @ x[..., None])[..., 0] + linear + weight * slope
    direction = -torch.linalg.solve_ex(hessian + weight * curvature, gradient)[0]
    before = _value(hessian, linear, weight, x, cone)
    length = torch.ones_like(before)
    for _ in range(HALVINGS):
        climbs = ~(_value(hessian, linear, weight, x + length[:, None] * direction, cone) <= before)
        if not bool(climbs.any()):
            break
        length = torch.where(climbs, 0.5 * length, length)
    return torch.where(climbs[:, None], x, x + length[:, None] * direction)


def _value(hessian: Tensor, linear: Tensor, weight: float, x: Tensor, cone: Cone) -> Tensor:
    """(B,) what is minimised; infinite outside."""
    gaps = torch.cat([_gaps(x, cone), x[:, 3 * x.shape[1] // 4 :]], dim=1)
    smooth = (x * (0.5 * (hessian @ x[..., None])[..., 0] + linear)).sum(dim=1)
    inside = (gaps > 0.0).all(dim=1)
    if cone is Cone.CIRCULAR:
        inside &= (x[:, : 3 * x.shape[1] // 4 : 3] > 0.0).all(dim=1)
    barrier: Tensor = gaps.clamp(min=1e-300).log().sum(dim=1)
    return torch.where(inside, smooth - weight * barrier, torch.inf)


def _impulses(x: Tensor) -> Tensor:
    contacts = x.shape[1] // 4
    return x[:, : 3 * contacts].reshape(-1, contacts, 3)


def _gaps(x: Tensor, cone: Cone) -> Tensor:
    """What the barrier takes the logarithm of: (B, K) determinants, or (B, 8K) gaps to the facets."""
    impulses = _impulses(x)
    if cone is Cone.CIRCULAR:
        radius: Tensor = impulses[..., 1:].norm(dim=-1)
        return (impulses[..., 0] - radius) * (impulses[..., 0] + radius)
    return (impulses @ torch.as_tensor(FACET_NORMALS.T).to(x)).flatten(1)


def _barrier_derivatives(x: Tensor, cone: Cone) -> tuple[Tensor, Tensor]:
    """Gradient (B, n) and Hessian (B, n, n) of the barrier."""
    impulses, contacts = _impulses(x), x.shape[1] // 4
    if cone is Cone.CIRCULAR:
        mirror = x.new_tensor([1.0, -1.0, -1.0])
        gap = _gaps(x, cone)[..., None]
        slopes = -2.0 * mirror * impulses / gap
        blocks = slopes[..., :, None] * slopes[..., None, :] - 2.0 * torch.diag(mirror) / gap[..., None]
    else:
        normals = torch.as_tensor(FACET_NORMALS).to(x)
        inverse = 1.0 / (impulses @ normals.T)
        slopes = -inverse @ normals
        blocks = torch.einsum("bkf,fi,fj->bkij", inverse**2, normals, normals)
    slack = x[:, 3 * contacts :]
    curvature = torch.diag_embed(torch.cat([x.new_zeros(len(x), 3 * contacts), slack**-2], dim=1))
    for i in range(contacts):
        curvature[:, 3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = blocks[:, i]
    return torch.cat([slopes.flatten(1), -1.0 / slack], dim=1), curvature
