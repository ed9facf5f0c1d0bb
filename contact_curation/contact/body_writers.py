"""Writes the description of a body as MJCF, URDF or YAML, from which `body_description` reads the same body.

The frame of a file is the one that a tracker follows, its shape the convex hull of the vertices. What a format has no place for
is said in lines, which the file has as comments.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Comment, Element, SubElement

import numpy as np
import yaml
from numpy.typing import ArrayLike

from contact_curation.contact.body import Body
from contact_curation.contact.body_values import STANDARD_GRAVITY
from contact_curation.geometry.polytopes import corners_of
from contact_curation.geometry.solids.mesh_file import obj_of_hull

MESH = ".obj"
"""Ending of the mesh beside a URDF."""

YAML_WIDTH = 118


class WrittenBody(NamedTuple):
    """A body as files.

    Attributes:
        texts: the text of each file by its ending; the last one names the others.
        notes: what the format has no place for, one line each.
    """

    texts: dict[str, str]
    notes: tuple[str, ...]


def written_body(body: Body, ending: str, stem: str, restitution: float | None = None) -> WrittenBody:
    """The files that describe a body.

    Args:
        body: what to describe.
        ending: one of `FORMATS`.
        stem: name of the files without their ending.
        restitution: of its impacts, for which no format has a place; None where it is not known.
    """
    form, corners = FORMATS[ending], corners_of(body.vertices)
    notes = form.notes(body)
    if restitution is not None:
        notes.append(f"restitution {restitution:.4g} is not in the file: the format has none")
    if inside := len(body.vertices) - len(corners):
        notes.append(f"{inside} of {len(body.vertices)} vertices are left out: they are within the hull and touch nothing")
    return WrittenBody(form.texts(replace(body, vertices=corners), stem, notes), tuple(notes))


def _mjcf(body: Body, stem: str, notes: Sequence[str]) -> dict[str, str]:
    points, name = body.tracked_polytope.vertices, {"name": body.name}
    root = Element("mujoco", model=body.name)
    SubElement(SubElement(root, "asset"), "mesh", name, vertex=_text(points))
    over_ground = _text((0.0, 0.0, -points[:, 2].min()))
    moving = SubElement(SubElement(root, "worldbody"), "body", name, pos=over_ground)
    xx, xy, xz, _, yy, yz, _, _, zz = body.inertia.ravel()
    inertia = _text((xx, yy, zz, xy, xz, yz))
    SubElement(moving, "inertial", pos=_text(body.center_of_mass), mass=_text(body.mass), fullinertia=inertia)
    SubElement(moving, "freejoint", name)
    contact = {"friction": _text(body.friction), "condim": "3", "priority": "1"}  # its friction counts, not the ground's
    SubElement(moving, "geom", name, type="mesh", mesh=body.name, **contact)
    return {".xml": _xml(root, notes)}


def _urdf(body: Body, stem: str, notes: Sequence[str]) -> dict[str, str]:
    root = Element("robot", name=body.name)
    link = SubElement(root, "link", name=body.name)
    inertial = SubElement(link, "inertial")
    SubElement(inertial, "origin", xyz=_text(body.center_of_mass))
    SubElement(inertial, "mass", value=_text(body.mass))
    upper = [(row, column) for row in range(3) for column in range(row, 3)]
    moments = {f"i{'xyz'[row]}{'xyz'[column]}": _text(body.inertia[row, column]) for row, column in upper}
    SubElement(inertial, "inertia", moments)
    for use in ("visual", "collision"):
        SubElement(SubElement(SubElement(link, use), "geometry"), "mesh", filename=f"{stem}{MESH}")
    SubElement(SubElement(link, "contact"), "lateral_friction", value=_text(body.friction))
    gazebo = SubElement(root, "gazebo", reference=body.name)
    for direction in ("mu1", "mu2"):
        SubElement(gazebo, direction).text = _text(body.friction)
    return {MESH: obj_of_hull(body.tracked_polytope.vertices), ".urdf": _xml(root, notes)}


def _yaml(body: Body, stem: str, notes: Sequence[str]) -> dict[str, str]:
    listed = yaml.safe_dump(body.to_mapping(), sort_keys=False, default_flow_style=None, width=YAML_WIDTH)
    return {".yaml": "".join(f"# {line}\n" for line in notes) + listed}


def _of_the_project(body: Body) -> list[str]:
    """What only the project's own format has."""
    scale = f"length scale {body.length_scale!r} m is not in the file: the format has none"
    gravity = f"gravity {body.gravity!r} m/s^2 is not in the file: it is the world's"
    return [scale] if body.gravity == STANDARD_GRAVITY else [scale, gravity]


def _beyond_urdf(body: Body) -> list[str]:
    where = "the extensions of Gazebo and of Bullet, which multiplies it by the ground's"
    return [f"friction {body.friction:.4g} is in {where}: URDF itself has none", *_of_the_project(body)]


class Format(NamedTuple):
    """How a body is written: its texts by endings, and what else the format has no place for."""

    texts: Callable[[Body, str, Sequence[str]], dict[str, str]]
    notes: Callable[[Body], list[str]]


FORMATS = {
    ".xml": Format(_mjcf, _of_the_project),
    ".urdf": Format(_urdf, _beyond_urdf),
    ".yaml": Format(_yaml, lambda body: []),
}
"""By the ending of the file."""


def _text(values: ArrayLike) -> str:
    """Numbers with all their digits."""
    return " ".join(repr(value) for value in np.ravel(values).astype(float).tolist())


def _xml(root: Element, notes: Sequence[str]) -> str:
    for place, line in enumerate(notes):
        root.insert(place, Comment(f" {line} "))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"
