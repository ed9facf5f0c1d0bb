"""The tossed object, as its user describes it in SI units."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from contact_curation.errors import InvalidValueError, UnreadableInputError
from contact_curation.files import read_yaml
from contact_curation.geometry.polytopes import Polytope, box, checked_corners
from contact_curation.geometry.quaternions import Array

STANDARD_GRAVITY = 9.81
"""[m/s^2], the value ContactNets used (method.md 1.0)."""

LARGEST_FILE = 2**22
"""Bytes of a description."""

NAME = re.compile(r"[A-Za-z0-9]+(_[A-Za-z0-9]+)*")


@dataclass(frozen=True, eq=False)
class Body:
    """A convex rigid body with isotropic friction against the board.

    Attributes:
        name: used in toss ids, topics, frames and the names of files: letters, digits and single underscores.
        vertices: (V, 3) [m] in the body's frame, whose origin is the centre of mass.
        mass: [kg].
        inertia: (3, 3) about the centre of mass [kg m^2].
        friction: Coulomb coefficient.
        length_scale: characteristic length, the unit of the loss [m] (a cube's half width).
        gravity: [m/s^2].
    """

    name: str
    vertices: Array
    mass: float
    inertia: Array
    friction: float
    length_scale: float
    gravity: float = STANDARD_GRAVITY

    def __post_init__(self) -> None:
        if not NAME.fullmatch(self.name):
            raise InvalidValueError("name of the body", repr(self.name), "letters, digits and single underscores, as in topics")
        object.__setattr__(self, "vertices", Polytope(self.vertices).vertices)
        inertia = np.asarray(self.inertia, dtype=float)
        if inertia.shape == (3,):
            inertia = np.diag(inertia)
        moments = np.linalg.eigvalsh(inertia) if inertia.shape == (3, 3) and np.isfinite(inertia).all() else np.zeros(3)
        if moments.min() <= 0.0:
            raise InvalidValueError("inertia", np.array2string(inertia), "3 or 3x3 positive numbers [kg m^2]")
        if moments[0] + moments[1] < moments[2]:
            raise InvalidValueError("inertia", f"moments {moments}", "none larger than the sum of the other two [kg m^2]")
        object.__setattr__(self, "inertia", inertia)
        for name in ("mass", "length_scale", "gravity"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) > 0.0):
                raise InvalidValueError(name, getattr(self, name), "a positive number")
        if not (np.isfinite(self.friction) and self.friction >= 0.0):
            raise InvalidValueError("friction", self.friction, "a number of at least 0")

    @property
    def polytope(self) -> Polytope:
        """The body's shape in metres."""
        return Polytope(self.vertices)

    @property
    def scaled_vertices(self) -> Array:
        """(V, 3) vertices in characteristic lengths."""
        return self.vertices / self.length_scale

    @property
    def scaled_inertia(self) -> Array:
        """(3, 3) inertia in kg per squared characteristic length."""
        return self.inertia / self.length_scale**2

    @cached_property
    def scaled_inverse_inertia(self) -> Array:
        """(3, 3) inverse of `scaled_inertia`, with the same digits on every machine: the kernel works with it."""
        inverse = _inverse(self.scaled_inertia)
        inverse.flags.writeable = False
        return inverse

    @property
    def scaled_gravity(self) -> float:
        """Gravity in characteristic lengths per s^2."""
        return self.gravity / self.length_scale

    @staticmethod
    def from_file(path: str | Path) -> "Body":
        """Reads the body that a YAML file describes, a file like contact_curation/config/cube.yaml.

        Args:
            path: of the file.

        Returns:
            The body, in SI units.

        Raises:
            UnreadableInputError: there is no such file, it is no YAML mapping, or it describes no body; the line names the key.

        Examples:
            >>> body = cc.Body.from_file("brick.yaml")
            >>> body.mass
            0.37
        """
        path = Path(path)
        content = read_yaml(path, LARGEST_FILE, "the description of a body")
        if not isinstance(content, Mapping) or not all(isinstance(key, str) for key in content):
            found = type(content).__name__
            raise UnreadableInputError(path, f"found a {found}, expected the keys of a body and their values")
        try:
            return Body.from_mapping(content)
        except InvalidValueError as error:
            raise UnreadableInputError(path, str(error)) from error
        except (TypeError, ValueError) as error:  # a list where one number belongs, three numbers where there are two
            raise UnreadableInputError(path, f"found values of the wrong form ({error}), expected those of a body") from error

    @staticmethod
    def from_mapping(data: Mapping[str, object]) -> "Body":
        """A body from a parsed configuration file; every error names the key."""
        known = {"name", "vertices", "half_extents", "mass", "inertia", "friction", "length_scale", "gravity"}
        unknown = sorted(set(data) - known)
        if unknown:
            raise InvalidValueError("body", f"keys {unknown}", f"keys among {sorted(known)}")
        missing = sorted({"name", "mass", "inertia", "friction", "length_scale"} - set(data))
        if missing or ("vertices" in data) == ("half_extents" in data):
            wanted = "name, mass, inertia, friction, length_scale, and either vertices or half_extents"
            raise InvalidValueError("body", f"keys {sorted(data)}", wanted)
        boxed = "half_extents" in data
        shape = box(_numbers(data, "half_extents")).vertices if boxed else checked_corners(_numbers(data, "vertices"))
        return Body(
            name=str(data["name"]),
            vertices=shape,
            mass=float(_numbers(data, "mass")),
            inertia=_numbers(data, "inertia"),
            friction=float(_numbers(data, "friction")),
            length_scale=float(_numbers(data, "length_scale")),
            gravity=float(_numbers(data, "gravity")) if "gravity" in data else STANDARD_GRAVITY,
        )


def _inverse(positive: Array) -> Array:
    """Inverse of a positive definite matrix by elimination; LAPACK's last digits depend on the CPU."""
    size = len(positive)
    rows = np.hstack([positive, np.eye(size)]).tolist()
    for k in range(size):
        rows[k] = [number / rows[k][k] for number in rows[k]]
        for other in {*range(size)} - {k}:
            share = rows[other][k]
            rows[other] = [number - share * by for number, by in zip(rows[other], rows[k])]
    return np.array(rows)[:, size:].copy()


def _numbers(data: Mapping[str, object], key: str) -> Array:
    try:
        return np.asarray(data[key], dtype=float)
    except (TypeError, ValueError) as error:
        raise InvalidValueError(f"body {key}", data[key], "numbers") from error


_CUBE_CORNERS = np.array(
    [[-1, -1, 1], [-1, -1, -1], [-1, 1, -1], [-1, 1, 1], [1, -1, 1], [1, -1, -1], [1, 1, -1], [1, 1, 1]], dtype=float
)

CONTACTNETS_CUBE = Body(
    name="cube",
    vertices=0.0524 * _CUBE_CORNERS,
    mass=0.37,
    inertia=np.full(3, 8.1e-4),
    friction=0.18,
    length_scale=0.0524,
)
"""ContactNets' acrylic cube (method.md 3), vertices in the order of its public `experiment.json`."""
