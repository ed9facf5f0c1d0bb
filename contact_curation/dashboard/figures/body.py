"""One picture of a body: its hull from four sides, its centre of mass, and the frame that a tracker follows.

matplotlib is imported when a picture is drawn.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from contact_curation.dashboard.style import BLUE, INK, PALE, VERMILION, save_figure
from contact_curation.geometry.quaternions import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH, HEIGHT, DOTS = 12.0, 9.0, 100
FLAT = 0.999
"""Cosine between the normals of facets that are drawn as one face."""

VIEWS = (("From above, along -z", (90, -90)), ("From the front, along +y", (0, -90)), ("From the side, along -x", (0, 0)))


@dataclass(frozen=True, eq=False)
class BodyPicture:
    """What the figure shows.

    Attributes:
        name: of the body.
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
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, HEIGHT), dpi=DOTS, layout="constrained")
    FigureCanvasAgg(figure)
    moments = ", ".join(f"{value:.3g}" for value in np.linalg.eigvalsh(picture.inertia))
    title = f"{picture.name}: {len(picture.vertices)} vertices, {picture.mass:.3g} kg, moments of inertia {moments} kg m²"
    figure.suptitle(title, fontweight="bold")
    corners = 1e3 * (picture.vertices + picture.center_of_mass)
    edges = _edges(corners)
    center, half = 0.5 * (corners.max(axis=0) + corners.min(axis=0)), 0.55 * float(np.ptp(corners, axis=0).max())
    for place, (name, (elevation, azimuth)) in enumerate((("The whole body", (25, -60)), *VIEWS), start=1):
        axes: Any = figure.add_subplot(2, 2, place, projection="3d", proj_type="ortho")
        axes.view_init(elevation, azimuth)
        for first, second in edges:
            axes.plot(*np.stack([corners[first], corners[second]], axis=1), color=INK.web, linewidth=1.2)
        axes.scatter(*corners.T, color=BLUE.web, s=16, depthshade=False, label="vertices, which touch the board")
        axes.scatter(*(1e3 * picture.center_of_mass), color=VERMILION.web, s=60, depthshade=False, label="centre of mass")
        if picture.center_of_mass.any():
            axes.scatter(0.0, 0.0, 0.0, color=PALE.web, marker="s", s=50, depthshade=False, label="origin of the tracked frame")
        axes.set_title(name)
        for axis, middle in zip("xyz", center, strict=True):
            getattr(axes, f"set_{axis}lim")(middle - half, middle + half)
            getattr(axes, f"set_{axis}label")(f"{axis} [mm]")
        axes.set_box_aspect((1, 1, 1))
        if place > 1:
            _hide_depth_axis(axes, {2: "z", 3: "y", 4: "x"}[place])
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
    return figure


def _hide_depth_axis(axes: Any, axis: str) -> None:
    """The axis that is seen end on has ticks upon each other."""
    getattr(axes, f"set_{axis}ticks")([])
    getattr(axes, f"set_{axis}label")("")


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
