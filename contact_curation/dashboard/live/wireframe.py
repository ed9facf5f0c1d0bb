"""Edges and faces of a convex body, for drawing it.

They are those of the body as it was described: learned vertices are hardly ever four in a plane, and a hull of their own would
cut every face in two.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from contact_curation.geometry import quaternions
from contact_curation.geometry.polytopes import SAME_PLANE
from contact_curation.geometry.quaternions import Array

Strips = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Wireframe:
    """How V vertices are joined.

    Attributes:
        edges: (E, 2) numbers of vertices.
        triangles: (F, 3) numbers of vertices, counterclockwise from outside.
    """

    edges: NDArray[np.int64]
    triangles: NDArray[np.int64]

    def strips(self, vertices: Array) -> Strips:
        """(E, 2, 3) the edges as lines between vertices (V, 3)."""
        return np.asarray(vertices[self.edges], np.float32)

    def strips_at(self, vertices: Array, positions: Array, orientations_wxyz: Array) -> Strips:
        """(N E, 2, 3) the edges of a body in N places: positions (N, 3), orientations (N, 4)."""
        corners = positions[:, None] + quaternions.rotate(orientations_wxyz[:, None], vertices)  # (N, V, 3)
        return np.asarray(corners[:, self.edges].reshape(-1, 2, 3), np.float32)


def wireframe_of(vertices: Array) -> Wireframe:
    """The wireframe of a convex body's vertices (V, 3)."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(vertices)
    normals = hull.equations[:, :3]
    triangles = np.array([_outward(vertices, corners, n) for corners, n in zip(hull.simplices, normals)], dtype=np.int64)
    sides: dict[tuple[int, int], list[int]] = {}
    for face, corners in enumerate(hull.simplices):
        for side in combinations(sorted(corners.tolist()), 2):
            sides.setdefault(side, []).append(face)
    sharp = [side for side, (one, other) in sides.items() if np.abs(normals[one] - normals[other]).max() > SAME_PLANE]
    return Wireframe(np.array(sorted(sharp), dtype=np.int64), triangles)


def _outward(vertices: Array, corners: NDArray[np.int32], normal: Array) -> list[int]:
    """The corners in such an order that their normal is the given one."""
    a, b, c = (int(corner) for corner in corners)
    turn = np.cross(vertices[b] - vertices[a], vertices[c] - vertices[a]) @ normal
    return [a, b, c] if turn > 0.0 else [a, c, b]
