"""The loss of METHOD 1.2 at fixed impulses with its slopes by gaps and Jacobians, written out: a training step needs no more.

With p = J^T l, u = v_f + M^-1 p, r = u - v', s_i = J_t,i v', e_i = l_n,i s_i + |s_i| l_t,i, N_i = min(0, phi_i + dt J_n,i u):

    dL/dphi_i   = 2 w_s N_i
    dL/dphi'_i  = 2 phi'_i (w_n l_n,i^2 + w_t |l_t,i|^2)
    dL/dJ_i     = l_i y^T + [2 w_s dt N_i u;  2 w_c (l_n,i e_i + (e_i . l_t,i) s_i / |s_i|) v'^T]
    y           = M^-T (2 w_m r + 2 w_s dt sum_i N_i J_n,i)
"""

import torch
from torch import Tensor

from contact_curation.contact.torch_contacts import Contacts, Frames
from contact_curation.solver.cone_problem import ConeWeights

SMALLEST_SLIP = 1e-300
"""Below it a slip has no direction, and no slope by it (METHOD E2)."""


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
        rubbing = 2.0 * weights.dissipation * (normal * against + turning * slip)  # (B, K, 2)

        slopes = impulses[..., None] * returned[:, None, None]  # (B, K, 3, 6)
        slopes[:, :, 0] += approach[..., None] * reached[:, None]
        slopes[:, :, 1:] += rubbing[..., None] * frames.velocities_next[:, None, None]
        at_contacts = gaps_next.square() * open_ + weights.penetration * inside.square()
        at_contacts += weights.dissipation * against.square().sum(dim=-1)
        losses = weights.match * missed.square().sum(dim=-1) + at_contacts.sum(dim=-1)
        return losses, Contacts(deeper, 2.0 * gaps_next * open_, slopes)


def _closing(weights: ConeWeights, like: Tensor) -> Tensor:
    tangent = weights.complementarity_tangent
    return like.new_tensor([weights.complementarity_normal, tangent, tangent])
