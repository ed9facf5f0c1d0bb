"""The tossed object, as its user describes it in SI units."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from contact_curation.configs import plain_values
from contact_curation.contact.body_description import (
    BodyDescription,
    BodyOptions,
    read_description,
)
from contact_curation.contact.body_values import (
    STANDARD_GRAVITY,
    body_of_mapping,
    check_values,
    checked_place,
    symmetric_inertia,
)
from contact_curation.errors import InvalidValueError, UnreadableInputError
from contact_curation.files import path_of
from contact_curation.geometry.numbers import frozen, number, numbers
from contact_curation.geometry.polytopes import Polytope
from contact_curation.geometry.quaternions import Array


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
        center_of_mass: (3,) where the body's origin is in the frame that a tracker follows, whose axes are the same [m].
    """

    name: str
    vertices: Array
    mass: float
    inertia: Array
    friction: float
    length_scale: float
    gravity: float = STANDARD_GRAVITY
    center_of_mass: Array = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", Polytope(self.vertices).vertices)
        object.__setattr__(self, "inertia", frozen(symmetric_inertia(numbers("inertia", self.inertia))))
        object.__setattr__(self, "center_of_mass", numbers("center_of_mass", self.center_of_mass))
        for name in ("mass", "friction", "length_scale", "gravity"):
            object.__setattr__(self, name, number(name, getattr(self, name)))
        check_values(vars(self))

    @cached_property
    def polytope(self) -> Polytope:
        """The body's shape in metres."""
        return Polytope(self.vertices)

    def about(self, center_of_mass: ArrayLike) -> "Body":
        """The same shape with its centre of mass (3,) elsewhere in the frame that a tracker follows [m]."""
        center = checked_place("center_of_mass", center_of_mass)
        return replace(self, vertices=self.vertices + self.center_of_mass - center, center_of_mass=center)

    @property
    def tracked_polytope(self) -> Polytope:
        """The shape in the frame that a tracker follows, in metres."""
        return Polytope(self.vertices + self.center_of_mass)

    @property
    def scaled_vertices(self) -> Array:
        """(V, 3) vertices in characteristic lengths."""
        return self.vertices / self.length_scale

    @property
    def scaled_inertia(self) -> Array:
        """(3, 3) inertia in kg per squared characteristic length."""
        return self.inertia / self.length_scale**2

    @cached_property
    def gyroscopic_inertia(self) -> Array | None:
        """(3, 3) `scaled_inertia`; None where all moments are the same, as a cube's, and no spin precesses."""
        inertia = self.scaled_inertia
        return None if np.array_equal(inertia, inertia[0, 0] * np.eye(3)) else np.ascontiguousarray(inertia)

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

    def first_difference(self, other: "Body") -> str:
        """The first value in which another body differs; empty where there is none but the name, which changes no number."""
        names = [one.name for one in fields(self) if one.name != "name"]
        return next((name for name in names if not np.array_equal(getattr(self, name), getattr(other, name))), "")

    @staticmethod
    def from_file(
        path: str | Path,
        *,
        name: str | None = None,
        mass: float | None = None,
        density: float | None = None,
        friction: float | None = None,
        length_scale: float | None = None,
        scale: float | None = None,
        link: str | None = None,
    ) -> "Body":
        """Reads the body that a file describes.

        Args:
            path: YAML file like contact_curation/config/cube.yaml, URDF, MJCF, or mesh (STL, OBJ, PLY, OFF).
            name: name of the body. For this and all following options, None means the value of the file.
            mass: mass [kg]; an inertia in the file is scaled with it.
            density: density [kg/m^3] of the evenly filled geometry, in place of a mass.
            friction: Coulomb friction coefficient.
            length_scale: unit of length of the loss [m].
            scale: length of a mesh's unit [m], 0.001 for mm.
            link: name of the link, if a URDF or MJCF has several.

        Returns:
            The body, in SI units.

        Raises:
            UnreadableInputError: the file does not exist, describes no body, or describes an impossible one; the message names
                the value and what to do.

        Examples:
            >>> body = cc.Body.from_file("brick.yaml")
            >>> body.mass
            0.37
        """
        options = BodyOptions(name, mass, density, friction, length_scale, scale, link)
        return Body.described(read_description(path_of("path", path, "the path of a body's file"), options))

    @staticmethod
    def described(found: BodyDescription) -> "Body":
        """The body of a description."""
        try:
            return Body(**{one.name: getattr(found, one.name) for one in fields(Body)})
        except InvalidValueError as error:
            raise UnreadableInputError(found.source, str(error)) from error

    @staticmethod
    def from_mapping(data: Mapping[str, object]) -> "Body":
        """A body of named values, as `to_mapping` gives them; every error names the key."""
        if not isinstance(data, Mapping):
            raise InvalidValueError("body", repr(data), "named values, as `to_mapping` gives them")
        return Body(**body_of_mapping(data))

    def to_mapping(self) -> dict[str, object]:
        """All values by their names, as JSON and YAML have them."""
        return plain_values(self)

    @property
    def digest(self) -> str:
        """Of all values: another one for another body."""
        return hashlib.sha256(json.dumps(self.to_mapping()).encode()).hexdigest()[:8]


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
