"""Loss, impulses and scores in plain torch, the reference that the kernel is tested against.

Scores come from autograd of the loss at fixed impulses, one theta per transition.
"""

import torch
from numpy.typing import ArrayLike
from torch import Tensor

from contact_curation.contact.body import Body
from contact_curation.contact.evaluation import Evaluation, checked_transitions
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import DEFAULT_LOSS, LossConfig
from contact_curation.contact.torch_contacts import Contacts, Frames, Theta, contacts_of
from contact_curation.contact.torch_loss import cone_problems, residuals
from contact_curation.geometry.quaternions import Array
from contact_curation.solver.cone_problem import ConeWeights
from test.solver.torch_solver import solve_in_torch

CHUNK = 4096
"""Transitions that are differentiated at a time."""


def evaluate_in_torch(
    geometry: ContactGeometry,
    body: Body,
    before: ArrayLike,
    after: ArrayLike,
    dt: ArrayLike,
    config: LossConfig = DEFAULT_LOSS,
    device: str | torch.device = "cpu",
) -> Evaluation:
    """The same as `evaluation.evaluate`, without compiled code, on a device of torch.

    `config.threads` and `config.max_iterations` are the kernel's; torch has its own.
    """
    first, second, periods = checked_transitions(geometry, before, after, dt)
    config = config.for_theta(body, geometry.is_rigid)
    theta, frames = Theta.of(geometry, device), Frames.of(body, first, second, periods, device, precesses=geometry.is_rigid)
    with torch.no_grad():
        solutions = solve_in_torch(cone_problems(contacts_of(theta, frames), frames, config), config.tolerance, device=device)
    impulses = torch.as_tensor(solutions.impulses, device=device)
    terms, scores = _terms_and_scores(theta, frames, impulses, config)
    return Evaluation(terms, solutions.impulses, scores, solutions.residuals, solutions.status, solutions.iterations)


def loss_terms(contacts: Contacts, frames: Frames, impulses: Tensor, weights: ConeWeights) -> Tensor:
    """The weighted terms (..., 5) of the loss in the order of `evaluation.LOSS_TERMS`, impulses (..., K, 3) given."""
    return torch.stack([r.square().sum(dim=-1) for r in residuals(contacts, frames, impulses, weights)], dim=-1)


def _terms_and_scores(theta: Theta, frames: Frames, impulses: Tensor, config: LossConfig) -> tuple[Array, Array]:
    """Loss terms (B, 5) and scores -dL/2 (B, 6V + 10) at fixed impulses (B, V, 3)."""
    terms, scores = [], []
    for first in range(0, len(impulses), CHUNK):
        piece = slice(first, first + CHUNK)
        rows = frames.rows(piece)
        with torch.enable_grad():  # whoever asks may not want gradients of his own
            each = theta.vector().repeat(len(impulses[piece]), 1).requires_grad_()  # (b, 6V + 10)
            found = loss_terms(contacts_of(theta.with_vector(each), rows), rows, impulses[piece], config.weights)
            (slopes,) = torch.autograd.grad(found.sum(), each)
        terms.append(found.detach())
        scores.append(-0.5 * slopes)
    return torch.cat(terms).cpu().numpy(), torch.cat(scores).cpu().numpy()
