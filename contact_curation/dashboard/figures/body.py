"""One picture of a body: its hull as a whole and from three sides, its centre of mass, and the frame that a tracker follows."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from contact_curation.dashboard.style import BLUE, INK, PALE, VERMILION, new_figure, save_figure
from contact_curation.geometry.quaternions import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH, HEIGHT, DOTS = 12.0, 9.0, 100
FLAT = 0.999
"""Cosine between the normals of facets that are drawn as one face."""

MARGIN = 1.15
TICKS = 5
"""Most ticks on an axis."""

VIEWS = (("From above, along -z", "xy"), ("From the front, along y", "xz"), ("From the side, along -x", "yz"))


@dataclass(frozen=True, eq=False)
class BodyPicture:
    """What the figure shows.

    Attributes:
        name: name of the body.
        vertices: (V, 3) about the centre of mass [m].
        center_of_mass: (3,) in the frame that a tracker follows [m].
        mass: [kg].
        inertia: (3, 3) [kg m^2].
    """

    name: str
    vertices: Array
    center_of_mass: Array
    mass: float
    inertia: Array


def save_body_figure(picture: BodyPicture, path: Path) -> None:
    """Draws the picture into a PNG file of 1200 x 900 dots.

    Raises:
        InvalidValueError: `path` cannot be written.
    """
    save_figure(body_figure(picture), path)


def body_figure(picture: BodyPicture) -> "Figure":
    """The picture as a matplotlib figure."""
    corners = 1e3 * (picture.vertices + picture.center_of_mass)
    edges = _edges(corners)
    with new_figure(WIDTH, HEIGHT, DOTS) as figure:
        moments = ", ".join(f"{value:.3g}" for value in np.linalg.eigvalsh(picture.inertia))
        about = f"{len(picture.vertices)} vertices, {picture.mass:.3g} kg, moments of inertia {moments} kg m²"
        figure.suptitle(f"{picture.name}: {about}", fontsize=13)
        whole: Any = figure.add_subplot(2, 2, 1, projection="3d", proj_type="ortho")
        _draw(whole, corners, edges, 1e3 * picture.center_of_mass)
        _frame(whole, corners, "xyz", "The convex hull, which touches the board")
        for place, (title, seen) in enumerate(VIEWS, start=2):
            columns = ["xyz".index(axis) for axis in seen]
            axes: Any = figure.add_subplot(2, 2, place, aspect="equal")
            _draw(axes, corners[:, columns], edges, 1e3 * picture.center_of_mass[columns])
            _frame(axes, corners[:, columns], seen, title)
            axes.grid(visible=True, linewidth=0.4)
        handles, labels = whole.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3)
    return figure


def _draw(axes: Any, corners: Array, edges: Sequence[tuple[int, int]], center: Array) -> None:
    """The hull in two or three dimensions [mm]."""
    for first, second in edges:
        axes.plot(*np.stack([corners[first], corners[second]], axis=1), color=INK.web, linewidth=1.2)
    marks = [
        (corners.T, BLUE.web, "o", 16, "vertices, which touch the board"),
        (center, VERMILION.web, "o", 60, "centre of mass"),
    ]
    if center.any():
        marks.append((np.zeros_like(center), PALE.web, "s", 50, "origin of the tracked frame"))
    for places, colour, marker, size, label in marks:
        axes.scatter(*places, color=colour, marker=marker, s=size, label=label, zorder=3)


def _frame(axes: Any, corners: Array, names: str, title: str) -> None:
    """Equal units on all axes, few ticks, and names with units."""
    axes.set_title(title)
    middles = 0.5 * (corners.max(axis=0) + corners.min(axis=0))
    half = 0.5 * MARGIN * float(np.ptp(corners, axis=0).max())
    for shown, name, middle in zip("xyz", names, middles, strict=False):
        getattr(axes, f"set_{shown}lim")(middle - half, middle + half)
        getattr(axes, f"set_{shown}label")(f"{name} [mm]")
    axes.locator_params(nbins=TICKS)


def _edges(corners: Array) -> list[tuple[int, int]]:
    """Pairs of corners between faces that are not in one plane."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(corners)
    normals = hull.equations[:, :3]
    return [
        (int(first), int(second))
        for facet, neighbours in enumerate(hull.neighbors)
        for place, other in enumerate(neighbours)
        if other > facet and normals[facet] @ normals[other] < FLAT
        for first, second in [np.delete(hull.simplices[facet], place)]
    ]
