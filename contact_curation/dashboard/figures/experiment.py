"""Results of experiments: a panel per measure, a line or a row of points per rule, with intervals.

Markers differ, too, not only colours; where there are more rules than colours, those that come again are dashed. matplotlib is
imported when a picture is drawn.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from contact_curation.dashboard.style import BLACK, BLUE, GREEN, GREY, LEVEL, ORANGE, PURPLE, SKY_BLUE, VERMILION, save_figure
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = (BLACK, GREY, ORANGE, VERMILION, PURPLE, SKY_BLUE, GREEN, BLUE)
MARKERS = "os^vDP*Xhp<>"
LINES = ("-", "--", ":")
WIDTH, HEIGHT, DOTS = 5.0, 4.2, 110
COLUMNS = 3
SPREAD = 0.5
"""Of the width between two categories that the points of all series take."""


@dataclass(frozen=True, eq=False)
class Series:
    """One rule's results for one measure.

    Attributes:
        name: in the legend.
        places: numbers, or names of categories.
        values, low, high: (N,) medians and the ends of their intervals, NaN for none.
        stands_out: whether its line is a thick one.
    """

    name: str
    places: Sequence[float] | Sequence[str]
    values: Array
    low: Array
    high: Array
    stands_out: bool = False


class Style(NamedTuple):
    """How the series of a number, from 0 on, is drawn; no two of the first dozen are alike."""

    colour: str
    marker: str
    line: str

    @staticmethod
    def of(number: int) -> "Style":
        line = LINES[number // len(COLOURS) % len(LINES)]
        return Style(COLOURS[number % len(COLOURS)].web, MARKERS[number % len(MARKERS)], line)


@dataclass(frozen=True, eq=False)
class Panel:
    """One measure.

    Attributes:
        measure: with its unit.
        series: at least one.
        logarithmic: whether the measure's axis is.
        level: to compare with, if there is one.
    """

    measure: str
    series: tuple[Series, ...]
    logarithmic: bool = False
    level: float | None = None


def save_experiment_figure(panels: Sequence[Panel], title: str, places: str, path: Path) -> None:
    """Draws panels into a PNG file.

    Args:
        panels: at least one, all over numbers or all over categories.
        title: one line.
        places: what stands along the horizontal axis.
        path: of the file.

    Raises:
        InvalidValueError: there is nothing to draw, or the file cannot be written there.
    """
    if not panels or not all(panel.series for panel in panels):
        raise InvalidValueError("panels of the figure", "none, or an empty one", "at least one with a series")
    from matplotlib.figure import Figure

    columns = min(COLUMNS, len(panels))
    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(WIDTH * columns, HEIGHT * rows), dpi=DOTS, layout="constrained")
    figure.suptitle(title)
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for own, panel in zip(axes, panels):
        _draw(own, panel, places)
    for unused in axes[len(panels) :]:
        unused.axis("off")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=min(len(labels), 5), frameon=False)
    save_figure(figure, path)


def _draw(axes: "Axes", panel: Panel, places: str) -> None:
    categories = [name for series in panel.series for name in series.places if isinstance(name, str)]
    if categories:
        _points(axes, panel, list(dict.fromkeys(categories)))
    else:
        _lines(axes, panel)
    if panel.level is not None:
        axes.axhline(panel.level, color=LEVEL.web, linestyle=":")
    axes.set(xlabel=places, ylabel=panel.measure)
    if panel.logarithmic and any((series.values > 0.0).any() for series in panel.series):
        from matplotlib.ticker import LogLocator

        axes.set_yscale("log")
        axes.yaxis.set_minor_locator(LogLocator(subs=(2.0, 3.0, 5.0)))
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter("{x:g}")
    axes.grid(alpha=0.3, which="both")


def _lines(axes: "Axes", panel: Panel) -> None:
    ticks = sorted({float(place) for series in panel.series for place in series.places})
    for number, series in enumerate(panel.series):
        style, width = Style.of(number), 3.2 if series.stands_out else 1.6
        where = np.array(series.places, dtype=float)
        axes.plot(
            where,
            series.values,
            marker=style.marker,
            markersize=3.0 * width,
            linestyle=style.line,
            linewidth=width,
            color=style.colour,
            label=series.name,
        )
        axes.fill_between(where, series.low, series.high, alpha=0.12, linewidth=0, color=style.colour)
    axes.set_xscale("log", base=2)
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])


def _points(axes: "Axes", panel: Panel, categories: list[str]) -> None:
    for number, series in enumerate(panel.series):
        style = Style.of(number)
        aside = SPREAD * ((number + 0.5) / len(panel.series) - 0.5)
        where = np.array([categories.index(str(name)) for name in series.places]) + aside
        bars = np.stack([series.values - series.low, series.high - series.values])
        axes.errorbar(
            where,
            series.values,
            yerr=np.maximum(np.nan_to_num(bars), 0.0),
            fmt=style.marker,
            markersize=5,
            linewidth=1.2,
            color=style.colour,
            label=series.name,
        )
    axes.set_xticks(range(len(categories)), categories, rotation=30, ha="right")
