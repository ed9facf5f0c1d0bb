"""Figures of experiments: a panel per measure with its conclusion as title, a line or points per rule, with intervals.

Markers differ, too, not only colours; where there are more rules than colours, those that come again are dashed. matplotlib is
imported when a picture is drawn.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from contact_curation.dashboard.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    LEVEL,
    ORANGE,
    PURPLE,
    SKY_BLUE,
    VERMILION,
    entitle,
    logarithmic,
    new_figure,
    save_figure,
)
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = (BLACK, GREY, ORANGE, PURPLE, SKY_BLUE, GREEN, BLUE)
OWN_COLOUR = VERMILION
"""Colour of the series that stands out."""

MARKERS = "os^vDP*Xhp<>"
LINES = ("-", "--", ":")
WIDTH, HEIGHT, DOTS = 5.0, 4.2, 110
COLUMNS, LEGEND_COLUMNS = 3, 5
LETTERS = 50
"""Characters in a line of the figure's title, for each panel below it."""

SPREAD = 0.6
"""Share of the width between two categories that the points of all series take."""

MANY_CATEGORIES = 8
"""More have their names upright."""

OCTAVES = 0.16
"""That the points of all series at one number take, so that no interval hides another."""


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

    @property
    def drawn(self) -> "Series":
        """The same along rising numbers; categories stay as they are."""
        if any(isinstance(place, str) for place in self.places):
            return self
        order = np.argsort(np.asarray(self.places, dtype=float), kind="stable")
        parts = (self.values[order], self.low[order], self.high[order])
        return Series(self.name, [float(self.places[k]) for k in order], *parts, self.stands_out)


class Style(NamedTuple):
    """How the series of a number, from 0 on, is drawn; no two of the first dozen are alike, nor as one that stands out."""

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
        measure: measure with its unit.
        series: at least one.
        logarithmic: whether the measure's axis is.
        level: to compare with, if there is one.
        level_name: what that is.
        aim: the value that would be best.
    """

    measure: str
    series: tuple[Series, ...]
    logarithmic: bool = False
    level: float | None = None
    level_name: str = ""
    aim: float = 0.0


def save_experiment_figure(panels: Sequence[Panel], title: str, places: str, path: Path) -> None:
    """Draws panels into a PNG file.

    Args:
        panels: at least one, all over numbers or all over categories.
        title: one line.
        places: what stands along the horizontal axis.
        path: path of the file.

    Raises:
        InvalidValueError: there is nothing to draw, or the file cannot be written there.
    """
    if not panels or not all(panel.series for panel in panels):
        raise InvalidValueError("panels of the figure", "none, or an empty one", "at least one with a series")
    styles = _styles(panels)
    columns = min(COLUMNS, len(panels))
    rows = -(-len(panels) // columns)
    with new_figure(WIDTH * columns, HEIGHT * rows, DOTS) as figure:
        figure.suptitle("\n".join(wrap(title, LETTERS * columns)), fontsize=13)
        axes = figure.subplots(rows, columns, squeeze=False).ravel()
        for own, panel in zip(axes, panels):
            _draw(own, panel, places, styles)
        handles = {name: handle for own in axes for handle, name in zip(*own.get_legend_handles_labels())}
        for unused in axes[len(panels) :]:
            unused.axis("off")
        if len(panels) < axes.size:
            axes[-1].legend(handles.values(), handles.keys(), loc="center", fontsize=12)
        else:
            columns = min(len(handles), LEGEND_COLUMNS)
            figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=columns)
        save_figure(figure, path)


def _styles(panels: Sequence[Panel]) -> dict[str, Style]:
    """Style of each series by its name, the same in all panels."""
    names = {one.name: one.stands_out for panel in panels for one in panel.series}
    others = [name for name, stands_out in names.items() if not stands_out]
    own = Style(OWN_COLOUR.web, "o", "-")
    return {name: own if stands_out else Style.of(others.index(name)) for name, stands_out in names.items()}


def _draw(axes: "Axes", panel: Panel, places: str, styles: Mapping[str, Style]) -> None:
    series = [one.drawn for one in panel.series]
    categories = list(dict.fromkeys(place for one in series for place in one.places if isinstance(place, str)))
    if panel.level is not None:
        axes.axhline(panel.level, color=LEVEL.web, linestyle=":", label=panel.level_name or None)
    for number, one in enumerate(series):
        aside = (number + 0.5) / len(series) - 0.5
        if categories:
            where = np.array([categories.index(str(place)) for place in one.places]) + SPREAD * aside
            _draw_series(axes, one, styles[one.name]._replace(line=""), where)
        else:
            _draw_series(axes, one, styles[one.name], np.array(one.places, dtype=float) * 2.0 ** (OCTAVES * aside))
    if categories:
        many = len(categories) > MANY_CATEGORIES
        axes.set_xticks(range(len(categories)), categories, rotation=90 if many else 30, ha="center" if many else "right")
    else:
        ticks = sorted({float(place) for one in series for place in one.places})
        axes.set_xscale("log", base=2)
        axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        axes.minorticks_off()
    axes.set(xlabel=places, ylabel=panel.measure)
    if panel.logarithmic and any((one.values > 0.0).any() for one in series):
        logarithmic(axes.yaxis)
    axes.grid(alpha=0.3)
    entitle(axes, _message(panel))


def _draw_series(axes: "Axes", series: Series, style: Style, where: Array) -> None:
    """Medians with their intervals, joined by a line over numbers."""
    bars = np.stack([series.values - series.low, series.high - series.values])
    axes.errorbar(
        where,
        series.values,
        yerr=np.maximum(np.nan_to_num(bars), 0.0),
        marker=style.marker,
        markersize=7 if series.stands_out else 5,
        linestyle=style.line,
        linewidth=2.8 if series.stands_out else 1.3,
        elinewidth=1.6 if series.stands_out else 0.8,
        color=style.colour,
        label=series.name,
        zorder=3 if series.stands_out else 2,
    )


def _message(panel: Panel) -> str:
    """Which series is best most often, and at how many points."""
    name = panel.measure.partition(" [")[0].capitalize()
    if len(panel.series) == 1:
        return f"{name}\nof {panel.series[0].name}"
    at: dict[float | str, list[tuple[float, str]]] = {}
    for one in panel.series:
        places: list[float | str] = [*one.places]
        for place, value in zip(places, one.values):
            if np.isfinite(value):
                at.setdefault(place, []).append((abs(float(value) - panel.aim), one.name))
    shared = [min(found)[1] for found in at.values() if len(found) == len(panel.series)] or [min(f)[1] for f in at.values()]
    winner, wins = Counter(shared).most_common(1)[0] if shared else (panel.series[0].name, 0)
    best = "lowest" if panel.aim == 0.0 else f"nearest to {panel.aim:g}"
    return f"{name}:\n{best} for {winner} at {wins} of {len(shared)} points"
