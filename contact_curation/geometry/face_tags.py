"""Tags for any convex body: on each of its faces the largest that fits, with the white rim it needs.

A square with middle c, half edge h and axes u, v lies in the polygon n_i . x <= b_i when n_i . c + h (|n_i . u| + |n_i . v|)
<= b_i for all i; so for each turn of its axes the largest one is the solution of a linear program in (c, h).
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.polytopes import SAME_PLANE, Polytope
from contact_curation.geometry.poses import Pose
from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.tags import BLACK_CELLS, CELLS, Tag, TagMap

TURNS = np.radians(np.arange(0.0, 90.0, 7.5))
SMALLEST = 0.01
"""Edge [m] below which a face gets no tag."""


class Face(NamedTuple):
    """A face of a polytope: the points with `normal . x = offset`, and on its inner side those of its neighbours.

    Attributes:
        normal: (3,) unit vector outwards.
        offset: [m].
    """

    normal: Array
    offset: float


def faces_of(polytope: Polytope) -> list[Face]:
    """The faces, in an order that depends on the shape alone."""
    from scipy.spatial import ConvexHull  # with the other two half a second to import, which every node would pay

    faces: list[Face] = []
    size = float(np.ptp(polytope.vertices, axis=0).max())
    for *normal, negative_offset in ConvexHull(polytope.vertices).equations:
        face = Face(np.array(normal), -float(negative_offset))
        if not any(_same(face, other, size) for other in faces):
            faces.append(face)
    return sorted(faces, key=lambda face: [*np.round(-face.normal[::-1], 6), round(face.offset, 9)])


def tags_on_faces(polytope: Polytope, frame: str, share: float = 0.95) -> TagMap:
    """A tag on each face that is large enough; ids are numbers from 0, face by face.

    Args:
        polytope: the body.
        frame: its frame.
        share: share of the largest edge that fits.

    Raises:
        InvalidValueError: no face is large enough.
    """
    faces = faces_of(polytope)
    squares = [(pose, _rounded_down(share * BLACK_CELLS / CELLS * edge)) for pose, edge in _squares(faces)]
    fitting = [(pose, edge) for pose, edge in squares if edge >= SMALLEST]
    if not fitting:
        largest = max(edge for _, edge in squares)
        raise InvalidValueError(f"faces of {frame}", f"room for a tag of {largest:.4g} m", f"{SMALLEST:.4g} m or more")
    return TagMap(frame, tuple(Tag(place, pose, edge) for place, (pose, edge) in enumerate(fitting)))


def _rounded_down(edge: float) -> float:
    """Rounds down to a tenth of a millimetre: a tag has to be printed and measured."""
    return float(np.floor(round(edge / 1e-4, 6)) * 1e4 / 1e8)


def _same(one: Face, other: Face, size: float) -> bool:
    return bool(np.abs(one.normal - other.normal).max() < SAME_PLANE and abs(one.offset - other.offset) < SAME_PLANE * size)


def _squares(faces: list[Face]) -> Iterator[tuple[Pose, float]]:
    """Pose (z outwards) and edge [m] of the largest square on each face."""
    from scipy.spatial.transform import Rotation

    for face in faces:
        axes = _axes(face.normal)  # (2, 3)
        others = [other for other in faces if other is not face]
        rows = np.array([axes @ other.normal for other in others])  # (E, 2) the polygon, in the face's plane
        bounds = np.array([other.offset - face.offset * other.normal @ face.normal for other in others])
        middle, half, turn = max((_largest(rows, bounds, turn) for turn in TURNS), key=lambda found: round(found[1], 9))
        right, up = _turned(turn) @ axes
        position = face.offset * face.normal + middle @ axes
        turned = Rotation.from_matrix(np.stack([right, up, face.normal], axis=1))
        yield Pose(position, turned.as_quat(scalar_first=True)), 2.0 * half


def _axes(normal: Array) -> Array:
    """(2, 3) right and up on a face: up as far up as it goes, on a level face along y."""
    up = np.array([0.0, 0.0, 1.0]) if abs(normal[2]) < 0.99 else np.array([0.0, 1.0, 0.0])
    right = np.cross(up, normal)
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(normal, right)])


def _turned(turn: float) -> Array:
    """(2, 2) right and up, turned, in right and up."""
    return np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])


def _largest(rows: Array, bounds: Array, turn: float) -> tuple[Array, float, float]:
    """Middle (2,), half edge and turn of the largest square in a polygon `rows x <= bounds`."""
    from scipy.optimize import linprog

    reach = np.abs(rows @ _turned(turn).T).sum(axis=1)
    found = linprog([0.0, 0.0, -1.0], np.column_stack([rows, reach]), bounds, bounds=[(None, None), (None, None), (0.0, None)])
    return np.asarray(found.x[:2]), float(found.x[2]), turn
