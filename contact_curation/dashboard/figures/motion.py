"""Predicted against measured motion: for a few tosses the height over time, the path from above, and the bodies from the side.

Every model has a line style of its own beside its colour. matplotlib is imported when a picture is drawn.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from contact_curation.dashboard.style import BLUE, INK, PALE, TICK_SIZE, VERMILION, new_figure, save_figure
from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MEASURED, BOARD = INK.web, PALE.web
STYLES = ((BLUE.web, "--"), (VERMILION.web, ":"))
"""Colour and line of the first and the second model."""

WIDTH, ROW_HEIGHT, TITLE_HEIGHT, DOTS = 16.0, 3.9, 0.9, 100
COLUMNS = (1.0, 1.0, 1.5)
MOMENTS = (0.0, 0.35, 1.0)
"""Moments of the motion at which outlines are drawn, as shares of its frames."""

RELEASE_FRAMES = 5
"""Frames from which the direction of flight is computed."""


@dataclass(frozen=True, eq=False)
class Track:
    """A body that moves.

    Attributes:
        positions_mm: (T, 3); NaN where a prediction is not finite.
        orientations_wxyz: (T, 4).
        vertices_mm: (V, 3) of its shape in its own frame.
    """

    positions_mm: Array
    orientations_wxyz: Array
    vertices_mm: Array


@dataclass(frozen=True, eq=False)
class PicturedToss:
    """One row of the figure.

    Attributes:
        title: which toss, and how far off the predictions are.
        times: (T,) since the release [s].
        measured: what happened.
        predicted: what each model said, in the models' order.
    """

    title: str
    times: Array
    measured: Track
    predicted: tuple[Track, ...]


@dataclass(frozen=True, eq=False)
class MotionPicture:
    """What the figure shows.

    Attributes:
        title: one line.
        models: names of one or two models.
        tosses: at least one.
    """

    title: str
    models: tuple[str, ...]
    tosses: tuple[PicturedToss, ...]

    def __post_init__(self) -> None:
        if not 1 <= len(self.models) <= len(STYLES):
            raise InvalidValueError("models in a figure", len(self.models), f"1 to {len(STYLES)}")
        if not self.tosses:
            raise InvalidValueError("tosses in a figure", "none", "at least one")


def save_motion_figure(picture: MotionPicture, path: Path) -> None:
    """Draws the picture into a PNG file, 1600 dots wide.

    Raises:
        InvalidValueError: `path` cannot be written.
    """
    with new_figure(WIDTH, TITLE_HEIGHT + ROW_HEIGHT * len(picture.tosses), DOTS) as figure:
        figure.suptitle(_shown(picture.title), fontsize=15, x=0.02, ha="left")
        rows: Any = np.atleast_1d(figure.subfigures(len(picture.tosses), 1))
        for row, toss in zip(rows, picture.tosses, strict=True):
            row.suptitle(_shown(toss.title), fontsize=13, fontweight="bold", x=0.02, ha="left")
            axes = row.subplots(1, 3, width_ratios=COLUMNS)
            _draw_heights(axes[0], picture.models, toss)
            _draw_paths(axes[1], picture.models, toss)
            _draw_side(axes[2], picture.models, toss)
            for own in axes:
                own.tick_params(labelsize=TICK_SIZE)
        lines = rows[0].axes[0].get_lines()
        figure.legend(handles=lines, loc="upper right", ncols=len(lines))
        save_figure(figure, path)


def _shown(text: str) -> str:
    """What of a file's name a font can show: on disk it may be no text."""
    return text.encode("utf-8", "replace").decode()


def _lines(models: Sequence[str], toss: PicturedToss) -> list[tuple[Track, str, str, str]]:
    """Every track with its name, colour and line."""
    predicted = zip(toss.predicted, models, STYLES, strict=False)
    return [(toss.measured, "measured", MEASURED, "-"), *((track, _shown(name), *style) for track, name, style in predicted)]


def _draw_heights(axes: "Axes", models: Sequence[str], toss: PicturedToss) -> None:
    for track, name, colour, line in _lines(models, toss):
        axes.plot(toss.times, track.positions_mm[:, 2], line, color=colour, linewidth=1.8, label=name)
    axes.set(title="Height of the centre", xlabel="time since release [s]", ylabel="height [mm]")


def _draw_paths(axes: "Axes", models: Sequence[str], toss: PicturedToss) -> None:
    """Draws the paths from above, the flight to the right, with a dot where a motion ends."""
    for track, _, colour, line in _lines(models, toss):
        along = _along_the_flight(toss, track.positions_mm)
        axes.plot(along[:, 0], along[:, 1], line, color=colour, linewidth=1.8)
        end = _last_finite(along)
        axes.plot(end[0], end[1], "o", color=colour, markersize=6, fillstyle="none" if line != "-" else "full")
    axes.set(title="Path from above, to its end (dot)", xlabel="along the flight [mm]", ylabel="across [mm]")
    axes.set_aspect("equal", adjustable="datalim")


def _draw_side(axes: "Axes", models: Sequence[str], toss: PicturedToss) -> None:
    """Draws the bodies from the side at a few moments, the same ones for all."""
    from matplotlib.patches import Polygon

    axes.axhline(0.0, color=BOARD, linewidth=3.0, zorder=0)
    for track, _, colour, line in _lines(models, toss):
        along = _along_the_flight(toss, track.positions_mm)
        axes.plot(along[:, 0], track.positions_mm[:, 2], line, color=colour, linewidth=1.0, alpha=0.7)
        for share in MOMENTS:
            frame = round(share * (len(track.positions_mm) - 1))
            if np.isfinite(track.positions_mm[frame]).all():
                outline = _outline(toss, track, frame)
                axes.add_patch(Polygon(outline, fill=False, edgecolor=colour, linestyle=line, linewidth=1.6))
                axes.update_datalim(outline)
    moments = ", ".join(f"{toss.times[round(share * (len(toss.times) - 1))]:.2f}" for share in MOMENTS)
    axes.set(title=f"From the side, bodies at {moments} s", xlabel="along the flight [mm]", ylabel="height [mm]")
    axes.set_aspect("equal", adjustable="datalim")
    axes.autoscale_view()


def _outline(toss: PicturedToss, track: Track, frame: int) -> Array:
    """(H, 2) convex outline of a body as seen from the side: along the flight, and height."""
    from scipy.spatial import ConvexHull

    corners = track.positions_mm[frame] + quaternions.rotate(track.orientations_wxyz[frame], track.vertices_mm)
    seen = np.column_stack([_along_the_flight(toss, corners)[:, 0], corners[:, 2]])
    return np.asarray(seen[ConvexHull(seen).vertices])


def _along_the_flight(toss: PicturedToss, points_mm: Array) -> Array:
    """(N, 2) of points (N, 3): along the measured direction of release, and across it to the left, from the release."""
    start = toss.measured.positions_mm[0, :2]
    heading = toss.measured.positions_mm[min(RELEASE_FRAMES, len(toss.times) - 1), :2] - start
    length = float(np.linalg.norm(heading))
    ahead = heading / length if length > 0.0 else np.array([1.0, 0.0])
    return np.asarray((points_mm[:, :2] - start) @ np.column_stack([ahead, [-ahead[1], ahead[0]]]))


def _last_finite(points: Array) -> Array:
    finite = np.flatnonzero(np.isfinite(points).all(axis=1))
    return np.asarray(points[finite[-1]] if finite.size else np.full(2, np.nan))
