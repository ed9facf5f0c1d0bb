"""Fisher matrices of tosses in plain torch: the fallback where no kernel can be loaded, and the reference it is tested against.

Gauss-Newton matrices are built densely from the Jacobians of all residuals r by automatic differentiation (METHOD 1.5):

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
from contact_curation.contact.torch_contacts import Frames, Theta, contacts_of
from contact_curation.contact.torch_evaluation import evaluate_in_torch
from contact_curation.contact.torch_loss import cone_problems, residuals
from contact_curation.geometry.quaternions import Array
from contact_curation.solver.certificate import FACET_NORMALS, objectives
from contact_curation.solver.cone_problem import Cone

CHUNK = 512
"""Transitions that are differentiated at a time."""

FREE_TOLERANCE = 1e-6
"""An impulse is at the cone's apex below this, inside the cone when its dual is below this, on a facet when its gap is."""


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
            frames = Frames.of(body, before[rows], after[rows], dt[rows], device)
            each = profile_fishers(geometry, frames, found.impulses[rows], config)
            fishers[k] = np.einsum("n,npq->pq", influence**2, each)
    return FisherSums(fishers, score_sums, found.losses, found.residuals, found.status)


def profile_fishers(geometry: ContactGeometry, frames: Frames, impulses: Array, config: LossConfig = DEFAULT_LOSS) -> Array:
    """Gauss-Newton profile Fisher matrices (B, 6V + 10, 6V + 10) of transitions whose impulses (B, V, 3) are optimal."""
    theta = Theta.of(geometry, frames.dt.device)
    given = torch.as_tensor(impulses, device=frames.dt.device)
    problems = cone_problems(contacts_of(theta, frames), frames, config)
    bases = torch.as_tensor(free_directions(impulses, objectives(problems, impulses).gradients, config.cone)).to(given)
    pieces = [slice(first, first + CHUNK) for first in range(0, len(given), CHUNK)]
    matrices = [_profiled(theta, frames.rows(piece), given[piece], bases[piece], config) for piece in pieces]
    return torch.cat(matrices).cpu().numpy() if matrices else np.zeros((0, len(theta.vector()), len(theta.vector())))


def free_directions(impulses: Array, gradients: Array, cone: Cone) -> Array:
    """Orthonormal directions (B, V, 3, 3), as columns, in which optimal impulses (B, V, 3) may move; other columns are zero.

    All three inside the cone, none at its apex; on its surface those along it: of the circular cone the ray and the rim's
    direction, of the polyhedral one those of the facet, or the ray where two facets meet.
    """
    found = np.zeros((*impulses.shape, 3))
    for place in np.ndindex(impulses.shape[:2]):
        columns = _free(impulses[place], float(gradients[place][0]), cone)
        found[place][:, : columns.shape[1]] = columns
    return found


def _free(impulse: Array, dual: float, cone: Cone) -> Array:
    """Columns (3, 0 to 3)."""
    if impulse[0] <= FREE_TOLERANCE:
        return np.zeros((3, 0))
    if dual <= FREE_TOLERANCE:
        return np.eye(3)
    if cone is Cone.CIRCULAR:
        across = np.array([0.0, -impulse[2], impulse[1]])
        return np.stack([impulse / np.linalg.norm(impulse), across / np.linalg.norm(across)], axis=1)
    touching = FACET_NORMALS[FACET_NORMALS @ impulse <= FREE_TOLERANCE]
    if len(touching) == 1:
        normal = touching[0]
        return np.stack([np.array([1.0, *-normal[1:]]) / np.sqrt(2.0), [0.0, normal[2], -normal[1]]], axis=1)
    return (impulse / np.linalg.norm(impulse))[:, None]


def _profiled(theta: Theta, frames: Frames, impulses: Tensor, bases: Tensor, config: LossConfig) -> Tensor:
    def stacked(vector: Tensor, moved: Tensor, row: Frames) -> Tensor:
        return torch.cat(residuals(contacts_of(theta.with_vector(vector), row), row, moved, config.weights))

    derivative = torch.func.vmap(torch.func.jacrev(stacked, argnums=(0, 1)), in_dims=(None, 0, 0))
    by_theta, by_impulse = derivative(theta.vector(), impulses, frames)  # (b, R, Q), (b, R, V, 3)
    free = torch.einsum("brvc,bvcd->brvd", by_impulse, bases).flatten(-2)  # (b, R, 3V)
    damping = config.regularization * torch.eye(free.shape[-1], dtype=free.dtype, device=free.device)
    explained = free.mT @ by_theta
    spent: Tensor = explained.mT @ torch.linalg.solve(free.mT @ free + damping, explained)
    gained: Tensor = by_theta.mT @ by_theta
    return gained - spent
