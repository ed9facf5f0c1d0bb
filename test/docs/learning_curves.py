"""The picture of learning through the nodes in docs/explanation/learning.md: held-out errors while tosses come in.

One panel per error, one colour per way of choosing what is trained on. Thin lines are single runs, thick ones their median.
Each panel says what the medians end at.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from contact_curation.dashboard.style import (
    BLACK,
    BLUE,
    GREEN,
    LEVEL,
    ORANGE,
    PURPLE,
    SKY_BLUE,
    VERMILION,
    Colour,
    entitle,
    logarithmic,
    new_figure,
    save_figure,
)
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = (BLUE, VERMILION, GREEN, PURPLE, SKY_BLUE, ORANGE, BLACK)
WIDTH, HEIGHT, DOTS = 14.0, 5.2, 110


@dataclass(frozen=True, eq=False)
class Curve:
    """One run.

    Attributes:
        tosses: (N,) recorded so far, not decreasing.
        errors: by name of the error with its unit, (N,) values; the same names in all curves of a figure.
    """

    tosses: Array
    errors: Mapping[str, Array]


def save_learning_curves(
    runs: Mapping[str, Sequence[Curve]], title: str, path: Path, floors: Mapping[str, float] | None = None
) -> None:
    """Draws curves into a PNG file.

    Args:
        runs: by what chose the tosses, at least one curve each.
        title: one line.
        path: path of the file.
        floors: by name of the error, a level to compare with, such as that of the true parameters.

    Raises:
        InvalidValueError: there is no curve, or the file cannot be written there.
    """
    if not runs or not all(runs.values()):
        raise InvalidValueError("learning curves", "none", "at least one of each kind")
    names = list(next(iter(runs.values()))[0].errors)
    with new_figure(WIDTH, HEIGHT, DOTS) as figure:
        figure.suptitle(title, fontsize=13)
        panels = figure.subplots(1, len(names), squeeze=False)[0]
        for panel, name in zip(panels, names):
            ends = [_draw(panel, colour, label, curves, name) for colour, (label, curves) in zip(COLOURS, runs.items())]
            if floors and name in floors:
                panel.axhline(floors[name], color=LEVEL.web, linestyle=":", label="true cube")
            panel.set(xlabel="tosses recorded", ylabel=name)
            logarithmic(panel.yaxis)
            panel.grid(alpha=0.3)
            reached = f"{min(ends):.3g} to {max(ends):.3g}" if f"{min(ends):.3g}" != f"{max(ends):.3g}" else f"{ends[0]:.3g}"
            entitle(panel, f"{name.partition(' [')[0].capitalize()} ends at {reached}")
        lines, names = panels[0].get_legend_handles_labels()
        figure.legend(lines, names, loc="outside lower center", ncols=len(names))
        save_figure(figure, path)


def _draw(panel: "Axes", colour: Colour, label: str, curves: Sequence[Curve], name: str) -> float:
    """Single runs thin, their median thick; returns what the median ends at."""
    for curve in curves:
        panel.step(curve.tosses, curve.errors[name], where="post", color=colour.web, alpha=0.25, linewidth=1.0)
    places, middle = _median(curves, name)
    panel.step(places, middle, where="post", color=colour.web, linewidth=2.4, label=label)
    return float(middle[-1])


def _median(curves: Sequence[Curve], name: str) -> tuple[Array, Array]:
    """Places, and the median over the curves there, of those that have begun."""
    places = np.unique(np.concatenate([curve.tosses for curve in curves]))
    at = [np.searchsorted(curve.tosses, places, side="right") - 1 for curve in curves]
    values = np.stack([np.where(k < 0, np.nan, curve.errors[name][k]) for k, curve in zip(at, curves)])
    return places, np.nanmedian(values, axis=0)
