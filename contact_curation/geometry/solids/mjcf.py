"""MJCF: the colliding geoms and the mass properties of one body, in the body's frame (MuJoCo's XML reference).

Understood are classes of defaults, mesh assets, included files, frames, replicas, and all ways to give an orientation. What
would change the outcome and is not understood is refused.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from contact_curation.errors import UnreadableInputError
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.solids import shapes
from contact_curation.geometry.solids.link import Link, chosen_name, not_counted
from contact_curation.geometry.solids.mass_properties import MassProperties, combined
from contact_curation.geometry.solids.mesh_file import Mesh, mesh_of_hull, read_mesh
from contact_curation.geometry.solids.mjcf_tree import Pose, placed, with_included, with_replicas
from contact_curation.geometry.solids.shapes import Solid, union
from contact_curation.geometry.solids.urdf import turn_about
from contact_curation.geometry.solids.xml_file import number, numbers, positive, read_xml, referenced

DENSITY = 1000.0
"""[kg/m^3] of a geom without mass and density, by MuJoCo's defaults."""

MAIN = "main"
REMEDY = "describe the body as one rigid <body> of geoms"
REFUSED = ("composite", "flexcomp", "attach")

ALL_GROUPS = (0.0, 5.0)
"""First and last group of the geoms that have mass, by MuJoCo's defaults."""


@dataclass(frozen=True, eq=False)
class _Geom:
    mesh: Mesh
    weight: MassProperties
    collides: bool
    friction: float | None
    group: float
    hollow: bool


class _Model:
    """What the geoms of a file share: defaults by class, meshes by name, the unit of angles."""

    def __init__(self, path: Path, root: Element) -> None:
        self.path = path
        with_included(path, root)
        self.options: dict[str, str] = {}
        for compiler in root.findall("compiler"):
            self.options.update(compiler.attrib)
        for tag in REFUSED:
            if root.find(f".//{tag}") is not None:
                raise UnreadableInputError(path, f"found <{tag}>, which is not understood: {REMEDY}")
        for world in root.findall("worldbody"):
            with_replicas(path, world, self._rotation)
        self.compiler = Element("compiler", self.options)
        if float(self.options.get("settotalmass", "-1")) > 0.0:
            raise UnreadableInputError(path, f"found settotalmass, which is not understood: {REMEDY}")
        self.defaults: dict[str, dict[str, dict[str, str]]] = {MAIN: {}}
        for top in root.findall("default"):
            self._take_defaults(top, MAIN, {})
        self.meshes = {_mesh_name(mesh): mesh for mesh in root.findall("asset/mesh")}

    def _take_defaults(self, element: Element, name: str, above: dict[str, dict[str, str]]) -> None:
        own = {tag: dict(values) for tag, values in above.items()}
        for child in element:
            if child.tag != "default":
                own[child.tag] = {**own.get(child.tag, {}), **child.attrib}
        self.defaults[name] = own
        for child in element.findall("default"):
            self._take_defaults(child, child.get("class", MAIN), own)

    def with_defaults(self, element: Element, childclass: str) -> Element:
        """The element, completed by the defaults of its class.

        Raises:
            UnreadableInputError: there is no such class.
        """
        chosen = element.get("class", childclass)
        if chosen not in self.defaults:
            raise UnreadableInputError(self.path, f"class of <{element.tag}>: found {chosen}, expected one of <default>")
        return Element(element.tag, {**self.defaults[chosen].get(element.tag, {}), **element.attrib})

    def pose(self, element: Element) -> tuple[Array, Array]:
        """Rotation (3, 3) and translation (3,) of an element in its body."""
        return self._rotation(element), numbers(self.path, element, "pos", 3, (0.0, 0.0, 0.0))

    def _rotation(self, element: Element) -> Array:
        if "quat" in element.attrib:
            quaternion = numbers(self.path, element, "quat", 4)
            return quaternions.to_matrix(quaternion / np.linalg.norm(quaternion))
        if "axisangle" in element.attrib:
            *axis, angle = numbers(self.path, element, "axisangle", 4)
            return quaternions.to_matrix(quaternions.exp(self._radians(angle) * np.array(axis) / np.linalg.norm(axis)))
        if "xyaxes" in element.attrib:
            axes = numbers(self.path, element, "xyaxes", 6)
            x = axes[:3] / np.linalg.norm(axes[:3])
            y = axes[3:] - x * (x @ axes[3:])
            y = y / np.linalg.norm(y)
            return np.column_stack([x, y, np.cross(x, y)])
        if "zaxis" in element.attrib:
            return _turn_of_z(numbers(self.path, element, "zaxis", 3))
        if "euler" in element.attrib:
            return self._euler(numbers(self.path, element, "euler", 3))
        return np.eye(3)

    def _euler(self, angles: Array) -> Array:
        """Lower case letters turn about the moved axes, upper case ones about the fixed axes."""
        turn = np.eye(3)
        for letter, angle in zip(self.options.get("eulerseq", "xyz"), angles, strict=True):
            one = turn_about("xyz".index(letter.lower()), self._radians(angle))
            turn = turn @ one if letter.islower() else one @ turn
        return turn

    def _radians(self, angle: float) -> float:
        return angle if self.options.get("angle", "degree") == "radian" else float(np.radians(angle))

    def mesh(self, name: str) -> Mesh:
        """Reads a mesh of the assets.

        Raises:
            UnreadableInputError: there is no such mesh, or it has no file, or it is posed in a way that is not understood.
        """
        asset = self.meshes.get(name)
        if asset is None or not {"file", "vertex"} & set(asset.attrib) or "face" in asset.attrib:
            what = f"no mesh {name} among the assets" if asset is None else f"mesh {name} with faces or without a file"
            raise UnreadableInputError(self.path, f"found {what}, expected <mesh name={name!r} file=...> or vertex=...")
        told = self.with_defaults(asset, MAIN)
        if "refpos" in told.attrib or "refquat" in told.attrib:
            raise UnreadableInputError(self.path, f"mesh {name}: found refpos or refquat, which is not understood: {REMEDY}")
        scale = numbers(self.path, told, "scale", 3, (1.0, 1.0, 1.0))
        if "vertex" in told.attrib:
            count = max(4, len(told.get("vertex", "").split()) // 3)
            return mesh_of_hull(self.path, numbers(self.path, told, "vertex", 3 * count).reshape(-1, 3) * scale)
        folder = self.options.get("meshdir", self.options.get("assetdir", ""))
        read = read_mesh(referenced(self.path, told.get("file", ""), folder), scale)
        return mesh_of_hull(self.path, read.solid.points) if told.get("inertia") == "convex" else read

    def is_hollow(self, geom: Element, kind: str) -> bool:
        """Whether the mass of a geom is in its surface."""
        if kind != "mesh":
            return geom.get("shellinertia") == "true"
        return self.with_defaults(self.meshes[geom.get("mesh", "")], MAIN).get("inertia") == "shell"


def read_mjcf(path: Path, body: str | None = None) -> Link:
    """A rigid body.

    Args:
        path: path of the file.
        body: its name; None for the only one with colliding geoms.

    Raises:
        UnreadableInputError: there is no such file or body, several, a mesh cannot be read, or a value is none.
    """
    root = read_xml(path, "mujoco")
    try:
        model = _Model(path, root)
        found = {}
        for world in root.findall("worldbody"):
            bodies = enumerate(_bodies(model, world))
            found.update({element.get("name", f"body{k}"): (element, cls) for k, (element, cls) in bodies})
        told = {name: _told(model, element, cls) for name, (element, cls) in found.items()}
        colliding = [name for name, geoms in told.items() if any(_collides(geom) for geom, _ in geoms)]
        name = chosen_name(path, colliding, body, "body with a geom that collides")
        return _link(model, root, name, *found[name])
    except (ValueError, RecursionError) as error:  # an euler sequence of other letters, numbers in attributes of our own
        raise UnreadableInputError(path, f"holds a value that is not understood ({error}): {REMEDY}") from error


def _bodies(model: _Model, above: Element, childclass: str = MAIN) -> Iterator[tuple[Element, str]]:
    for body, inherited, _ in placed(above, "body", childclass, model.pose):
        own = body.get("childclass", inherited)
        yield body, own
        yield from _bodies(model, body, own)


def _told(model: _Model, body: Element, childclass: str) -> list[tuple[Element, Pose]]:
    """The geoms of a body with their defaults, and the poses of the frames around them."""
    found = placed(body, "geom", childclass, model.pose)
    return [(model.with_defaults(geom, inherited), pose) for geom, inherited, pose in found]


def _collides(geom: Element) -> bool:
    return not (geom.get("contype", "1") == "0" and geom.get("conaffinity", "1") == "0")


def _link(model: _Model, root: Element, name: str, body: Element, childclass: str) -> Link:
    geoms = [_geom(model, geom, frames) for geom, frames in _told(model, body, childclass)]
    colliding = [geom for geom in geoms if geom.collides]
    said = [geom.friction for geom in colliding if geom.friction is not None]
    inertial = body.find("inertial")
    by_file = inertial is not None and model.options.get("inertiafromgeom", "auto") != "true"
    mass = _inertial(model, inertial) if inertial is not None and by_file else _mass_of(model, geoms)
    _check_bounds(model, mass)
    return Link(
        name=name if body.get("name") else root.get("model", path_name(model.path)),
        solid=union([geom.mesh.solid for geom in colliding]),
        mass=mass,
        friction=max(said) if said else None,
        notes=(*(note for geom in colliding for note in geom.mesh.notes), *not_counted(name, _fixed_to(model, root, body))),
    )


def _fixed_to(model: _Model, root: Element, body: Element) -> list[str]:
    """The bodies with a mass that no joint lets move against a body: those in it, and that it is in."""
    groups = [group for world in root.findall("worldbody") for group in list(_rigid(model, world, []))]
    others = [one for one in next(group for group in groups if body in group) if one is not body]
    heavy = [one for one in others if any(placed(one, "geom", MAIN, model.pose)) or one.find("inertial") is not None]
    return [one.get("name", "without a name") for one in heavy]


def _rigid(model: _Model, above: Element, together: list[Element]) -> Iterator[list[Element]]:
    """Groups of bodies without a joint between them; each is whole when all are there.

    Args:
        model: that they are of.
        above: the body, or the world, whose bodies are looked at.
        together: the group of that body; empty for the world, whose bodies are each for itself.
    """
    for body, _, _ in placed(above, "body", MAIN, model.pose):
        moves = not together or any(any(placed(body, tag, MAIN, model.pose)) for tag in ("joint", "freejoint"))
        own = [] if moves else together
        own.append(body)
        if moves:
            yield own
        yield from _rigid(model, body, own)


def _mass_of(model: _Model, geoms: Sequence[_Geom]) -> MassProperties | None:
    """What the geoms weigh, of the groups that the compiler counts."""
    first, last = numbers(model.path, model.compiler, "inertiagrouprange", 2, ALL_GROUPS)
    heavy = [geom for geom in geoms if geom.weight.mass > 0.0 and first <= geom.group <= last]
    if any(geom.hollow for geom in heavy):
        raise UnreadableInputError(model.path, "found a geom with the mass of a shell, expected filled ones, or an <inertial>")
    return combined([geom.weight for geom in heavy]) if heavy else None


def _check_bounds(model: _Model, mass: MassProperties | None) -> None:
    """The compiler makes lighter bodies heavier."""
    bounds = {name: number(model.path, model.compiler, name, 0.0) for name in ("boundmass", "boundinertia")}
    found = (mass.mass, float(np.linalg.eigvalsh(mass.inertia)[0])) if mass else tuple(bounds.values())
    for (name, bound), value in zip(bounds.items(), found, strict=True):
        if value < bound:
            expected = f"at most {value:.3g}, the body's own: MuJoCo raises it"
            raise UnreadableInputError(model.path, f"{name} of <compiler>: found {bound:g}, expected {expected}")


def path_name(path: Path) -> str:
    """The name of a file without its ending."""
    return path.name.split(".")[0]


def _geom(model: _Model, geom: Element, frames: Pose) -> _Geom:
    kind = geom.get("type", "mesh" if "mesh" in geom.attrib else "sphere")
    if kind not in SHAPES or ("mesh" in geom.attrib and kind != "mesh"):
        raise UnreadableInputError(model.path, f"type of <geom>: found {kind}, expected one of {', '.join(SHAPES)}")
    mesh = SHAPES[kind](model, geom)
    if "fromto" in geom.attrib:
        ends = numbers(model.path, geom, "fromto", 6).reshape(2, 3)
        pose = _turn_of_z(ends[0] - ends[1]), ends.mean(axis=0)
    else:
        pose = model.pose(geom)
    solid = mesh.solid.moved(*pose).moved(*frames)
    volume = solid.uniform.mass
    density = number(model.path, geom, "density", DENSITY)
    mass = number(model.path, geom, "mass", density * volume)
    friction = float(geom.attrib["friction"].split()[0]) if geom.get("friction") else None
    group, hollow = number(model.path, geom, "group", 0.0), model.is_hollow(geom, kind)
    return _Geom(mesh._replace(solid=solid), solid.uniform.times(mass / volume), _collides(geom), friction, group, hollow)


def _sizes(model: _Model, geom: Element, count: int) -> Array:
    """(count,) positive sizes; MuJoCo allows more numbers than are used. `fromto` gives the half length, the last one."""
    if "fromto" in geom.attrib:
        ends = numbers(model.path, geom, "fromto", 6).reshape(2, 3)
        half = 0.5 * float(np.linalg.norm(ends[0] - ends[1]))
        own = _used(model, geom, 1)
        return np.array([*np.repeat(own, count - 1), half])
    return _used(model, geom, count)


def _used(model: _Model, geom: Element, count: int) -> Array:
    words = geom.get("size", "").split()[:count]
    return positive(model.path, Element("geom", {"size": " ".join(words)}), "size", count)


def _exact(solid: Solid) -> Mesh:
    return Mesh(solid, ())


def _capsule(model: _Model, geom: Element) -> Mesh:
    radius, half = _sizes(model, geom, 2)
    return _exact(shapes.capsule(radius, 2.0 * half))


def _cylinder(model: _Model, geom: Element) -> Mesh:
    radius, half = _sizes(model, geom, 2)
    return _exact(shapes.cylinder(radius, 2.0 * half))


SHAPES: dict[str, Callable[[_Model, Element], Mesh]] = {
    "box": lambda model, geom: _exact(shapes.box(_sizes(model, geom, 3))),
    "ellipsoid": lambda model, geom: _exact(shapes.ellipsoid(_sizes(model, geom, 3))),
    "sphere": lambda model, geom: _exact(shapes.sphere(float(_used(model, geom, 1)[0]))),
    "cylinder": _cylinder,
    "capsule": _capsule,
    "mesh": lambda model, geom: model.mesh(geom.get("mesh", "")),
}


def _inertial(model: _Model, inertial: Element) -> MassProperties:
    mass = float(positive(model.path, inertial, "mass", 1)[0])
    if "fullinertia" in inertial.attrib:
        xx, yy, zz, xy, xz, yz = numbers(model.path, inertial, "fullinertia", 6)
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    else:
        inertia = np.diag(positive(model.path, inertial, "diaginertia", 3))
    return MassProperties(mass, np.zeros(3), inertia).moved(*model.pose(inertial))


def _turn_of_z(axis: Array) -> Array:
    """(3, 3) the smallest rotation that takes z to an axis (3,)."""
    axis = axis / np.linalg.norm(axis)
    across = np.cross([0.0, 0.0, 1.0], axis)
    length = float(np.linalg.norm(across))
    if length == 0.0:
        return np.diag([1.0, np.sign(axis[2]), np.sign(axis[2])])
    return quaternions.to_matrix(quaternions.exp(across / length * np.arctan2(length, axis[2])))


def _mesh_name(mesh: Element) -> str:
    return mesh.get("name", path_name(Path(mesh.get("file", ""))))
