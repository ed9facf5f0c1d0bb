"""One forward pass of a model over transitions, and what one backward pass makes of it (method.md 1.4, 1.5, 2.7).

Whatever the estimator, a score is a backward pass from some slopes by the model's outputs for a transition (its contacts, or
the velocity that it misses) to the slopes by every layer's outputs, and no gradient by a weight is ever formed:

    empirical      g = -1/2 dL/dtheta                                      from the loss L at impulses that stay fixed
    Gauss-Newton   g = d(r . rtilde)/dtheta, rtilde = P xi, xi ~ N(0, I)   from its residuals r, |r|^2 = L; E[g g^T] = F

For an end-to-end model r is the missed velocity itself and there is no impulse to take out: its information is that of the
squared loss, whatever it is trained on, and r's six components give the Gauss-Newton matrix exactly.

For all others that matrix is a sum over many residuals, sum_j s_j s_j^T, s_j the slopes of one of them by the outputs. A few
backward passes stand for many (`leading_slopes`): for any orthonormal columns Q in the space of the residuals and a vector e of
random signs,

    sum_q (S^T q)(S^T q)^T + (S^T e')(S^T e')^T,   e' = (I - Q Q^T) e

has that sum as its mean, and only what Q misses is noisy. A few steps of subspace iteration find a Q that misses little (as in
Hutch++: Meyer, Musco, Musco, Woodruff 2021).
"""

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.model import Model, Rows
from contact_curation.contact.models.stream_network import LayerTrace
from contact_curation.contact.torch_contacts import Contacts, Frames
from contact_curation.contact.torch_loss import cone_problems, residuals
from contact_curation.geometry.quaternions import Array
from contact_curation.solver.certificate import free_directions, objectives
from contact_curation.solver.cone_problem import SolveStatus

Slopes = tuple[Tensor, ...]
"""Of one number per transition, by each of a model's outputs, or of its layers'."""

ITERATIONS = 2
"""Of the subspace iteration; each multiplies what is weak by the square of its share."""


@dataclass(frozen=True, eq=False)
class ForwardPass:
    """A model's outputs for B transitions.

    Attributes:
        rows, frames: what was measured.
        tape: every layer's streams.
        outputs: contacts, or the missed velocities (B, 6); in the graph that leads back to the tape.
        losses: (B,) NaN where not solved.
        solved: (B,) whether the impulses carry a certificate.
        misfits: (B,) natural residual of the impulses.
        impulses: (B, K, 3), which stay fixed; None for a model that has none to solve for.
        config: weights of the loss, and its cone.
    """

    rows: Rows
    frames: Frames
    tape: tuple[LayerTrace, ...]
    outputs: tuple[Tensor, ...]
    losses: Array
    solved: NDArray[np.bool_]
    misfits: Array
    impulses: Tensor | None
    config: LossConfig

    def score_slopes(self, influence: Array) -> Slopes:
        """Slopes (1, B, ...) of the log-likelihood -L/2 by the outputs, times `influence` (B,)."""
        leaves = self._leaves()
        squares = self._residuals(leaves).square().sum(dim=1)
        return tuple(
            slope[None] for slope in torch.autograd.grad(squares, leaves, -0.5 * torch.as_tensor(influence).to(squares))
        )

    def profile_slopes(self, directions: Tensor, influence: Array) -> Slopes:
        """Slopes (n, B, ...) of r . rtilde by the outputs, times `influence` (B,), for n directions.

        Args:
            directions: (n, B, `directions_size`) xi; the second moment of rtilde is P times that of xi.
            influence: of each transition.
        """
        leaves = self._leaves()
        profiled = directions if self.impulses is None else self._profiled(directions, self.impulses)
        weighted = torch.as_tensor(influence).to(profiled)[:, None] * profiled
        return torch.autograd.grad(self._residuals(leaves), leaves, weighted, is_grads_batched=True)

    @property
    def directions_size(self) -> int:
        """Numbers in a xi: one per residual, and one per impulse for what the regularisation leaves of it."""
        return 6 if self.impulses is None else 6 + 9 * self.impulses.shape[1]

    def deltas(self, slopes: Slopes) -> Slopes:
        """Slopes (B, S + R, H) by the outputs of every layer on the tape, from slopes (B, ...) by the model's outputs."""
        return torch.autograd.grad(self.outputs, [trace.outputs for trace in self.tape], slopes, retain_graph=True)

    def _leaves(self) -> tuple[Tensor, ...]:
        return tuple(value.detach().requires_grad_() for value in self.outputs)

    def _residuals(self, outputs: tuple[Tensor, ...]) -> Tensor:
        """(B, R)."""
        if self.impulses is None:
            return outputs[0].clone()  # a tensor by itself has no batched gradient
        return contact_residuals(Contacts(*outputs), self.frames, self.impulses, self.config)

    def _profiled(self, directions: Tensor, impulses: Tensor) -> Tensor:
        """P's share of each direction, (n, B, R): xi - J S^-1 (J^T xi + sqrt(eps) eta) with S = J^T J + eps I.

        J is by the free directions of the impulses, eta the last 3K numbers of a direction. The second moment of what comes out
        is P = I - J S^-1 J^T exactly, with the regularisation.
        """
        free = self._by_free_impulses(Contacts(*(value.detach() for value in self.outputs)), impulses)
        plain, extra = directions[..., : free.shape[1]], directions[..., free.shape[1] :]
        eps = self.config.regularization
        matrix = free.mT @ free + eps * torch.eye(free.shape[2], dtype=free.dtype, device=free.device)
        pulled = torch.einsum("brf,nbr->bfn", free, plain) + eps**0.5 * extra.permute(1, 2, 0)
        spent: Tensor = free @ torch.linalg.solve(matrix, pulled)  # (B, R, n)
        return plain - spent.permute(2, 0, 1)

    def _by_free_impulses(self, contacts: Contacts, impulses: Tensor) -> Tensor:
        """Derivatives (B, R, 3K) of the residuals along the directions in which the impulses are free to move."""
        problems = cone_problems(contacts, self.frames, self.config)
        known = impulses.cpu().numpy()
        gradients = objectives(problems, known).gradients
        bases = torch.as_tensor(free_directions(known, gradients, self.config.cone)).to(impulses)
        by_impulse = residuals_by_impulses(contacts, self.frames, impulses, self.config)
        free: Tensor = torch.einsum("brkc,bkcd->brkd", by_impulse, bases).flatten(-2)
        return free


def frozen_copy(model: Model) -> Model:
    """A model of its own whose backward pass stops at the layers' outputs, without any gradient by a weight."""
    own = copy.deepcopy(model).requires_grad_(False)
    for network in own.networks.values():
        network.linear[0].bias.requires_grad_()  # without it there would be no graph
    return own


def forward_pass(model: Model, rows: Rows, config: LossConfig) -> ForwardPass:
    """The forward pass of a `frozen_copy` over B transitions."""
    tape: list[LayerTrace] = []
    frames = Frames.of(model.body, *rows, model.device, precesses=model.precesses)
    outputs = model.outputs(rows, tape)
    known = tuple(value.detach() for value in outputs)
    solutions = model.solve(known, frames, config)
    if solutions is None:
        losses = known[0].square().sum(dim=1).cpu().numpy()
        solved = np.isfinite(losses)
        return ForwardPass(rows, frames, tuple(tape), outputs, losses, solved, np.where(solved, 0.0, np.inf), None, config)
    contacts = Contacts(*known)
    solved = solutions.status == SolveStatus.SOLVED
    impulses = torch.as_tensor(np.where(solved[:, None, None], solutions.impulses, 0.0), device=model.device)
    squares = contact_residuals(contacts, frames, impulses, config).square().sum(dim=1).cpu().numpy()
    losses = np.where(solved, squares, np.nan)
    return ForwardPass(rows, frames, tuple(tape), outputs, losses, solved, solutions.residuals, impulses, config)


def contact_residuals(contacts: Contacts, frames: Frames, impulses: Tensor, config: LossConfig) -> Tensor:
    """All residuals (B, 6 + 6K) side by side."""
    return torch.cat(residuals(contacts, frames, impulses, config.weights), dim=-1)


def residuals_by_impulses(contacts: Contacts, frames: Frames, impulses: Tensor, config: LossConfig) -> Tensor:
    """Derivatives (B, 6 + 6K, K, 3) of all residuals by the impulses; in them residuals are linear, but for the penetration."""
    weights, jacobians = config.weights, contacts.jacobians
    batch, count = contacts.gaps.shape
    change = torch.einsum("bac,bkic->baki", frames.inverse_mass, jacobians)  # (B, 6, K, 3)
    slip = torch.einsum("bkta,ba->bkt", jacobians[:, :, 1:], frames.velocities_next)
    speed = torch.linalg.vector_norm(slip, dim=-1)
    own = contacts.gaps.new_zeros(batch, count, 6, 3)  # of each contact by its own impulse
    own[..., 0, 0] = weights.complementarity_normal**0.5 * contacts.gaps_next
    plane, contact = (torch.eye(size, dtype=own.dtype, device=own.device) for size in (2, count))
    own[..., 1:3, 1:] = weights.complementarity_tangent**0.5 * contacts.gaps_next[..., None, None] * plane
    own[..., 3:5, 0] = weights.dissipation**0.5 * slip
    own[..., 3:5, 1:] = weights.dissipation**0.5 * speed[..., None, None] * plane
    apart = torch.einsum("bkfi,kj->bfkji", own, contact)  # (B, 6, K, K, 3)
    *_, predicted = residuals(contacts, frames, impulses, weights)
    touching = weights.penetration**0.5 * frames.dt[:, None] * (predicted < 0.0)
    pressing = torch.einsum("bk,bka,baji->bkji", touching, jacobians[:, :, 0], change)
    sideways, against = (apart[:, part].transpose(1, 2).flatten(1, 2) for part in (slice(1, 3), slice(3, 5)))
    return torch.cat([weights.match**0.5 * change, apart[:, 0], sideways, against, pressing], dim=1)


class Draws(NamedTuple):
    """Random numbers of B transitions: signs e (B, m, 1), and where the iteration for Q begins (B, m, count - 1)."""

    signs: Array
    basis: Array

    @staticmethod
    def of(rng: np.random.Generator, batch: int, residuals: int, count: int) -> "Draws":
        signs = np.asarray(rng.choice([-1.0, 1.0], (batch, residuals, 1)), dtype=float)
        return Draws(signs, rng.standard_normal((batch, residuals, count - 1)))


def leading_slopes(slopes: Slopes, weights: Sequence[float], draws: Draws) -> Slopes:
    """Slopes (count, B, ...) whose outer products have those of slopes (m, B, ...) as their mean, for each of B transitions.

    Args:
        slopes: by each of a model's outputs.
        weights: how far theta moves each output: what is strong is judged by it, and nothing but noise depends on it.
        draws: of count >= 1 slopes.
    """
    rows = torch.cat([slope.flatten(2) for slope in slopes], dim=2).transpose(0, 1)  # (B, m, C)
    count = draws.basis.shape[2] + 1
    if count >= len(slopes[0]):
        return slopes
    sizes = [slope[0, 0].numel() for slope in slopes]
    weighted = rows * torch.as_tensor(np.repeat(weights, sizes)).to(rows)
    rest, basis = (torch.as_tensor(drawn).to(rows) for drawn in draws)
    for _ in range(ITERATIONS if count > 1 else 0):
        basis = torch.linalg.qr(weighted @ (weighted.mT @ basis))[0]
    directions = torch.cat([basis, rest - basis @ (basis.mT @ rest)], dim=2)
    made = torch.split((directions.mT @ rows).transpose(0, 1), sizes, dim=2)
    return tuple(part.reshape(count, *slope.shape[1:]) for part, slope in zip(made, slopes, strict=True))
