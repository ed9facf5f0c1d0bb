"""Grasps of a vacuum gripper: the middle of each flat face on which its pad fits, at any angle about the face's normal."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull

from contact_curation.contact.body import Body
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.polytopes import SAME_PLANE
from contact_curation.geometry.quaternions import Array

PAD_RADIUS = 0.015
"""Radius of the pad's sealing lip [m]."""


@dataclass(frozen=True, eq=False)
class Grasps:
    """The G faces on which the pad fits, in the body's frame.

    Attributes:
        places: (G, 3) positions of the pad's centre [m].
        normals: (G, 3) outward unit normals.
    """

    places: Array
    normals: Array

    def __len__(self) -> int:
        return len(self.places)


def grasps_of(body: Body) -> Grasps:
    """Finds the grasps of a body.

    Args:
        body: body to hold.

    Raises:
        InvalidValueError: no face is large enough for the pad.
    """
    hull = ConvexHull(body.vertices)
    planes = _distinct(hull.equations)
    places, normals, radii = [], [], []
    for plane in planes:
        facets = hull.simplices[np.abs(hull.equations - plane).max(axis=1) <= SAME_PLANE]
        place = _centroid(body.vertices, facets)
        edges = np.abs(planes[:, :3] @ place + planes[:, 3])  # distances to all planes; 0 for the face's own
        slopes = np.linalg.norm(np.cross(planes[:, :3], plane[:3]), axis=1)
        apart = slopes > 1e-3
        places.append(place)
        normals.append(plane[:3] / np.linalg.norm(plane[:3]))
        radii.append(float((edges[apart] / slopes[apart]).min()))
    fits = np.array(radii) >= PAD_RADIUS
    if not fits.any():
        raise InvalidValueError(
            f"body {body.name}", f"faces with room for a circle of {max(radii):.3f} m", f"one of {PAD_RADIUS} m for the pad"
        )
    return Grasps(np.array(places)[fits], np.array(normals)[fits])


def _distinct(planes: Array) -> Array:
    """Removes repeated planes (normal, offset) (F, 4)."""
    kept: list[Array] = []
    for plane in planes:
        if all(np.abs(plane - one).max() > SAME_PLANE for one in kept):
            kept.append(plane)
    return np.array(kept)


def _centroid(vertices: Array, facets: Array) -> Array:
    corners = vertices[facets]  # (F, 3, 3)
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return np.asarray(areas @ corners.mean(axis=1) / areas.sum())
