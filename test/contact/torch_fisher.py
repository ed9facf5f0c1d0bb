"""Fisher matrices of tosses in plain torch, the reference that the kernel is tested against.

Gauss-Newton matrices are built densely from the Jacobians of all residuals r by automatic differentiation (method.md 1.5):

    F = J_theta^T P J_theta,   P = I - J_l B (B^T J_l^T J_l B + eps I)^-1 B^T J_l^T,   B the free directions of the impulses
"""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from contact_curation.contact.body import Body
from contact_curation.contact.evaluation import Estimator, FisherSums
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import DEFAULT_LOSS, LossConfig
from contact_curation.contact.torch_contacts import Contacts, Frames, Theta, contacts_of
from contact_curation.contact.torch_loss import cone_problems, residuals
from contact_curation.geometry.quaternions import Array
from contact_curation.solver.certificate import free_directions, objectives
from test.contact.torch_evaluation import evaluate_in_torch

CHUNK = 512
"""Transitions that are differentiated at a time."""


def fisher_sums_in_torch(
    geometry: ContactGeometry,
    body: Body,
    before: Array,
    after: Array,
    dt: Array,
    starts: NDArray[np.int64],
    estimator: Estimator,
    influence_bound: float = np.inf,
    config: LossConfig = DEFAULT_LOSS,
    device: str | torch.device = "cpu",
) -> FisherSums:
    """The same as `evaluation.fisher_sums`, without compiled code, on a device of torch; arguments already checked."""
    found = evaluate_in_torch(geometry, body, before, after, dt, config, device)
    size = found.scores.shape[1]
    fishers, score_sums = np.zeros((len(starts) - 1, size, size)), np.zeros((len(starts) - 1, size))
    for k in range(len(starts) - 1):
        rows = starts[k] + np.flatnonzero(found.solved[starts[k] : starts[k + 1]])
        influence = np.minimum(1.0, influence_bound / np.maximum(found.losses[rows], np.finfo(float).tiny))
        scores = found.scores[rows] * influence[:, None]
        score_sums[k] = scores.sum(axis=0)
        if estimator is Estimator.EMPIRICAL:
            fishers[k] = scores.T @ scores
        else:
            frames = Frames.of(body, before[rows], after[rows], dt[rows], device, precesses=geometry.is_rigid)
            each = profile_fishers(geometry, frames, found.impulses[rows], config.for_theta(body, geometry.is_rigid))
            fishers[k] = np.einsum("n,npq->pq", influence**2, each)
    return FisherSums(fishers, score_sums, found.losses, found.residuals, found.status)


def profile_fishers(geometry: ContactGeometry, frames: Frames, impulses: Array, config: LossConfig = DEFAULT_LOSS) -> Array:
    """Gauss-Newton profile Fisher matrices (B, P, P) of transitions whose impulses (B, V, 3) are optimal.

    P is 6V + 10, and one more with a restitution.
    """
    theta = Theta.of(geometry, frames.dt.device)
    vector = theta.vector()
    if geometry.restitution is not None:
        vector = torch.cat([vector, vector.new_tensor([geometry.restitution])])
    given = torch.as_tensor(impulses, device=frames.dt.device)
    problems = cone_problems(_contacts(theta, vector, frames), frames, config)
    bases = torch.as_tensor(free_directions(impulses, objectives(problems, impulses).gradients, config.cone)).to(given)
    pieces = [slice(first, first + CHUNK) for first in range(0, len(given), CHUNK)]
    matrices = [_profiled(theta, vector, frames.rows(piece), given[piece], bases[piece], config) for piece in pieces]
    return torch.cat(matrices).cpu().numpy() if matrices else np.zeros((0, len(vector), len(vector)))


def _contacts(theta: Theta, vector: Tensor, frames: Frames) -> Contacts:
    """Gaps and Jacobians of the parameters (P,); a restitution, the last one, mirrors depths in the ground (method.md 1.2)."""
    size = len(theta.vector())
    contacts = contacts_of(theta.with_vector(vector[:size]), frames)
    if len(vector) == size:
        return contacts
    gaps, gaps_next, jacobians = contacts
    reached = gaps + frames.dt[..., None] * torch.einsum("...ka,...a->...k", jacobians[..., 0, :], frames.free_velocities)
    mirrored = vector[size] * (reached - gaps.clamp(max=0.0)).clamp(max=0.0)
    return Contacts(gaps + mirrored, gaps_next + mirrored, jacobians)


def _profiled(theta: Theta, vector: Tensor, frames: Frames, impulses: Tensor, bases: Tensor, config: LossConfig) -> Tensor:
    def stacked(changed: Tensor, moved: Tensor, row: Frames) -> Tensor:
        return torch.cat(residuals(_contacts(theta, changed, row), row, moved, config.weights))

    derivative = torch.func.vmap(torch.func.jacrev(stacked, argnums=(0, 1)), in_dims=(None, 0, 0))
    by_theta, by_impulse = derivative(vector, impulses, frames)  # (b, R, P), (b, R, V, 3)
    free = torch.einsum("brvc,bvcd->brvd", by_impulse, bases).flatten(-2)  # (b, R, 3V)
    damping = config.regularization * torch.eye(free.shape[-1], dtype=free.dtype, device=free.device)
    explained = free.mT @ by_theta
    spent: Tensor = explained.mT @ torch.linalg.solve(free.mT @ free + damping, explained)
    gained: Tensor = by_theta.mT @ by_theta
    return gained - spent
