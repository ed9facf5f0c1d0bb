"""The shapes of URDF and MJCF as points of their convex hull, with exact mass properties.

Round shapes become polytopes inside them. A prism with N sides stays r (1 - cos(pi / N)) inside its cylinder, a triangulated
sphere as far as the middle of its largest triangle does.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.solids.mass_properties import MassProperties, combined

SIDES = 16
"""Sides of the prism that stands for a cylinder, 2 % of the radius inside it at most."""

SPHERE_ERROR = 0.00453
"""Share of the radius: so far inside the sphere is the hull of `_sphere_points` at most."""


@dataclass(frozen=True, eq=False)
class Solid:
    """A rigid body of density 1.

    Attributes:
        points: (N, 3) their convex hull is the body, as far as a flat board can touch it [m].
        uniform: mass properties at a density of 1 kg/m^3, exact also where the points approximate a round shape.
        error: the points' hull is inside the shape by at most this [m].
    """

    points: Array
    uniform: MassProperties
    error: float = 0.0

    def moved(self, rotation: Array, translation: Array) -> "Solid":
        """Seen from a frame in which this one has the rotation (3, 3) and the translation (3,)."""
        return Solid(self.points @ rotation.T + translation, self.uniform.moved(rotation, translation), self.error)


def union(solids: Sequence[Solid]) -> Solid:
    """All solids as one body; where they overlap, their mass counts twice."""
    points = np.concatenate([solid.points for solid in solids])
    return Solid(points, combined([solid.uniform for solid in solids]), max(solid.error for solid in solids))


def box(half_extents: ArrayLike) -> Solid:
    """A box of half extents (3,)."""
    half = np.asarray(half_extents, dtype=float)
    corners = half * np.array(list(product((-1.0, 1.0), repeat=3)))
    return Solid(corners, _uniform(8.0 * float(half.prod()), (half @ half - half**2) / 3.0))


def cylinder(radius: float, length: float) -> Solid:
    """A cylinder along z, as a prism with `SIDES` sides."""
    angles = 2.0 * np.pi * np.arange(SIDES) / SIDES
    ring = radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    points = np.concatenate([np.column_stack([ring, np.full(SIDES, end)]) for end in (-0.5 * length, 0.5 * length)])
    across, along = 0.25 * radius**2 + length**2 / 12.0, 0.5 * radius**2
    uniform = _uniform(np.pi * radius**2 * length, np.array([across, across, along]))
    return Solid(points, uniform, radius * (1.0 - np.cos(np.pi / SIDES)))


def ellipsoid(radii: ArrayLike) -> Solid:
    """An ellipsoid with half axes (3,)."""
    half = np.asarray(radii, dtype=float)
    uniform = _uniform(4.0 / 3.0 * np.pi * float(half.prod()), (half @ half - half**2) / 5.0)
    return Solid(half * _sphere_points(), uniform, SPHERE_ERROR * float(half.max()))


def sphere(radius: float) -> Solid:
    """A sphere."""
    return ellipsoid(np.full(3, radius))


def capsule(radius: float, length: float) -> Solid:
    """A capsule along z; `length` is between the centres of its ends."""
    ball, half = radius * _sphere_points(), 0.5 * length
    points = np.concatenate([ball + np.array([0.0, 0.0, end]) for end in (-half, half)])
    tube, balls = np.pi * radius**2 * length, 4.0 / 3.0 * np.pi * radius**3
    across = tube * (0.25 * radius**2 + half**2 / 3.0) + balls * (0.4 * radius**2 + half**2 + 0.75 * half * radius)
    along = 0.5 * tube * radius**2 + 0.4 * balls * radius**2
    uniform = _uniform(tube + balls, np.array([across, across, along]) / (tube + balls))
    return Solid(points, uniform, SPHERE_ERROR * radius)


def _uniform(volume: float, moments: Array) -> MassProperties:
    """About the origin; `moments` are per unit of mass."""
    return MassProperties(volume, np.zeros(3), volume * np.diag(moments))


def _sphere_points() -> Array:
    """(642, 3) on the unit sphere: an icosahedron whose triangles were quartered three times."""
    from trimesh.creation import icosphere  # takes half a second to import

    return np.asarray(icosphere(subdivisions=3).vertices, dtype=float)
