"""The loss of METHOD 1.2 in torch, at impulses that stay fixed, and as a differentiable function for training.

The loss is |r|^2 of 6 + 6K residuals: sqrt(w_m) (M^-1 J^T l - dv), phi' l, e = l_n s + |s| l_t and min(0, predicted phi), each
with the root of its weight. By the envelope theorem its gradient by theta needs no derivative of the impulses (METHOD E5). Its
Hessian does, so that a second derivative is refused.
"""

from typing import Any

import numpy as np
import torch
from torch import Tensor

from contact_curation.contact.body import Body
from contact_curation.contact.evaluation import SolveStatus, evaluate
from contact_curation.contact.loss_config import DEFAULT_LOSS, LossConfig
from contact_curation.contact.loss_slopes import loss_and_slopes
from contact_curation.contact.torch_contacts import Contacts, Frames, Theta
from contact_curation.errors import InvalidValueError, MissingDependencyError
from contact_curation.geometry.quaternions import Array
from contact_curation.solver.compiled_solver import solve_compiled
from contact_curation.solver.cone_problem import ConeProblems, ConeSolutions, ConeWeights
from contact_curation.solver.torch_solver import solve_in_torch


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


def loss_terms(contacts: Contacts, frames: Frames, impulses: Tensor, weights: ConeWeights) -> Tensor:
    """The weighted terms (..., 5) of the loss in the order of `evaluation.LOSS_TERMS`, impulses (..., K, 3) given."""
    return torch.stack([r.square().sum(dim=-1) for r in residuals(contacts, frames, impulses, weights)], dim=-1)


def solve_contacts(contacts: Contacts, frames: Frames, config: LossConfig = DEFAULT_LOSS) -> ConeSolutions:
    """The impulses of B transitions of any contact model: by the compiled kernel, or in torch where none can be loaded."""
    problems = cone_problems(contacts, frames, config)
    try:
        return solve_compiled(problems, config.tolerance, config.max_iterations, config.threads)
    except MissingDependencyError:
        return solve_in_torch(problems, config.tolerance, device=contacts.gaps.device)


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
    theta: Theta, body: Body, before: Array, after: Array, dt: Array, config: LossConfig = DEFAULT_LOSS
) -> tuple[Tensor, Tensor]:
    """The loss of B transitions of a polytope, differentiable by theta through the scores of `evaluate`.

    Args:
        theta: one for all transitions.
        body: mass, inertia and gravity.
        before, after: (B, 13) states.
        dt: (B,) frame periods [s].
        config: weights and solver.

    Returns:
        As `contact_losses`.
    """
    losses, solved = _PolytopeLoss.apply(*theta, body, before, after, dt, config)
    return losses, solved


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
        body: Body,
        before: Array,
        after: Array,
        dt: Array,
        config: LossConfig,
    ) -> tuple[Tensor, Tensor]:
        theta = Theta(vertices_normal, normal, vertices_tangent, tangents, height, pivot)
        found = evaluate(theta.geometry(), body, before, after, dt, config)
        solved = torch.from_numpy(found.solved).to(normal.device)
        ctx.solved, ctx.scores, ctx.own = found.solved, found.scores, vertices_normal.numel()
        ctx.mark_non_differentiable(solved)
        return torch.from_numpy(np.where(found.solved, found.losses, np.nan)).to(normal.device), solved

    @staticmethod
    def backward(ctx: Any, weight: Tensor, _: Tensor) -> tuple[Tensor | None, ...]:
        _refuse_second_derivative()
        counted = np.flatnonzero(ctx.solved)
        slope = -2.0 * (weight.cpu().numpy()[counted] @ ctx.scores[counted])
        own = ctx.own
        pieces = (
            slope[:own].reshape(-1, 3),
            slope[own : own + 3],
            slope[own + 3 : -7].reshape(-1, 3),
            slope[-7:-1].reshape(2, 3),
            slope[-1:].reshape(()),
        )
        return (*(torch.from_numpy(piece).to(weight) for piece in pieces), *[None] * 6)


def _refuse_second_derivative() -> None:
    """Autograd records the backward pass only when a derivative of the derivative is wanted."""
    if torch.is_grad_enabled():
        raise InvalidValueError("create_graph", True, "False: the loss has no second derivative, since its impulses stay fixed")


def _weighted(slopes: Tensor, weight: Tensor, solved: Tensor) -> Tensor:
    """Slopes (B, ...) times weights (B,), nothing where the impulses are not solved."""
    shape = (-1, *[1] * (slopes.ndim - 1))
    return torch.where(solved.reshape(shape), slopes * weight.reshape(shape), 0.0)
