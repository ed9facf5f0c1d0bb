"""How far a learned shape is from the body as described, whatever the order of its vertices.

A fit from another start may end at the same shape with two vertices exchanged. So vertices are compared after the matching with
the least sum of squared distances (Kuhn 1955, "The Hungarian method"). Beside it stands the Hausdorff distance of both hulls,
which needs no matching: the farthest that a point of one is from the other. From a convex body it is largest at a vertex.
A vertex inside the hull counts in the first distance, and not in the second.
"""

from typing import NamedTuple

import numpy as np

from contact_curation.contact.models.model import Model
from contact_curation.geometry.quaternions import Array

STIFF = 1e4
"""How much more the sum of the weights of a point in a hull counts than its distance, for a body of size 1."""


class ShapeErrors(NamedTuple):
    """A model's shape and friction against the body as described.

    Attributes:
        vertex_rms: root mean square distance of the vertices, matched [characteristic lengths].
        vertex_rms_mm: the same [mm].
        hull_mm: Hausdorff distance of the hulls [mm].
        friction: the model's coefficient.
        friction_error: what it is above the body's.
    """

    vertex_rms: float
    vertex_rms_mm: float
    hull_mm: float
    friction: float
    friction_error: float


def shape_errors(model: Model) -> ShapeErrors | None:
    """Errors of a model's vertices and friction; None for a model that is no polytope."""
    geometry, body = model.geometry(), model.body
    if geometry is None:
        return None
    off = float(np.sqrt(np.square(matched_distances(geometry.vertices_normal, body.scaled_vertices)).mean()))
    hull = hull_distance(geometry.vertices_normal, body.scaled_vertices)
    in_mm = 1e3 * body.length_scale
    return ShapeErrors(off, in_mm * off, in_mm * hull, geometry.friction, geometry.friction - body.friction)


def matched_distances(vertices: Array, others: Array) -> Array:
    """Distances of vertices (V, 3) from others (W, 3), of the min(V, W) pairs that match best."""
    from scipy.optimize import linear_sum_assignment  # takes a quarter of a second to import

    distances = np.linalg.norm(vertices[:, np.newaxis] - others, axis=2)
    return np.asarray(distances[linear_sum_assignment(np.square(distances))])


def hull_distance(vertices: Array, others: Array) -> float:
    """Hausdorff distance of the convex hulls of two sets of points (V, 3) and (W, 3)."""
    return max(_farthest(vertices, others), _farthest(others, vertices))


def _farthest(points: Array, corners: Array) -> float:
    """The largest distance of a point (V, 3) from the hull of corners (W, 3): least squares with weights that are shares."""
    from scipy.optimize import nnls  # takes a quarter of a second to import

    size = float(np.abs(corners).max()) or 1.0
    rows = np.vstack([corners.T / size, np.full(len(corners), STIFF)])
    return size * max(float(nnls(rows, np.append(point / size, STIFF))[1]) for point in points)
