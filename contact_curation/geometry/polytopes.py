"""Convex polytopes given by their vertices."""

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.numbers import numbers
from contact_curation.geometry.quaternions import Array

SMALLEST_CORNER = 1e-6
"""Share of the volume that a corner adds."""

ON_THE_FACE = 1e-6
"""Share of a body's extent that a vertex of a face may be off its plane."""

THINNEST = 1e-6
"""Share of a body's extent that counts as a thickness; hulls of thinner ones are not found."""

SAME_PLANE = 1e-6
"""Planes of a hull whose unit normals, and where they are compared offsets, differ by less are one face."""


@dataclass(frozen=True, eq=False)
class Polytope:
    """A convex body.

    Attributes:
        vertices: (V, 3) in the body frame, V >= 4, not in one plane.
    """

    vertices: Array

    def __post_init__(self) -> None:
        vertices = numbers("vertices", self.vertices)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or vertices.shape[0] < 4:
            raise InvalidValueError("vertices", f"shape {vertices.shape}", "(V, 3) with V >= 4")
        if not np.isfinite(vertices).all():
            raise InvalidValueError("vertices", "a value that is not finite", "finite numbers")
        scaled = vertices / (np.abs(vertices).max() or 1.0)  # sums of large numbers are no numbers
        if np.linalg.matrix_rank(scaled - scaled.mean(axis=0), rtol=THINNEST) < 3:
            raise InvalidValueError("vertices", "all in one plane", "a body with volume")
        object.__setattr__(self, "vertices", vertices)

    def corner_heights(self, positions: ArrayLike, orientations_wxyz: ArrayLike) -> Array:
        """Heights (..., V) of the vertices over the plane z = 0, at positions (..., 3) and orientations (..., 4)."""
        upwards = quaternions.third_rows(orientations_wxyz)
        return np.asarray(upwards @ self.vertices.T + np.asarray(positions, dtype=float)[..., 2:3])

    @cached_property
    def _faces(self) -> tuple[Array, Array]:
        """Outward unit normals (F, 3) and offsets (F,) of the hull's faces, one for each of their triangles."""
        triples = np.array(list(combinations(range(len(self.vertices)), 3)))
        first, second, third = (self.vertices[triples[:, place]] for place in range(3))
        normals = np.cross(second - first, third - first)
        areas = np.linalg.norm(normals, axis=1)
        wide = areas > ON_THE_FACE * np.ptp(self.vertices) ** 2
        normals, first = normals[wide] / areas[wide, np.newaxis], first[wide]
        normals = np.concatenate([normals, -normals])
        offsets = (normals * np.concatenate([first, first])).sum(axis=1)
        outer = (normals @ self.vertices.T).max(axis=1) <= offsets + ON_THE_FACE * np.ptp(self.vertices)
        return normals[outer], offsets[outer]

    def face_towards(self, direction: ArrayLike) -> NDArray[np.int64]:
        """Indices of the vertices on the hull's face whose normal is nearest to a direction (3,) in the body frame."""
        nearest = int(np.argmax(self._faces[0] @ np.asarray(direction, dtype=float)))
        return self._vertices_of_faces[nearest]

    @cached_property
    def _vertices_of_faces(self) -> tuple[NDArray[np.int64], ...]:
        """Indices of the vertices on each of the `_faces`."""
        off = ON_THE_FACE * np.ptp(self.vertices)
        faces = zip(*self._faces, strict=True)
        return tuple(np.flatnonzero(offset - self.vertices @ normal <= off) for normal, offset in faces)

    @cached_property
    def balanced_rise(self) -> float:
        """How high, at least, both faces beside an edge rise from it while the body is balanced on it [m].

        Of each edge that can be the lowest under the origin, the centre of mass: the face that rises more counts.
        """
        rises, faces = [np.inf], {frozenset(face.tolist()) for face in self._vertices_of_faces}
        for one, other in combinations(faces, 2):
            edge = one & other
            if len(edge) == 2:
                start, end = self.vertices[list(edge)]
                along = (end - start) / np.linalg.norm(end - start)
                up = (start @ along) * along - start
                length, heights = np.linalg.norm(up), (self.vertices - start) @ up
                if heights.min() > -ON_THE_FACE * np.ptp(self.vertices) * length:
                    rises.append(max(heights[list(face - edge)].min() for face in (one, other)) / length)
        return float(min(rises))


def checked_corners(vertices: Array) -> Array:
    """Vertices (V, 3), if each of them is a corner of their hull: what lies on an edge, or twice in a place, is no footing.

    Raises:
        InvalidValueError: one of them lies in the hull of the others; or as `Polytope`.
    """
    vertices = Polytope(vertices).vertices
    if (place := _place_within(vertices)) is not None:
        found = f"vertex {place} at {vertices[place].tolist()} within the hull of the others"
        raise InvalidValueError("vertices", found, "corners of a convex body, each once")
    return vertices


def corners_of(vertices: Array) -> Array:
    """Those of the vertices (V, 3), in their order, that are corners of their hull, as `checked_corners` wants them."""
    while (place := _place_within(vertices)) is not None:
        vertices = np.delete(vertices, place, axis=0)
    return vertices


def _place_within(vertices: Array) -> int | None:
    """The first of the vertices that lies in the hull of the others; None where all are corners."""
    from scipy.spatial import ConvexHull  # takes a quarter of a second to import

    whole = ConvexHull(vertices).volume
    for place in range(len(vertices)):
        others = np.delete(vertices, place, axis=0)
        flat = len(others) < 4 or np.linalg.matrix_rank(others - others.mean(axis=0), tol=1e-9 * np.ptp(vertices)) < 3
        if not flat and ConvexHull(others).volume > (1.0 - SMALLEST_CORNER) * whole:
            return place
    return None


def box(half_extents: ArrayLike) -> Polytope:
    """The box of half extents (3,), centred on the body frame's origin."""
    corners = np.array(list(product((-1.0, 1.0), repeat=3)))
    return Polytope(corners * np.asarray(half_extents, dtype=float))
