"""Certificate of a solution of the inner problem: it uses the objective alone, not the method that found the solution.

The natural residual |l - proj(l - gradient)|_inf is zero at the minimum only.
"""

from typing import NamedTuple

import numpy as np

from contact_curation.solver.cone_problem import Array, Cone, ConeProblems, quadratic_form

FACETS = 8
FACET_ANGLES = 2.0 * np.pi * np.arange(FACETS) / FACETS
FACET_NORMALS: Array = np.stack([np.ones(FACETS), -np.cos(FACET_ANGLES), -np.sin(FACET_ANGLES)], axis=1)
"""(8, 3) the polyhedral cone is FACET_NORMALS l >= 0: tangent . d_k <= normal, as in ContactNets' loss, around the disk."""

EDGE_ANGLES = FACET_ANGLES + np.pi / FACETS
EDGES: Array = np.stack([np.full(FACETS, np.cos(np.pi / FACETS)), np.cos(EDGE_ANGLES), np.sin(EDGE_ANGLES)], axis=1)
"""(8, 3) where neighbouring facets meet."""

FREE_TOLERANCE = 1e-6
"""Tolerance: a smaller impulse is at the cone's apex, a smaller dual means inside the cone, a smaller distance on a facet."""

INSIDE = 1e-12
"""A candidate for a projection may violate a facet by this share of its length."""


class Objectives(NamedTuple):
    """Values of the objective (B,), regularisation included, and its gradients (B, K, 3)."""

    values: Array
    gradients: Array


def objectives(problems: ConeProblems, impulses: Array) -> Objectives:
    """Evaluates the objective of the inner problem at impulses (B, K, 3)."""
    form, weights = quadratic_form(problems), problems.weights
    flat = impulses.reshape(problems.batch, -1)  # (B, 3K)
    miss = np.einsum("ban,bn->ba", form.motion, flat) - form.target
    slack = np.minimum(0.0, form.slack_offsets + np.einsum("bkn,bn->bk", form.slack_rows, flat))
    curved = np.einsum("bkij,bkj->bki", form.blocks, impulses) + weights.regularization * impulses
    values = weights.match * (miss**2).sum(axis=1) + weights.penetration * (slack**2).sum(axis=1)
    pull = weights.match * np.einsum("ban,ba->bn", form.motion, miss)
    pull += weights.penetration * np.einsum("bkn,bk->bn", form.slack_rows, slack)
    return Objectives(values + (curved * impulses).sum(axis=(1, 2)), 2.0 * (pull.reshape(impulses.shape) + curved))


def natural_residuals(problems: ConeProblems, impulses: Array) -> Array:
    """Computes the natural residuals (B,) of impulses (B, K, 3); NaN where a number is not finite."""
    with np.errstate(invalid="ignore", over="ignore"):
        trial = impulses - objectives(problems, impulses).gradients
        return np.asarray(np.abs(impulses - project(trial, problems.cone)).max(axis=(1, 2)))


def project(points: Array, cone: Cone) -> Array:
    """Projects points (..., 3) onto the friction cone."""
    return project_circular(points) if cone is Cone.CIRCULAR else project_polyhedral(points)


def project_circular(points: Array) -> Array:
    """Projects points (..., 3) = (normal, tangent 1, tangent 2) onto the circular cone |tangent| <= normal."""
    normal, radius = points[..., :1], np.linalg.norm(points[..., 1:], axis=-1, keepdims=True)
    along = 0.5 * (normal + radius)
    rim = along * np.concatenate([np.ones_like(radius), points[..., 1:] / np.where(radius > 0.0, radius, 1.0)], axis=-1)
    return np.where(radius <= normal, points, np.where(radius <= -normal, 0.0 * points, rim))


def project_polyhedral(points: Array) -> Array:
    """Projects points (..., 3) onto the polyhedral cone: the nearest of the projections onto its facets, edges and apex."""
    on_facets = points[..., None, :] - (points @ FACET_NORMALS.T)[..., None] / 2.0 * FACET_NORMALS  # (..., 8, 3)
    lengths = np.maximum(0.0, points @ EDGES.T / np.square(EDGES[0]).sum())
    feet = np.concatenate([points[..., None, :], on_facets, lengths[..., None] * EDGES], axis=-2)  # (..., 17, 3)
    slack = INSIDE * np.linalg.norm(points, axis=-1)[..., None]
    outside = (feet @ FACET_NORMALS.T).min(axis=-1) < -slack
    distance = np.where(outside, np.inf, np.square(feet - points[..., None, :]).sum(axis=-1))
    nearest = np.take_along_axis(feet, np.argmin(distance, axis=-1)[..., None, None], axis=-2)[..., 0, :]
    return np.where(np.isfinite(points).all(axis=-1, keepdims=True), nearest, np.nan)


def free_directions(impulses: Array, gradients: Array, cone: Cone) -> Array:
    """Orthonormal directions (B, K, 3, 3), as columns, in which optimal impulses (B, K, 3) may move; other columns are zero.

    Inside the cone all three directions are free, at its apex none. On the surface of the circular cone two are: along the ray
    and along the rim. On a facet of the polyhedral cone two are: those of the facet; where two facets meet, one: the edge.
    """
    found = np.zeros((*impulses.shape, 3))
    for place in np.ndindex(impulses.shape[:2]):
        columns = _free(impulses[place], float(gradients[place][0]), cone)
        found[place][:, : columns.shape[1]] = columns
    return found


def _free(impulse: Array, dual: float, cone: Cone) -> Array:
    """The free directions of one impulse, as columns (3, 0 to 3)."""
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
