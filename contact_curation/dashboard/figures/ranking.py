"""One picture of a ranking: what the tosses are worth, what was selected, and how far the selected set stands for the pool.

matplotlib is imported when a picture is drawn.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from contact_curation.dashboard.style import (
    BLUE,
    INK,
    PALE,
    VERMILION,
    entitle,
    logarithmic,
    new_figure,
    plain_number,
    save_figure,
)
from contact_curation.geometry.quaternions import Array
from contact_curation.information.ranker import criterion_named

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SELECTED, OTHER, WARNING, LINE = BLUE.web, PALE.web, VERMILION.web, INK.web
WIDTH, HEIGHT, DOTS = 16.0, 10.0, 100
BINS = 60
FEWEST_BARS = 5
"""Room for so many bars, that a few do not become blocks."""

LABEL_WIDTH = 20
"""Letters in a line of a long label."""

ASINH_TICKS = 7
"""Largest number of ticks on an axis that is linear only about zero."""

LARGEST_LINEAR_RATIO = 50.0
"""Scores that differ by more are drawn on a logarithmic axis."""


@dataclass(frozen=True, eq=False)
class RankingPicture:
    """What the figure shows.

    Attributes:
        title: one line.
        criterion: criterion of the ranking.
        scores: (K,) of all ranked tosses, best first.
        gains: (K,) marginal gains, likewise.
        selected: how many are selected.
        spectrum: (p,) eigenvalues of the selected set's information per toss relative to the pool's.
        epsilon: how far that spectrum reaches from 1 (method.md 1.9).
        shares: by block of parameters, its share of the trace in the pool and in the selected set.
        outcomes: how many tosses went which way, in the order they are listed; only the first is drawn as selected.
    """

    title: str
    criterion: str
    scores: Array
    gains: Array
    selected: int
    spectrum: Array
    epsilon: float
    shares: Mapping[str, tuple[float, float]]
    outcomes: Sequence[tuple[str, int]]


def save_ranking_figure(picture: RankingPicture, path: Path) -> None:
    """Draws the picture into a PNG file of 1600 x 1000 dots.

    Raises:
        InvalidValueError: `path` cannot be written.
    """
    save_figure(ranking_figure(picture), path)


def ranking_figure(picture: RankingPicture) -> "Figure":
    """The picture as a matplotlib figure, for notebooks."""
    with new_figure(WIDTH, HEIGHT, DOTS) as figure:
        figure.get_layout_engine().set(w_pad=0.12, h_pad=0.14, wspace=0.03, hspace=0.04)  # type: ignore[union-attr, call-arg]
        figure.suptitle(picture.title, fontsize=15)
        rows: Any = figure.subfigures(2, 1)  # figures of their own, so that long labels below take no room above
        scores, gains = _row(rows[0], [1.5, 1.0])
        spectrum, *shares, outcomes = _row(rows[1], [1.0, 1.0, 0.9] if picture.shares else [1.0, 0.9])
        _draw_scores(scores, picture)
        _draw_gains(gains, picture)
        _draw_spectrum(spectrum, picture)
        for axes in shares:
            _draw_shares(axes, picture)
        _draw_outcomes(outcomes, picture)
    return figure


def _row(figure: Any, widths: list[float]) -> "list[Axes]":
    return list(figure.subplots(1, len(widths), width_ratios=widths))


def _draw_scores(axes: "Axes", picture: RankingPicture) -> None:
    """A histogram; the selected tosses' part of each bar in colour."""
    from matplotlib.ticker import AsinhLocator

    scores = picture.scores
    width = _linear_width(scores)
    low, high = float(scores.min()), float(scores.max())
    if low == high:
        low, high = low - 0.5, high + 0.5
    spread = low > 0.0 and high > LARGEST_LINEAR_RATIO * low
    if spread:
        edges = np.geomspace(low, high, BINS + 1)
    elif width:
        edges = width * np.sinh(np.linspace(np.arcsinh(low / width), np.arcsinh(high / width), BINS + 1))
        axes.set_xscale("asinh", linear_width=width)
        axes.xaxis.set_major_locator(AsinhLocator(width, numticks=ASINH_TICKS))
        axes.xaxis.set_major_formatter(plain_number)
    else:
        edges = np.linspace(low, high, BINS + 1)
    edges[0], edges[-1] = low, high
    count = picture.selected
    axes.hist(
        [scores[:count], scores[count:]],
        bins=edges.tolist(),
        stacked=True,
        color=[SELECTED, OTHER],
        label=["selected", "not selected"],
    )
    if spread:
        logarithmic(axes.xaxis)
    axes.locator_params(axis="y", integer=True)
    axes.set(xlabel=criterion_named(picture.criterion).axis_label(), ylabel="tosses")
    highest = int((np.argsort(-scores, kind="stable")[:count] < count).sum())
    among = f"{highest} of the {count} selected tosses are among the {count} with the highest scores by themselves"
    entitle(axes, among if count < scores.size else f"All {count} tosses are selected; their scores by themselves", columns=2)


def _linear_width(scores: Array) -> float:
    """About zero, where scores of both signs are drawn by their logarithms outside of it; 0 where they need not be."""
    sizes = np.abs(scores)
    typical = float(np.median(sizes))
    return typical if scores.min() < 0.0 and float(sizes.max()) > LARGEST_LINEAR_RATIO * typical else 0.0


def _draw_gains(axes: "Axes", picture: RankingPicture) -> None:
    """What each selected toss added when it was picked, and what the best of the others would still add."""
    selected, others = picture.gains[: picture.selected], picture.gains[picture.selected :]
    axes.bar(np.arange(1, selected.size + 1), selected, color=SELECTED, width=0.85, label="selected, when it was picked")
    if others.size:
        axes.axhline(float(others.max()), color=WARNING, linestyle="--", label="best of the not selected, now")
    axes.set(
        xlabel="place in the selected set",
        ylabel=criterion_named(picture.criterion).axis_label("gain"),
        xlim=(0.3, selected.size + 0.7),
    )
    if selected.min() > 0.0 and selected.max() > LARGEST_LINEAR_RATIO * selected.min():
        logarithmic(axes.yaxis)
    axes.locator_params(axis="x", integer=True)
    first, last = (plain_number(float(f"{gain:.3g}")) for gain in (selected[0], selected[-1]))
    entitle(axes, f"The first selected toss adds {first}, the last one {last}", columns=2)


def _draw_outcomes(axes: "Axes", picture: RankingPicture) -> None:
    """Draws the outcomes of all recorded motions."""
    names = [fill(name, LABEL_WIDTH) for name, _ in picture.outcomes]
    counts = [count for _, count in picture.outcomes]
    colours = [SELECTED, OTHER, *[WARNING] * len(names)][: len(names)]
    bars = axes.barh(names, counts, color=colours)
    axes.bar_label(bars, padding=4)
    axes.set_ylim(max(len(names), FEWEST_BARS) - 0.5, -0.5)
    axes.set(xlabel="tosses", xlim=(0, 1.15 * max([*counts, 1])))
    axes.locator_params(axis="x", integer=True)
    rejected, every = sum(counts[2:]), sum(counts)
    entitle(axes, f"{rejected} of {every} tosses are rejected" if rejected else f"None of {every} tosses is rejected")


def _draw_spectrum(axes: "Axes", picture: RankingPicture) -> None:
    """Information of a selected toss in each direction; an average toss of the pool has 1."""
    values = np.sort(picture.spectrum)
    shown = values[values > 0.0]  # a logarithmic axis has no place for nothing
    places = np.arange(values.size - shown.size, values.size) + 1
    axes.plot(places, shown, "o-", color=SELECTED, markersize=4, label="selected tosses")
    axes.axhline(1.0, color=LINE, linewidth=1.0, linestyle="--", label="all tosses")
    if shown.size:
        logarithmic(axes.yaxis)
    axes.set(xlabel="direction of the parameters, weakest first", ylabel="information per toss, all tosses = 1")
    weakest = f"{values[0]:.2g}" if values.size else "no"
    entitle(axes, f"Weakest direction: {weakest} of the average\ninformation per toss (ε = {picture.epsilon:.3g})", columns=2)


def _draw_shares(axes: "Axes", picture: RankingPicture) -> None:
    """Which parameters the information is about; one block over one half is a warning."""
    names = [name.replace("_", " ") for name in picture.shares]
    places = np.arange(len(names))
    pool, selected = (100.0 * np.array([share[i] for share in picture.shares.values()]) for i in (0, 1))
    bars = [
        axes.barh(places - 0.2, selected, 0.38, color=SELECTED, label="selected tosses"),
        axes.barh(places + 0.2, pool, 0.38, color=OTHER, label="all tosses"),
    ]
    for each in bars:
        axes.bar_label(each, fmt="%.1f", padding=3, fontsize=10)
    axes.set_yticks(places, names)
    axes.invert_yaxis()
    axes.set(xlabel="share of the information's trace [%]", xlim=(0, 112))
    most = int(np.argmax(selected))
    entitle(axes, f"The information of the selected tosses\nis {selected[most]:.0f} % about {names[most]}", columns=2)
