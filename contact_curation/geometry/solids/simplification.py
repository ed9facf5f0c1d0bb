"""The corners of a convex hull, and a hull of fewer corners that stays near it.

The corners are added one after the other, each time the one that is farthest outside of those taken so far. The result lies
inside the hull, so that its Hausdorff distance from it is that of the farthest corner left out.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array

ROUNDING = 1e-6
"""Share of the body's size: a corner that stands out by less is none."""

AT_ONCE = 2048
"""Corners whose distances are computed together, to bound memory."""


class Corners(NamedTuple):
    """Corners of a convex body.

    Attributes:
        vertices: (V, 3) in the order of their coordinates [m].
        hull_count: how many corners the hull has.
        error: Hausdorff distance from the hull [m]; zero where all corners were taken.
    """

    vertices: Array
    hull_count: int
    error: float


def hull_corners(points: Array, most: int) -> Corners:
    """The corners of the hull of points (N, 3), or `most` of them that stay near it.

    Raises:
        InvalidValueError: the points are not finite, or lie in a plane.
    """
    from scipy.spatial import ConvexHull, QhullError  # takes a quarter of a second to import

    if not np.isfinite(points).all():
        raise InvalidValueError("vertices", "a value that is not finite", "finite numbers")
    points = np.unique(points + 0.0, axis=0)  # sorted; without negative zeros, which would count as different ones
    size = float(np.ptp(points, axis=0).max(initial=0.0))
    middle = points.mean(axis=0) if len(points) else np.zeros(3)
    if len(points) < 4 or np.linalg.matrix_rank(points - middle, tol=ROUNDING * size) < 3:
        raise InvalidValueError("vertices", "all in one plane", "a body with volume")
    try:
        whole = ConvexHull(points)
    except QhullError as error:
        raise InvalidValueError("vertices", "a hull that cannot be built", "a body with volume") from error
    corners = points[np.sort(whole.vertices)]
    if len(corners) <= 4 * most:
        corners = _without_flat_ones(corners, ROUNDING * size)
    if len(corners) <= most:
        return Corners(corners, len(corners), 0.0)
    taken = _farthest_first(corners, most, ROUNDING * size)
    return Corners(corners[taken], len(corners), _largest_distance(corners[~taken], corners[taken]))


def _without_flat_ones(corners: Array, tolerance: float) -> Array:
    """Corners without those that lie in the hull of the others, or outside of it by rounding only."""
    from scipy.spatial import ConvexHull

    taken = np.ones(len(corners), dtype=bool)
    for place, corner in enumerate(corners):
        taken[place] = False
        others = corners[taken]
        flat = len(others) < 4 or np.linalg.matrix_rank(others - others.mean(axis=0), tol=tolerance) < 3
        if flat or _outside(corner[None], ConvexHull(others))[0] > tolerance:
            taken[place] = True
    return corners[taken]


def _farthest_first(corners: Array, most: int, tolerance: float) -> NDArray[np.bool_]:
    """(N,) which `most` corners stand for all."""
    from scipy.spatial import ConvexHull

    taken = np.zeros(len(corners), dtype=bool)
    taken[_first_tetrahedron(corners)] = True
    from_middle = np.linalg.norm(corners - corners.mean(axis=0), axis=1)
    while taken.sum() < most:
        outside = _outside(corners, ConvexHull(corners[taken]))
        if outside.max() <= tolerance:
            break
        farthest = np.flatnonzero(outside >= outside.max() - tolerance)
        taken[farthest[from_middle[farthest].argmax()]] = True
    return taken


def _first_tetrahedron(corners: Array) -> list[int]:
    """Four places of corners with volume between them."""
    axis = int(np.ptp(corners, axis=0).argmax())
    low, high = int(corners[:, axis].argmin()), int(corners[:, axis].argmax())
    arms = corners - corners[low]
    third = int(np.linalg.norm(np.cross(arms, arms[high]), axis=1).argmax())
    fourth = int(np.abs(arms @ np.cross(arms[high], arms[third])).argmax())
    return [low, high, third, fourth]


def _outside(points: Array, hull: "object") -> Array:
    """(N,) by how much points are beyond the planes of a hull's facets; negative inside."""
    planes = np.asarray(hull.equations)  # type: ignore[attr-defined]
    return np.asarray((points @ planes[:, :3].T + planes[:, 3]).max(axis=1))


def _largest_distance(points: Array, corners: Array) -> float:
    """Largest distance from points (N, 3) outside of a hull to it; the nearest place is on a facet that the point is beyond."""
    from scipy.spatial import ConvexHull
    from trimesh import triangles as triangle_geometry

    closest_point: Callable[[Array, Array], Array] = triangle_geometry.closest_point
    hull = ConvexHull(corners)
    triangles, planes = corners[hull.simplices], hull.equations  # (F, 3, 3), (F, 4)
    largest = 0.0
    for first in range(0, len(points), AT_ONCE):
        some = points[first : first + AT_ONCE]
        place, facet = np.nonzero(some @ planes[:, :3].T + planes[:, 3] > 0.0)
        away = np.linalg.norm(closest_point(triangles[facet], some[place]) - some[place], axis=1)
        nearest = np.full(len(some), np.inf)
        np.minimum.at(nearest, place, away)
        largest = max(largest, float(nearest[np.isfinite(nearest)].max(initial=0.0)))
    return largest
