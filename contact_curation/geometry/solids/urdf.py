"""URDF: the collision geometry and the mass properties of one link, in the link's frame (http://wiki.ros.org/urdf/XML/link)."""

from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from contact_curation.errors import UnreadableInputError
from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.solids import shapes
from contact_curation.geometry.solids.link import Link, chosen_name, not_counted
from contact_curation.geometry.solids.mass_properties import MassProperties
from contact_curation.geometry.solids.mesh_file import Mesh, read_mesh
from contact_curation.geometry.solids.shapes import Solid, union
from contact_curation.geometry.solids.xml_file import number, numbers, positive, read_xml, referenced

ONES, ZEROS = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)


def read_urdf(path: Path, link: str | None = None) -> Link:
    """A rigid link.

    Args:
        path: path of the file.
        link: its name; None for the only one with collision geometry.

    Raises:
        UnreadableInputError: there is no such file or link, several, a mesh cannot be read, or a value is none.
    """
    robot = read_xml(path, "robot")
    found = {one.get("name", ""): one for one in robot.findall("link") if one.find("collision") is not None}
    name = chosen_name(path, list(found), link, "link with a <collision>: a <visual> is not used")
    element = found[name]
    meshes = [_geometry(path, collision) for collision in element.findall("collision")]
    return Link(
        name=robot.get("name", name) if len(found) == 1 else name,
        solid=union([mesh.solid for mesh in meshes]),
        mass=_inertial(path, element),
        friction=_friction(path, robot, element, name),
        notes=(*(note for mesh in meshes for note in mesh.notes), *not_counted(name, _fixed_to(robot, name))),
    )


def _fixed_to(robot: Element, name: str) -> list[str]:
    """The links with a mass that fixed joints hold to a link."""
    ends = (joint.findall("parent") + joint.findall("child") for joint in robot.findall("joint[@type='fixed']"))
    pairs = [{end.get("link", "") for end in pair} for pair in ends]
    held = {name}
    for _ in pairs:  # as long as a chain can be
        held = held.union(*(pair for pair in pairs if pair & held))
    return [other for link in robot.findall("link[inertial]") if (other := link.get("name", "")) in held - {name}]


def _geometry(path: Path, collision: Element) -> Mesh:
    geometry = collision.find("geometry")
    shape = None if geometry is None else next(iter(geometry), None)
    if shape is None or shape.tag not in SHAPES:
        what = "none" if shape is None else f"<{shape.tag}>"
        raise UnreadableInputError(path, f"geometry of <collision>: found {what}, expected one of {', '.join(SHAPES)}")
    found = SHAPES[shape.tag](path, shape)
    return found._replace(solid=found.solid.moved(*_origin(path, collision)))


def _box(path: Path, shape: Element) -> Mesh:
    return _exact(shapes.box(0.5 * positive(path, shape, "size", 3)))


def _cylinder(path: Path, shape: Element) -> Mesh:
    return _exact(shapes.cylinder(positive(path, shape, "radius", 1)[0], positive(path, shape, "length", 1)[0]))


def _capsule(path: Path, shape: Element) -> Mesh:
    return _exact(shapes.capsule(positive(path, shape, "radius", 1)[0], positive(path, shape, "length", 1)[0]))


def _sphere(path: Path, shape: Element) -> Mesh:
    return _exact(shapes.sphere(positive(path, shape, "radius", 1)[0]))


def _mesh(path: Path, shape: Element) -> Mesh:
    return read_mesh(referenced(path, shape.get("filename", "")), numbers(path, shape, "scale", 3, ONES))


def _exact(solid: Solid) -> Mesh:
    return Mesh(solid, ())


SHAPES = {"box": _box, "cylinder": _cylinder, "capsule": _capsule, "sphere": _sphere, "mesh": _mesh}


def _inertial(path: Path, link: Element) -> MassProperties | None:
    """Mass properties in the link's frame; the file gives the inertia in the axes of the inertial's own origin."""
    inertial = link.find("inertial")
    if inertial is None:
        return None
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    if mass is None or inertia is None:
        raise UnreadableInputError(path, f"inertial of link {link.get('name')}: expected a <mass> and an <inertia>")
    xx, xy, xz, yy, yz, zz = (number(path, inertia, f"i{axes}") for axes in ("xx", "xy", "xz", "yy", "yz", "zz"))
    moments = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    own = MassProperties(float(positive(path, mass, "value", 1)[0]), np.zeros(3), moments)
    return own.moved(*_origin(path, inertial))


def _friction(path: Path, robot: Element, link: Element, name: str) -> float | None:
    """Friction as Bullet or Gazebo define it; URDF itself has none."""
    said = link.find("contact/lateral_friction")
    if said is not None:
        return number(path, said, "value")
    for extension in robot.findall("gazebo"):
        text = extension.findtext("mu1")
        if extension.get("reference") == name and text is not None:
            try:
                return float(text)
            except ValueError as error:
                raise UnreadableInputError(path, f"mu1 of <gazebo>: found {text[:40]!r}, expected a number") from error
    return None


def _origin(path: Path, element: Element) -> tuple[Array, Array]:
    """Rotation (3, 3) and translation (3,) of an element in its link: Rz(yaw) Ry(pitch) Rx(roll)."""
    origin = element.find("origin")
    if origin is None:
        return np.eye(3), np.zeros(3)
    roll, pitch, yaw = numbers(path, origin, "rpy", 3, ZEROS)
    turns = turn_about(2, yaw) @ turn_about(1, pitch) @ turn_about(0, roll)
    return turns, numbers(path, origin, "xyz", 3, ZEROS)


def turn_about(axis: int, angle: float) -> Array:
    """(3, 3) the rotation about a coordinate axis by an angle [rad]."""
    first, second = (axis + 1) % 3, (axis + 2) % 3
    turn = np.eye(3)
    turn[[first, second], [first, second]] = np.cos(angle)
    turn[first, second], turn[second, first] = -np.sin(angle), np.sin(angle)
    return turn
