"""The named values of a body, as YAML, checkpoints and manifests have them; every mistake names its key.

name, mass [kg], inertia [kg m^2], friction, length_scale [m]     and vertices or half_extents [m]
gravity [m/s^2], center_of_mass [m]                               where they are not 9.81 and the origin
"""

import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from contact_curation.contact.plausibility import check_lengths, derived_scale
from contact_curation.errors import ContactCurationError, InvalidValueError, UnknownNameError
from contact_curation.geometry.numbers import number, numbers, shortened
from contact_curation.geometry.polytopes import Polytope, box, checked_corners
from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.solids.mass_properties import of_hull
from contact_curation.solver.cone_problem import MAX_CONTACTS

STANDARD_GRAVITY = 9.81
"""[m/s^2], the value ContactNets used (method.md 1.0)."""

NAME = re.compile(r"[A-Za-z0-9]+(_[A-Za-z0-9]+)*")

ROUNDING = 1e-9
"""Share of an inertia's largest number by which it may be asymmetric, or its largest moment too large."""

SMALLEST, LARGEST = 1e-12, 1e12
"""In SI units, far below and above what anybody tosses."""

LIKELY_DENSITY = 400.0
"""[kg/m^3] for examples in messages."""

GEOMETRIES = ("mesh", "urdf", "mjcf")
"""Keys in YAML that name a file with the geometry, by a path relative to that of the YAML."""

REQUIRED = ("name", "mass", "inertia", "friction", "length_scale")
SHAPES = ("vertices", "half_extents")
OPTIONAL = ("gravity", "center_of_mass")


def body_of_mapping(content: Mapping[str, Any]) -> dict[str, Any]:
    """The arguments of `contact.body.Body` out of named values, as YAML, a checkpoint or a manifest has them.

    Raises:
        InvalidValueError: a key is missing or unknown, or its value is of another form; the message names it.
    """
    check_keys(content, (*REQUIRED, *SHAPES, *OPTIONAL, *GEOMETRIES))
    vertices = vertices_of_mapping(content)
    missing = [key for key in REQUIRED if key not in content]
    if missing:
        volume = of_hull(vertices).mass
        check_lengths(vertices, number("mass", content["mass"]) / volume if "mass" in content else LIKELY_DENSITY)
        raise MissingKeyError({key: _example(key, content, vertices) for key in missing})
    return {
        "name": text(content, "name"),
        "vertices": vertices,
        "inertia": symmetric_inertia(numbers("inertia", content["inertia"])),
        **{key: number(key, content[key]) for key in ("mass", "friction", "length_scale")},
        "gravity": number("gravity", content["gravity"]) if "gravity" in content else STANDARD_GRAVITY,
        "center_of_mass": numbers("center_of_mass", content["center_of_mass"]) if "center_of_mass" in content else np.zeros(3),
    }


def vertices_of_mapping(content: Mapping[str, Any]) -> Array:
    """(V, 3) the corners that named values list [m]; errors as of `body_of_mapping`."""
    given = [key for key in SHAPES if key in content]
    if len(given) == 2:
        raise InvalidValueError("half_extents", "both they and vertices", "one of both")
    if not given:
        raise InvalidValueError("missing key", "no shape", f"{', '.join(SHAPES)}, {', '.join(GEOMETRIES)}: one of them")
    vertices = box(_half_extents(content)).vertices if given == ["half_extents"] else numbers("vertices", content["vertices"])
    if np.abs(vertices).max(initial=0.0) > LARGEST:
        raise InvalidValueError("vertices", f"{np.abs(vertices).max():.3g}", f"metres, at most {LARGEST:g}")
    return checked_corners(vertices) if len(Polytope(vertices).vertices) <= MAX_CONTACTS else vertices


class MissingKeyError(InvalidValueError):
    """Keys that a description lacks, with an example of each."""

    def __init__(self, examples: Mapping[str, str]) -> None:
        listed = ", ".join(f"{key} (e.g. {example})" for key, example in examples.items())
        ContactCurationError.__init__(self, f"missing key{'s' if len(examples) > 1 else ''}: {listed}")


def _example(key: str, content: Mapping[str, Any], vertices: Array) -> str:
    """A likely value, by the shape and the mass where they are known."""
    hull = of_hull(vertices)
    if key == "length_scale":
        return f"{derived_scale(hull.mass):.3g}"
    if key == "inertia":
        mass = number("mass", content["mass"]) if "mass" in content else LIKELY_DENSITY * hull.mass
        return "[" + ", ".join(f"{value:.3g}" for value in np.diag(hull.inertia) * mass / hull.mass) + "]"
    return {"name": "brick", "mass": f"{LIKELY_DENSITY * hull.mass:.2g}", "friction": "0.3"}[key]


def _half_extents(content: Mapping[str, Any]) -> Array:
    half = numbers("half_extents", content["half_extents"])
    if half.shape != (3,) or not (np.isfinite(half).all() and half.min() > 0.0):
        raise InvalidValueError("half_extents", shortened(content["half_extents"]), "3 positive numbers [m]")
    return half


def is_measurable(value: float) -> bool:
    """Whether a positive number can be a mass, a length or an acceleration at all; squares of others overflow."""
    return SMALLEST < value < LARGEST


def check_values(values: Mapping[str, Any]) -> None:
    """Refuses values that no body has, by whatever they were given.

    Args:
        values: as of `contact.body.Body`, its vertices aside; the inertia is (3, 3).

    Raises:
        InvalidValueError: a number that is not positive or not finite, or moments that no body has.
    """
    if not (isinstance(values["name"], str) and NAME.fullmatch(values["name"])):
        expected = "letters, digits and single underscores, as in topics"
        raise InvalidValueError("name of the body", repr(values["name"]), expected)
    for name in ("mass", "length_scale", "gravity"):
        if not is_measurable(values[name]):
            raise InvalidValueError(name, values[name], "a positive number")
    if not (np.isfinite(values["friction"]) and values["friction"] >= 0.0):
        raise InvalidValueError("friction", values["friction"], "a number of at least 0")
    if not np.isfinite(values["inertia"]).all():
        raise InvalidValueError("inertia", "numbers that are not finite", "finite ones [kg m^2]: is the shape in metres?")
    moments = np.linalg.eigvalsh(values["inertia"])
    if moments.min() <= 0.0:
        raise InvalidValueError("inertia", f"moments {moments}", "positive ones [kg m^2]")
    if moments[0] + moments[1] < moments[2] * (1.0 - ROUNDING):
        raise InvalidValueError("inertia", f"moments {moments}", "none larger than the sum of the other two [kg m^2]")
    checked_place("center_of_mass", values["center_of_mass"])


def checked_place(name: str, value: Any) -> Array:
    """(3,) a place in metres; InvalidValueError where it is something else."""
    place = numbers(name, value)
    if place.shape != (3,) or not np.isfinite(place).all():
        raise InvalidValueError(name, place, "3 finite numbers [m]")
    return place


def check_keys(content: Mapping[str, Any], known: tuple[str, ...]) -> None:
    """Raises UnknownNameError for the first key that is not among the known ones."""
    for key in content:
        if key not in known:
            raise UnknownNameError("key", repr(key), [repr(one) for one in known])


def symmetric_inertia(inertia: Array) -> Array:
    """(3, 3) an inertia given as three moments or as a symmetric matrix.

    Raises:
        InvalidValueError: it has another shape, a number that is not finite, or is not symmetric.
    """
    inertia = np.diag(inertia) if np.shape(inertia) == (3,) else np.asarray(inertia)
    if inertia.shape != (3, 3) or not np.isfinite(inertia).all():
        raise InvalidValueError("inertia", np.array2string(inertia), "3 or 3x3 finite numbers [kg m^2]")
    away = np.abs(inertia - inertia.T)
    if away.max() > ROUNDING * np.abs(inertia).max():
        row, column = np.unravel_index(int(away.argmax()), (3, 3))
        pair = f"{inertia[row, column]:g} in row {row + 1}, column {column + 1}, and {inertia[column, row]:g} opposite of it"
        raise InvalidValueError("inertia", pair, "a symmetric matrix")
    return inertia


def text(content: Mapping[str, Any], key: str) -> str:
    """The text under a key; InvalidValueError where it is something else."""
    if not isinstance(content[key], str) or not content[key]:
        raise InvalidValueError(key, shortened(content[key]), "a text")
    return str(content[key])
