"""Meshes as rigid bodies: STL (binary and text), OBJ, PLY and OFF.

Only the file itself is read, neither materials nor textures. A closed mesh has the mass properties of what it encloses, and
may be hollow, concave or of several pieces; of an open one they are those of its convex hull.
"""

import logging
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from contact_curation.errors import UnreadableInputError
from contact_curation.files import read_bounded
from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.solids.mass_properties import MassProperties, of_hull
from contact_curation.geometry.solids.shapes import Solid

MESHES = (".stl", ".obj", ".ply", ".off")
"""Endings of the files that are read."""

CONVERT = "convert it to STL or OBJ, for example with MeshLab or Blender"
FOREIGN = {
    ".dae": "COLLADA",
    **dict.fromkeys((".gltf", ".glb"), "glTF"),
    **dict.fromkeys((".step", ".stp"), "STEP"),
    ".3mf": "3MF",
    ".fbx": "FBX",
    ".blend": "a Blender file",
}
"""Formats of shapes that are not read, by their endings."""

NO_LOG = logging.NullHandler()
"""Without a log, Python prints what trimesh says of normals that it cannot read; they are not used."""

LARGEST_MESH = 1 << 26
"""Bytes of a mesh."""

STL_HEAD, STL_TRIANGLE = 84, 50
"""Bytes in a binary STL file: before the first triangle, and of each triangle."""

FARTHEST = 1e6
"""[m] of a coordinate; a body whose unit is off is found by its mass later."""

DIGITS = 17
"""Of a coordinate [m] that is written, behind the point."""

FLAT = 1e-6
"""Share of its size: a mesh that is thinner has no volume."""

CONCAVE = 1e-4
"""Share of the hull's volume that a mesh may lack and still be convex, but for rounding."""


POLYGONS = "found a face of more than four corners, expected triangles, or the same mesh as OBJ or PLY"
"""Which trimesh reads in all formats but OFF."""


class Mesh(NamedTuple):
    """What a mesh file holds.

    Attributes:
        solid: at a density of 1 kg/m^3.
        notes: what was assumed of it, one line each.
    """

    solid: Solid
    notes: tuple[str, ...]


def read_mesh(path: Path, scale: Array) -> Mesh:
    """The body that a mesh encloses.

    Args:
        path: path of the file.
        scale: (3,) what its coordinates are multiplied with, to become metres.

    Raises:
        UnreadableInputError: there is no such file, it is no mesh, or it encloses nothing.
    """
    refuse_foreign(path)
    data = read_bounded(path, LARGEST_MESH, "a mesh", devices=False)
    loaded = _loaded(path, data)
    points = np.asarray(loaded.vertices, dtype=float)
    if points.size and points.shape[1:] != (3,):
        raise UnreadableInputError(path, f"found vertices of shape {points.shape}, expected three coordinates each")
    points = points.reshape(-1, 3) * scale
    if not len(points) or not len(loaded.faces):
        raise UnreadableInputError(path, "found no triangles, expected a mesh")
    wrong = loaded.faces[(loaded.faces < 0) | (loaded.faces >= len(points))]
    if wrong.size:
        raise UnreadableInputError(path, f"found a triangle at vertex {wrong[0]}, expected 0 to {len(points) - 1}: damaged?")
    _check_points(path, points)
    loaded.vertices = points
    loaded.merge_vertices()
    if scale.prod() < 0.0:
        loaded.invert()
    return _enclosed(path, loaded)


def mesh_of_hull(path: Path, points: Array) -> Mesh:
    """The body that the convex hull of points (N, 3) encloses.

    Args:
        path: of the file that lists them, for the message.
        points: in metres.

    Raises:
        UnreadableInputError: their hull encloses nothing.
    """
    from scipy.spatial import QhullError  # takes a quarter of a second to import

    _check_points(path, points)
    try:
        return Mesh(Solid(points, of_hull(points)), ())
    except QhullError as error:  # thinner than its rounding allows
        raise UnreadableInputError(path, "found almost all points in one plane, expected a mesh with volume") from error


def obj_of_hull(points: Array) -> str:
    """The convex hull of points (N, 3) as the text of an OBJ file, with all digits."""
    from trimesh.convex import convex_hull  # takes half a second to import
    from trimesh.exchange.obj import export_obj

    options = {"include_normals": False, "include_texture": False, "digits": DIGITS, "header": None}
    text: str = export_obj(convex_hull(points), **options)  # type: ignore[no-untyped-call]
    return text + "\n"


def _check_points(path: Path, points: Array) -> None:
    if not np.isfinite(points).all() or float(np.abs(points).max()) > FARTHEST:
        raise UnreadableInputError(path, "found coordinates that are no lengths, expected metres, or a scale to make them so")
    if np.linalg.matrix_rank(points - points.mean(axis=0), tol=FLAT * float(np.ptp(points))) < 3:
        raise UnreadableInputError(path, "found all points in one plane, expected a mesh with volume")


def refuse_foreign(path: Path) -> None:
    """Says what to do with a shape in a format that is not read.

    Raises:
        UnreadableInputError: its ending says that it is one.
    """
    form = FOREIGN.get(path.suffix.lower())
    if form is not None:
        raise UnreadableInputError(path, f"is {form}, expected one of {', '.join(MESHES)}: {CONVERT}")


def _enclosed(path: Path, mesh: Any) -> Mesh:
    """The mass properties of the mesh, or of its hull where it is open."""
    from scipy.spatial import QhullError  # takes a quarter of a second to import

    try:
        hull = mesh.convex_hull
    except QhullError as error:  # thinner than its rounding allows
        raise UnreadableInputError(path, "found almost all points in one plane, expected a mesh with volume") from error
    notes: list[str] = []
    corners = np.asarray(hull.vertices, dtype=float)
    closed = _is_closed(mesh)
    if closed and mesh.volume < 0.0:
        mesh.invert()
    if not closed or not mesh.volume > 0.0:
        notes.append(f"{path.name} is not closed, or its triangles face in and out: its mass is spread over its convex hull")
        return mesh_of_hull(path, corners)._replace(notes=tuple(notes))
    if mesh.volume < (1.0 - CONCAVE) * hull.volume:
        inside = len(mesh.vertices) - len(corners)
        notes.append(
            f"{path.name} is not convex: a flat board touches its convex hull alone, so that {inside} vertices inside the "
            f"hull are no contacts; the hull has {hull.volume / mesh.volume:.2f} times its volume"
        )
    if _may_overlap(mesh):
        notes.append(f"{path.name} has several closed pieces: where they overlap, the mass counts twice")
    found = mesh.mass_properties
    inertia = np.asarray(found.inertia, dtype=float)
    uniform = MassProperties(float(found.volume), np.asarray(found.center_mass, dtype=float), 0.5 * (inertia + inertia.T))
    return Mesh(Solid(corners, uniform), tuple(notes))


def _is_closed(mesh: Any) -> bool:
    """Whether triangles pass every edge as often in one direction as in the other: pieces that touch may share edges."""
    senses = np.sign(mesh.edges[:, 1] - mesh.edges[:, 0]).astype(float)  # 0 of an edge without length
    return not np.bincount(mesh.edges_unique_inverse, weights=senses).any()


def _may_overlap(mesh: Any) -> bool:
    """Whether bounding boxes of closed pieces overlap; a cavity is no piece, for its volume is negative."""
    boxes = np.array([piece.bounds for piece in mesh.split() if piece.volume > 0.0])  # (pieces, 2, 3)
    common = (np.minimum(boxes[k, 1], boxes[:k, 1]) - np.maximum(boxes[k, 0], boxes[:k, 0]) for k in range(1, len(boxes)))
    return any(bool((lengths > FLAT * mesh.scale).all(axis=1).any()) for lengths in common)


def _loaded(path: Path, data: bytes) -> Any:
    """The mesh as trimesh reads it; it opens no other file."""
    from trimesh import load_mesh  # takes half a second to import

    kind = path.suffix.lower()
    if kind not in MESHES:
        raise UnreadableInputError(path, f"found a {kind or 'file without ending'}, expected a mesh: {', '.join(MESHES)}")
    if kind == ".stl":
        kind = _kind_of_stl(path, data)
    logging.getLogger("trimesh").addHandler(NO_LOG)
    try:
        return load_mesh(BytesIO(data), file_type=kind.removeprefix("."), skip_materials=True, process=False)
    except Exception as error:  # its readers end in errors of any kind
        polygons = kind == ".off" and isinstance(error, TypeError)
        why = POLYGONS if polygons else f"is no mesh ({type(error).__name__}: {str(error)[:80]})"
        raise UnreadableInputError(path, why) from error


def _kind_of_stl(path: Path, data: bytes) -> str:
    """Which of the two forms of STL it has; what is cut off is refused, of which trimesh would give an empty mesh."""
    if data.lstrip()[:5].lower() == b"solid" and b"facet" in data[:1024]:
        if b"endsolid" not in data[-1024:]:
            raise UnreadableInputError(path, "found no endsolid at its end, expected a whole STL file: it was cut off")
        return ".stl_ascii"
    count = int.from_bytes(data[STL_HEAD - 4 : STL_HEAD], "little")
    expected = STL_HEAD + STL_TRIANGLE * count
    if len(data) < STL_HEAD or len(data) < expected:
        raise UnreadableInputError(path, f"found {len(data)} bytes, expected {expected} of an STL file: it was cut off")
    return ".stl"
