"""The loss of method.md 1.2 in torch, at impulses that stay fixed, and as a differentiable function for training.

The loss is |r|^2 of 6 + 6K residuals: sqrt(w_m) (M^-1 J^T l - dv), phi' l, e = l_n s + |s| l_t and min(0, predicted phi), each
with the root of its weight. By the envelope theorem its gradient by theta needs no derivative of the impulses (method.md E5).
Its Hessian does, so that a second derivative is refused.

Training needs slopes by gaps and Jacobians only; they are written out. With p = J^T l, u = v_f + M^-1 p, r = u - v',
s_i = J_t,i v', e_i = l_n,i s_i + |s_i| l_t,i, N_i = min(0, phi_i + dt J_n,i u):

    dL/dphi_i   = 2 w_s N_i
    dL/dphi'_i  = 2 phi'_i (w_n l_n,i^2 + w_t |l_t,i|^2)
    dL/dJ_i     = l_i y^T + [2 w_s dt N_i u;  2 w_c (l_n,i e_i + (e_i . l_t,i) s_i / |s_i|) v'^T]
    y           = M^-T (2 w_m r + 2 w_s dt sum_i N_i J_n,i)

What keeps a contact model's scale in place while it is trained are ContactNets' two regularisers, here unweighted:

    R_i = (|n_i| - 1)^2 + sum_a (u_i . u_t,i,a)^2

with n_i = d phi_i / dx, and u_i and u_t,i,a the unit vectors along it and along d phi_t,i,a / dx. Without the first, shrinking
every gap shrinks the loss; the second keeps friction across the normal. ContactNets weighs both with 0.3 and sums them over the
contacts, and over the transitions of a batch, which is one. Here it is the mean over transitions: at a batch of one that is the
published objective, and at any other the weight means the same.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import torch
from torch import Tensor

from contact_curation.contact.body import Body
from contact_curation.contact.evaluation import SolveStatus, evaluate
from contact_curation.contact.loss_config import DEFAULT_LOSS, LossConfig
from contact_curation.contact.torch_contacts import Contacts, Frames, Theta
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.solver.compiled_solver import solve_compiled
from contact_curation.solver.cone_problem import ConeProblems, ConeSolutions, ConeWeights

SMALLEST_SLIP = 1e-300
"""Below it a slip has no direction, and no slope by it (method.md E2)."""

SMALLEST = 1e-12
"""A slope of a gap or of a tangential place shorter than this has no direction."""


def residuals(contacts: Contacts, frames: Frames, impulses: Tensor, weights: ConeWeights) -> tuple[Tensor, ...]:
    """Residuals (..., 6), (..., K), (..., 2K), (..., 2K), (..., K), whose squares sum to the terms of the loss in their order.

    Args:
        contacts: gaps and Jacobians.
        frames: what was measured.
        impulses: (..., K, 3).
        weights: of the terms.
    """
    normal, tangent = impulses[..., 0], impulses[..., 1:]
    push = torch.einsum("...kca,...kc->...a", contacts.jacobians, impulses)
    change = torch.einsum("...ab,...b->...a", frames.inverse_mass, push)
    miss = change - (frames.velocities_next - frames.free_velocities)
    slip = torch.einsum("...kta,...a->...kt", contacts.jacobians[..., 1:, :], frames.velocities_next)
    against = normal[..., None] * slip + torch.linalg.vector_norm(slip, dim=-1, keepdim=True) * tangent
    approach = torch.einsum("...ka,...a->...k", contacts.jacobians[..., 0, :], frames.free_velocities + change)
    predicted = contacts.gaps + frames.dt[..., None] * approach
    return (
        weights.match**0.5 * miss,
        weights.complementarity_normal**0.5 * contacts.gaps_next * normal,
        weights.complementarity_tangent**0.5 * (contacts.gaps_next[..., None] * tangent).flatten(-2),
        weights.dissipation**0.5 * against.flatten(-2),
        weights.penetration**0.5 * predicted.clamp(max=0.0),
    )


def solve_contacts(contacts: Contacts, frames: Frames, config: LossConfig = DEFAULT_LOSS) -> ConeSolutions:
    """The impulses of B transitions of any contact model."""
    return solve_compiled(cone_problems(contacts, frames, config), config.tolerance, config.max_iterations, config.threads)


def cone_problems(contacts: Contacts, frames: Frames, config: LossConfig) -> ConeProblems:
    """The inner problems that contacts pose."""
    measured = (frames.free_velocities, frames.velocities_next, frames.dt)
    gaps, gaps_next, jacobians, free, following, dt = (value.detach().cpu().numpy() for value in (*contacts, *measured))
    inverse_mass = frames.inverse_mass[0].cpu().numpy()
    return ConeProblems(jacobians, inverse_mass, gaps, gaps_next, free, following, dt, config.weights, config.cone)


def contact_losses(contacts: Contacts, frames: Frames, config: LossConfig = DEFAULT_LOSS) -> tuple[Tensor, Tensor]:
    """The loss of B transitions of any contact model, differentiable by its gaps and Jacobians.

    Returns:
        losses (B,), NaN where the impulses carry no certificate, and solved (B,). Nothing flows back from what is not solved.
    """
    losses, solved = _ContactLoss.apply(*contacts, frames, config)
    return losses, solved


def polytope_losses(
    theta: Theta,
    body: Body,
    before: Array,
    after: Array,
    dt: Array,
    config: LossConfig = DEFAULT_LOSS,
    restitution: Tensor | None = None,
    *,
    precesses: bool = False,
) -> tuple[Tensor, Tensor]:
    """The loss of B transitions of a polytope, differentiable by theta through the scores of `evaluate`.

    Args:
        theta: one for all transitions.
        body: mass, inertia and gravity.
        before, after: (B, 13) states.
        dt: (B,) frame periods [s].
        config: weights and solver.
        restitution: () of a body that bounces.
        precesses: whether it is a theta of the rigid form.

    Returns:
        As `contact_losses`.
    """
    losses, solved = _PolytopeLoss.apply(*theta, restitution, body, before, after, dt, config, precesses)
    return losses, solved


def loss_and_slopes(contacts: Contacts, frames: Frames, impulses: Tensor, weights: ConeWeights) -> tuple[Tensor, Contacts]:
    """Losses (B,), and their slopes in the shapes of `contacts`, at impulses (B, K, 3); no part of a graph."""
    with torch.no_grad():
        gaps, gaps_next, jacobians = contacts
        push = (impulses.flatten(1)[:, None] @ jacobians.flatten(1, 2))[:, 0]  # (B, 6)
        reached = frames.free_velocities + (frames.inverse_mass @ push[..., None])[..., 0]
        missed = reached - frames.velocities_next
        along = jacobians @ torch.stack([reached, frames.velocities_next], dim=-1)[:, None]  # (B, K, 3, 2)
        normal, tangent, slip = impulses[..., :1], impulses[..., 1:], along[..., 1:, 1]
        speed = torch.linalg.vector_norm(slip, dim=-1, keepdim=True)
        against = normal * slip + speed * tangent  # (B, K, 2)
        inside = (gaps + frames.dt[:, None] * along[..., 0, 0]).clamp(max=0.0)  # (B, K)
        open_ = impulses.square() @ _closing(weights, impulses)  # (B, K)

        deeper = 2.0 * weights.penetration * inside
        approach = frames.dt[:, None] * deeper
        yielding = 2.0 * weights.match * missed + (approach[:, None] @ jacobians[:, :, 0])[:, 0]
        returned = (yielding[:, None] @ frames.inverse_mass)[:, 0]
        turning = (against * tangent).sum(dim=-1, keepdim=True) / speed.clamp(min=SMALLEST_SLIP)
        dissipated = 2.0 * weights.dissipation * (normal * against + turning * slip)  # (B, K, 2)

        slopes = impulses[..., None] * returned[:, None, None]  # (B, K, 3, 6)
        slopes[:, :, 0] += approach[..., None] * reached[:, None]
        slopes[:, :, 1:] += dissipated[..., None] * frames.velocities_next[:, None, None]
        at_contacts = gaps_next.square() * open_ + weights.penetration * inside.square()
        at_contacts += weights.dissipation * against.square().sum(dim=-1)
        losses = weights.match * missed.square().sum(dim=-1) + at_contacts.sum(dim=-1)
        return losses, Contacts(deeper, 2.0 * gaps_next * open_, slopes)


def scale_regularizer(jacobians: Tensor) -> Tensor:
    """Mean () over B transitions with Jacobians (B, K, 3, 6) of the sum over contacts; zero over none."""
    each = scale_excess(jacobians[..., 0, :3], jacobians[..., 1:, :3])
    total: Tensor = each.sum() / max(1, len(jacobians))
    return total


def scale_excess(normals: Tensor, tangents: Tensor) -> Tensor:
    """R_i (...) of the gaps' slopes by position (..., 3) and those of the tangential places (..., 2, 3)."""
    value: Tensor = _ScaleExcess.apply(normals, tangents)
    return value


class _ContactLoss(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx: Any, gaps: Tensor, gaps_next: Tensor, jacobians: Tensor, frames: Frames, config: LossConfig
    ) -> tuple[Tensor, Tensor]:
        contacts = Contacts(gaps, gaps_next, jacobians)
        solutions = solve_contacts(contacts, frames, config)
        impulses, status = (torch.as_tensor(value, device=gaps.device) for value in (solutions.impulses, solutions.status))
        solved = status == SolveStatus.SOLVED
        losses, slopes = loss_and_slopes(contacts, frames, impulses, config.weights)
        ctx.save_for_backward(solved, *slopes)
        ctx.mark_non_differentiable(solved)
        return torch.where(solved, losses, torch.nan), solved

    @staticmethod
    def backward(ctx: Any, weight: Tensor, _: Tensor) -> tuple[Tensor | None, ...]:
        _refuse_second_derivative()
        solved, *slopes = ctx.saved_tensors
        return (*(_weighted(slope, weight, solved) for slope in slopes), None, None)


class _PolytopeLoss(torch.autograd.Function):
    """Takes the fields of a `Theta` one by one: at small batches a step's time is the number of operations in its graph."""

    @staticmethod
    def forward(
        ctx: Any,
        vertices_normal: Tensor,
        normal: Tensor,
        vertices_tangent: Tensor,
        tangents: Tensor,
        height: Tensor,
        pivot: Tensor,
        restitution: Tensor | None,
        body: Body,
        before: Array,
        after: Array,
        dt: Array,
        config: LossConfig,
        precesses: bool,
    ) -> tuple[Tensor, Tensor]:
        theta = Theta(vertices_normal, normal, vertices_tangent, tangents, height, pivot)
        geometry = theta.geometry().rigid() if precesses else theta.geometry()
        if restitution is not None:
            geometry = replace(geometry, restitution=min(max(float(restitution.detach()), 0.0), 1.0))
        found = evaluate(geometry, body, before, after, dt, config)
        solved = torch.from_numpy(found.solved).to(normal.device)
        ctx.solved, ctx.scores, ctx.own = found.solved, found.scores, vertices_normal.numel()
        ctx.bounces = restitution is not None
        ctx.mark_non_differentiable(solved)
        return torch.from_numpy(np.where(found.solved, found.losses, np.nan)).to(normal.device), solved

    @staticmethod
    def backward(ctx: Any, weight: Tensor, _: Tensor) -> tuple[Tensor | None, ...]:
        _refuse_second_derivative()
        counted = np.flatnonzero(ctx.solved)
        slope = -2.0 * (weight.cpu().numpy()[counted] @ ctx.scores[counted])
        own, by_restitution = ctx.own, slope[-1:].reshape(()) if ctx.bounces else None
        slope = slope[:-1] if ctx.bounces else slope
        pieces = (
            slope[:own].reshape(-1, 3),
            slope[own : own + 3],
            slope[own + 3 : -7].reshape(-1, 3),
            slope[-7:-1].reshape(2, 3),
            slope[-1:].reshape(()),
        )
        last = None if by_restitution is None else torch.from_numpy(by_restitution).to(weight)
        return (*(torch.from_numpy(piece).to(weight) for piece in pieces), None, last, *[None] * 6)


def _refuse_second_derivative() -> None:
    """Autograd records the backward pass only when a derivative of the derivative is wanted."""
    if torch.is_grad_enabled():
        raise InvalidValueError("create_graph", True, "False: the loss has no second derivative, since its impulses stay fixed")


def _weighted(slopes: Tensor, weight: Tensor, solved: Tensor) -> Tensor:
    """Slopes (B, ...) times weights (B,), nothing where the impulses are not solved."""
    shape = (-1, *[1] * (slopes.ndim - 1))
    return torch.where(solved.reshape(shape), slopes * weight.reshape(shape), 0.0)


def _closing(weights: ConeWeights, like: Tensor) -> Tensor:
    tangent = weights.complementarity_tangent
    return like.new_tensor([weights.complementarity_normal, tangent, tangent])


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
