"""Reads the description of a body and completes it by options: YAML, URDF, MJCF, or a mesh (STL, OBJ, PLY, OFF).

A body's origin is its centre of mass and its axes are those of its file. Where the file has another origin, such as the frame
of a link, `center_of_mass` says where the centre of mass is in the file's frame, which is the frame that a tracker follows.

A flat board touches a body with the corners of its convex hull alone, so that a concave body, or one of several pieces, is
represented exactly by them. The solver takes `MAX_CONTACTS` corners; of more, those are taken that stay near the hull.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from contact_curation.configs import check_positive
from contact_curation.contact.body_values import (
    GEOMETRIES,
    OPTIONAL,
    REQUIRED,
    SHAPES,
    STANDARD_GRAVITY,
    body_of_mapping,
    check_keys,
    check_values,
    is_measurable,
    symmetric_inertia,
    text,
    vertices_of_mapping,
)
from contact_curation.contact.plausibility import BodyNumbers, derived_scale, implausible
from contact_curation.errors import ContactCurationError, InvalidValueError, UnreadableInputError
from contact_curation.files import read_bounded, read_yaml
from contact_curation.geometry.numbers import number, numbers
from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.solids.link import Link
from contact_curation.geometry.solids.mass_properties import MassProperties, of_hull
from contact_curation.geometry.solids.mesh_file import MESHES, read_mesh, refuse_foreign
from contact_curation.geometry.solids.mjcf import read_mjcf
from contact_curation.geometry.solids.simplification import Corners, hull_corners
from contact_curation.geometry.solids.urdf import read_urdf
from contact_curation.geometry.solids.xml_file import LARGEST_XML
from contact_curation.solver.cone_problem import MAX_CONTACTS

LARGEST_FILE = 2**17
"""Bytes of a description in YAML, which takes some 20 microseconds each."""

ASSUMED_FRICTION = 0.5
"""Of a body whose file names none; it is learned from tosses."""

OFF_CENTRE = 0.02
"""Length scales that the middle of a listed shape may be from its centre of mass for an even filling."""


@dataclass(frozen=True, eq=False)
class BodyOptions:
    """Options for a body beside its geometry; None takes the value of the file.

    Attributes:
        name: of the body.
        mass: [kg]; the inertia of the file is scaled with it.
        density: in place of a mass, of the body filled evenly [kg/m^3].
        friction: Coulomb coefficient.
        length_scale: the unit of length of the loss [m].
        scale: what a mesh's coordinates are multiplied with to become metres: 0.001 for mm.
        link: of a URDF, or the body of an MJCF.
        inertia: (3, 3) about the centre of mass [kg m^2].
        center_of_mass: (3,) in the frame of the file [m].
        gravity: [m/s^2].
    """

    name: str | None = None
    mass: float | None = None
    density: float | None = None
    friction: float | None = None
    length_scale: float | None = None
    scale: float | None = None
    link: str | None = None
    inertia: Array | None = None
    center_of_mass: Array | None = None
    gravity: float | None = None

    def __post_init__(self) -> None:
        given = [name for name in ("mass", "density", "length_scale", "scale") if getattr(self, name) is not None]
        check_positive(self, given)
        if self.mass is not None and self.density is not None:
            raise InvalidValueError("density", f"{self.density:g} beside a mass of {self.mass:g} kg", "one of both")

    def over(self, below: "BodyOptions") -> "BodyOptions":
        """These, completed by others; a mass takes the place of a density and the reverse."""
        weight = {"mass", "density"} if self.mass is not None or self.density is not None else set()
        kept = {name: value for name, value in vars(below).items() if name not in weight}
        return BodyOptions(**{**kept, **{name: value for name, value in vars(self).items() if value is not None}})


AS_IN_THE_FILE = BodyOptions()


class BodyDescription(NamedTuple):
    """The description of a body, in SI units.

    Attributes:
        name, vertices, mass, inertia, friction, length_scale, gravity, center_of_mass: as of `contact.body.Body`.
        hull_count: corners that the convex hull has.
        error: the hull of the vertices is inside the described shape by at most this [m].
        source: the file.
        notes: how the file was understood, one line each.
        warnings: what is odd or was assumed, one line each.
    """

    name: str
    vertices: Array
    mass: float
    inertia: Array
    friction: float
    length_scale: float
    gravity: float
    center_of_mass: Array
    hull_count: int
    error: float
    source: str
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()


def read_description(path: Path, options: BodyOptions = AS_IN_THE_FILE) -> BodyDescription:
    """Reads the description of a body from a file.

    Args:
        path: of a YAML, URDF, MJCF, STL, OBJ, PLY or OFF file.
        options: what its user adds.

    Raises:
        UnreadableInputError: there is no such file, it describes no body, or one that cannot be; the line names the value.
    """
    try:
        found = _found(path, options)
    except UnreadableInputError:
        raise
    except ContactCurationError as error:
        raise UnreadableInputError(path, str(error)) from error
    return checked(found)


def checked(found: BodyDescription) -> BodyDescription:
    """The description with a warning for each unusual value; UnreadableInputError for a value that no body has."""
    try:
        check_values(found._asdict())
        return found._replace(warnings=(*found.warnings, *implausible(_numbers_of(found))))
    except ContactCurationError as error:
        raise UnreadableInputError(found.source, str(error)) from error


def _found(path: Path, options: BodyOptions) -> BodyDescription:
    """As `read_description`, before its numbers are compared with each other."""
    kind = path.suffix.lower()
    if kind in READERS:
        return _completed(path, READERS[kind](path, options), options)
    refuse_foreign(path)
    content = read_yaml(path, LARGEST_FILE, "the description of a body: YAML, URDF, MJCF, STL, OBJ, PLY or OFF")
    if not isinstance(content, Mapping) or not all(isinstance(key, str) for key in content):
        found = type(content).__name__
        raise UnreadableInputError(path, f"found a {found}, expected the keys of a body and their values")
    if any(key in content for key in GEOMETRIES):
        return _referred(path, content, options)
    return _listed(path, content, options)


def _numbers_of(found: BodyDescription) -> BodyNumbers:
    hull = of_hull(found.vertices)
    arms = hull.center @ hull.center * np.eye(3) - np.outer(hull.center, hull.center)
    filled = found.mass * (hull.inertia / hull.mass + arms)
    named = {name: getattr(found, name) for name in ("vertices", "mass", "inertia", "friction", "length_scale", "gravity")}
    return BodyNumbers(**named, volume=hull.mass, hull_inertia=filled)


# Geometry in a file of its own


def _mesh(path: Path, options: BodyOptions) -> Link:
    mesh = read_mesh(path, np.full(3, options.scale or 1.0))
    return Link(path.name.split(".")[0], mesh.solid, notes=mesh.notes)


def _robot(path: Path, options: BodyOptions) -> Link:
    if options.scale is not None:
        raise InvalidValueError("scale", options.scale, "none for URDF and MJCF, whose meshes have a scale of their own")
    is_mjcf = b"<mujoco" in read_bounded(path, LARGEST_XML, "a robot description")[: 1 << 16]
    return (read_mjcf if is_mjcf else read_urdf)(path, options.link)


type Reader = Callable[[Path, BodyOptions], Link]

READERS: dict[str, Reader] = {**dict.fromkeys(MESHES, _mesh), **dict.fromkeys((".urdf", ".mjcf", ".xml", ".xacro"), _robot)}
"""By the ending of the file; anything else is YAML."""


def _referred(path: Path, content: Mapping[str, Any], options: BodyOptions) -> BodyDescription:
    """Of a YAML file with one of the keys `GEOMETRIES`."""
    check_keys(content, (*GEOMETRIES, *vars(options)))
    named = [key for key in GEOMETRIES if key in content]
    if len(named) > 1:
        raise InvalidValueError(named[1], f"a file beside that of {named[0]}", "one of both")
    file = path.parent / text(content, named[0])
    refuse_foreign(file)
    if file.suffix.lower() not in READERS:
        raise InvalidValueError(named[0], content[named[0]], f"a file ending in {', '.join(READERS)}")
    scalars = ("mass", "density", "friction", "length_scale", "scale", "gravity")
    told: dict[str, Any] = {name: number(name, content[name]) for name in scalars if name in content}
    told.update({name: text(content, name) for name in ("name", "link") if name in content})
    told.update({name: numbers(name, content[name]) for name in ("inertia", "center_of_mass") if name in content})
    stated = BodyOptions(**told)
    options = options.over(stated)
    link = READERS[file.suffix.lower()](file, options)
    if stated.inertia is None:
        return _completed(path, link, options)
    has_mass = stated.mass is not None or stated.density is not None or link.mass is not None
    times = _properties(link, options)[0].mass / _properties(link, stated)[0].mass if has_mass else 1.0
    found = _completed(path, link, replace(options, inertia=stated.inertia * times))
    by = "" if times == 1.0 else f", times {times:.3g}"
    return found._replace(notes=(f"inertia: as stated in {path.name}{by}", *found.notes))


def _completed(path: Path, link: Link, options: BodyOptions) -> BodyDescription:
    """A link with what its user adds, about its centre of mass."""
    properties, origin = _properties(link, options)
    center = properties.center if options.center_of_mass is None else options.center_of_mass
    corners = hull_corners(link.solid.points - center, MAX_CONTACTS)
    scale = derived_scale(of_hull(corners.vertices).mass)
    error = link.solid.error + corners.error
    friction = options.friction if options.friction is not None else link.friction
    notes = [*link.notes, *([origin] if options.inertia is None else [])]
    if float(np.abs(center).max()) > 0.0:
        notes.append(f"centre of mass: at {_millimetres(center)} mm in the file's frame; poses are taken to be of that frame")
    if options.length_scale is None:
        notes.append(f"length scale: {scale:.4g} m, half the edge of a cube of the same volume")
    return BodyDescription(
        name=options.name or plain_name(link.name),
        vertices=corners.vertices,
        mass=properties.mass,
        inertia=properties.inertia if options.inertia is None else symmetric_inertia(options.inertia),
        friction=ASSUMED_FRICTION if friction is None else friction,
        length_scale=options.length_scale or scale,
        gravity=options.gravity or STANDARD_GRAVITY,
        center_of_mass=center,
        hull_count=corners.hull_count,
        error=error,
        source=str(path),
        notes=tuple(notes),
        warnings=(*_approximation(corners, error), *_assumed_friction(friction is not None)),
    )


def _properties(link: Link, options: BodyOptions) -> tuple[MassProperties, str]:
    """The mass properties, and where they are from."""
    uniform = link.solid.uniform
    if options.density is not None:
        return uniform.times(options.density), f"mass and inertia: of the geometry filled with {options.density:g} kg/m^3"
    if link.mass is not None and options.mass is None:
        return link.mass, "mass and inertia: as in the file"
    if options.mass is None:
        raise InvalidValueError("mass", "none in the file", "--mass KG or --density KG/M^3 (in YAML mass: or density:)")
    if link.mass is not None:
        return link.mass.times(
            options.mass / link.mass.mass
        ), f"inertia: as in the file, times {options.mass / link.mass.mass:.3g}"
    return uniform.times(options.mass / uniform.mass), f"inertia: of the geometry filled evenly with {options.mass:g} kg"


def _approximation(corners: Corners, error: float) -> tuple[str, ...]:
    if not error:
        return ()
    which = f"{len(corners.vertices)} of {corners.hull_count} corners" if corners.error else f"{len(corners.vertices)} corners"
    return (f"vertices: {which} stand for the hull and are at most {1e3 * error:.2g} mm inside it",)


def _assumed_friction(is_given: bool) -> tuple[str, ...]:
    return () if is_given else (f"friction: none given, {ASSUMED_FRICTION:g} assumed: give --friction",)


def plain_name(text: str) -> str:
    """A name that topics and files may have: letters, digits and single underscores."""
    return "_".join(re.findall("[A-Za-z0-9]+", text)) or "body"


def _millimetres(place: Array) -> str:
    return "(" + ", ".join(f"{round(1e3 * float(value), 6) + 0.0:.4g}" for value in place) + ")"


def _listed(path: Path, content: Mapping[str, Any], options: BodyOptions) -> BodyDescription:
    """Of a YAML file with vertices or half extents."""
    check_keys(content, (*REQUIRED, *SHAPES, *OPTIONAL, *GEOMETRIES, "density"))
    for name in ("scale", "link"):
        if getattr(options, name) is not None:
            raise InvalidValueError(name, getattr(options, name), f"none for a body whose {' or '.join(SHAPES)} are listed")
    given = {name: value for name, value in vars(options).items() if value is not None and name != "center_of_mass"}
    weight = {"mass", "density"} if given.keys() & {"mass", "density"} else set[str]()  # an option takes a key's place
    stated = {**{key: value for key, value in content.items() if key not in weight}, **given}
    stated, notes = _filled(stated, options.center_of_mass)
    told = body_of_mapping({"friction": ASSUMED_FRICTION, "length_scale": 1.0, **stated})
    if "length_scale" not in stated:
        told["length_scale"] = derived_scale(of_hull(told["vertices"]).mass)
    if options.mass is not None and "mass" in content and "inertia" in content:
        told["inertia"] = told["inertia"] * (options.mass / number("mass", content["mass"]))
    vertices = told.pop("vertices")
    if options.center_of_mass is not None:
        vertices = vertices + told["center_of_mass"] - options.center_of_mass
        told["center_of_mass"] = options.center_of_mass
    if (center := told["center_of_mass"]).any():
        notes = (*notes, f"centre of mass: at {_millimetres(center)} mm in the frame that the tracker follows")
    corners = Corners(vertices, len(vertices), 0.0)
    if len(vertices) > MAX_CONTACTS:
        corners = hull_corners(vertices, MAX_CONTACTS)
    return BodyDescription(
        **told,
        vertices=corners.vertices,
        hull_count=corners.hull_count,
        error=corners.error,
        source=str(path),
        notes=notes,
        warnings=(*_approximation(corners, corners.error), *_assumed_friction("friction" in stated)),
    )


def _filled(stated: Mapping[str, Any], center: Array | None) -> tuple[dict[str, Any], tuple[str, ...]]:
    """The values of a listed shape, with mass and inertia of an even filling where they state no inertia, and a note of it.

    Its middle is at the origin, unless the centre of mass is given as an option.
    """
    rest = {key: value for key, value in stated.items() if key != "density"}
    density = number("density", stated["density"]) if "density" in stated else None
    if density is not None and not is_measurable(density):
        raise InvalidValueError("density", density, "a positive number")
    if density is not None and "mass" in stated:
        raise InvalidValueError("density", f"{density:g} beside a mass", "one of both")
    if density is not None and "inertia" in stated:
        raise InvalidValueError("density", f"{density:g} beside an inertia", "a mass, or no inertia")
    if "inertia" in stated:
        return rest, ()
    if density is None and "mass" not in stated:
        return {**rest, "inertia": np.eye(3).tolist()}, ()  # the mass alone is missing
    hull = of_hull(vertices_of_mapping(rest))
    mass = density * hull.mass if density is not None else number("mass", stated["mass"])
    if center is None and float(np.linalg.norm(hull.center)) > OFF_CENTRE * derived_scale(hull.mass):
        found = f"a shape whose middle is at {_millimetres(hull.center)} mm"
        expected = "the centre of mass at the origin, as of an even filling, or --center-of-mass, or inertia"
        raise InvalidValueError("vertices", found, expected)
    if not is_measurable(mass):
        raise InvalidValueError("mass", mass, "a positive number")
    by = f"{mass:g} kg" if density is None else f"{density:g} kg/m^3"
    inertia = (hull.inertia * (mass / hull.mass)).tolist()
    return {**rest, "mass": mass, "inertia": inertia}, (f"inertia: of the shape filled evenly with {by}",)
