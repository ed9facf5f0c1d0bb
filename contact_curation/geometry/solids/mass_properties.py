"""Mass, centre of mass and inertia of rigid bodies, and what they are together (parallel axis theorem)."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from contact_curation.geometry.quaternions import Array


class MassProperties(NamedTuple):
    """How a rigid body's mass is distributed.

    Attributes:
        mass: [kg], or the volume [m^3] where the density is 1.
        center: (3,) centre of mass [m].
        inertia: (3, 3) about the centre of mass, in the axes of the frame [kg m^2].
    """

    mass: float
    center: Array
    inertia: Array

    def times(self, factor: float) -> "MassProperties":
        """The same body, `factor` times as heavy."""
        return MassProperties(factor * self.mass, self.center, factor * self.inertia)

    def moved(self, rotation: Array, translation: Array) -> "MassProperties":
        """Seen from a frame in which this one has the rotation (3, 3) and the translation (3,)."""
        turned = rotation @ self.inertia @ rotation.T
        return MassProperties(self.mass, rotation @ self.center + translation, 0.5 * (turned + turned.T))


def combined(parts: Sequence[MassProperties]) -> MassProperties:
    """All parts as one rigid body; at least one of them has a mass."""
    mass = sum(part.mass for part in parts)
    center = np.sum([part.mass * part.center for part in parts], axis=0) / mass
    inertia = np.sum([part.inertia + part.mass * _offset(part.center - center) for part in parts], axis=0)
    return MassProperties(mass, center, inertia)


def _offset(arm: Array) -> Array:
    """(3, 3) inertia of a unit mass at the end of an arm (3,)."""
    return np.asarray(arm @ arm * np.eye(3) - np.outer(arm, arm))


def of_hull(vertices: Array) -> MassProperties:
    """The convex hull of vertices (V, 3) with density 1: the sum of the tetrahedra between its facets and a point in it."""
    from scipy.spatial import ConvexHull  # takes a quarter of a second to import

    hull, middle = ConvexHull(vertices), vertices.mean(axis=0)
    corners = vertices[hull.simplices] - middle  # (F, 3, 3)
    volumes = np.abs(np.linalg.det(corners)) / 6.0  # (F,)
    total, sums = float(volumes.sum()), corners.sum(axis=1)
    center = volumes @ sums / (4.0 * total)
    products = np.einsum("fki,fkj->fij", corners, corners) + np.einsum("fi,fj->fij", sums, sums)
    second = np.einsum("f,fij->ij", volumes, products) / 20.0 - total * np.outer(center, center)
    return MassProperties(total, center + middle, np.trace(second) * np.eye(3) - second)
