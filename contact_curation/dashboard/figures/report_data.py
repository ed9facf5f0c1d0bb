"""The data of a session's report and its figures: what was learned, gained and selected, and what happened on the way.

matplotlib is imported when a figure is drawn.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from contact_curation.dashboard.style import (
    BLUE,
    GREEN,
    INK,
    PALE,
    VERMILION,
    entitle,
    logarithmic,
    new_figure,
    save_figure,
)
from contact_curation.geometry.quaternions import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH, DOTS = 10.0, 110
GONE = ("died", "given up", "stopped")
"""Events that end a run of a node."""


@dataclass(frozen=True)
class ReportedThrow:
    """A throw and its outcome.

    Attributes:
        number: number from 1.
        kind: designed or exploration.
        planned: gain in log-det; None for exploration.
        realised: gain of its toss; None where it is not known.
        outcome: outcome of its toss, in words.
    """

    number: int
    kind: str
    planned: float | None
    realised: float | None
    outcome: str


@dataclass(frozen=True)
class ReportedToss:
    """A toss of the final ranking.

    Attributes:
        rank: place in the ranking, from 1.
        toss_id: unique.
        score, gain, trace: as ranked.
        selected: whether it is in the buffer.
    """

    rank: int
    toss_id: str
    score: float
    gain: float
    trace: float
    selected: bool


@dataclass(frozen=True)
class ReportedEvent:
    """Something that happened to a node.

    Attributes:
        seconds: time since the session began.
        event: started, died, restarted, given up or stopped.
        node: its name.
        detail: how.
    """

    seconds: float
    event: str
    node: str
    detail: str = ""


@dataclass(frozen=True, eq=False)
class ReportData:
    """All that the report shows.

    Attributes:
        title: one line.
        facts: name and text of each line of the summary.
        throws: in order.
        ranking: best first.
        rejected: motions that the quality checks rejected: id and reasons.
        events: events of the nodes, in order.
        seconds: how long the session took.
        errors: by name with its unit, (N,) held-out errors at the end of the rounds of training; none without held-out tosses.
        throws_then: (N,) throws that had been scored then.
        spectrum: (p,) eigenvalues of the selected set's information per toss relative to the pool's.
        epsilon: how far that spectrum reaches from 1.
    """

    title: str
    facts: Sequence[tuple[str, str]]
    throws: Sequence[ReportedThrow]
    ranking: Sequence[ReportedToss]
    rejected: Sequence[tuple[str, Sequence[str]]]
    events: Sequence[ReportedEvent]
    seconds: float
    errors: dict[str, Array] = field(default_factory=dict)
    throws_then: Array = field(default_factory=lambda: np.zeros(0))
    spectrum: Array = field(default_factory=lambda: np.zeros(0))
    epsilon: float = np.nan


def save_figures(data: ReportData, folder: Path) -> dict[str, Path]:
    """Draws what there is to draw.

    Args:
        data: data of the session.
        folder: for the PNG files.

    Returns:
        Title and file of each figure.

    Raises:
        InvalidValueError: a file cannot be written there.
    """
    drawn: dict[str, tuple[str, Callable[[ReportData], Figure]]] = {}
    if data.errors and data.throws_then.size:
        drawn["Errors on held-out tosses"] = "held_out", learning_figure
    if data.throws:
        drawn["Planned and realised gains"] = "gains", gains_figure
    if data.spectrum.size:
        drawn["Information of the selected set"] = "spectrum", spectrum_figure
    if data.events:
        drawn["Nodes"] = "nodes", nodes_figure
    return {title: save_figure(draw(data), folder / f"{name}.png") for title, (name, draw) in drawn.items()}


def learning_figure(data: ReportData) -> "Figure":
    """A panel per error, over the throws that had been scored."""
    with new_figure(WIDTH, 3.4, DOTS) as figure:
        panels = figure.subplots(1, len(data.errors), squeeze=False)[0]
        for panel, (name, values) in zip(panels, data.errors.items()):
            panel.plot(data.throws_then, values, color=BLUE.web, marker="o", markersize=4)
            panel.set(xlabel="throws scored", ylabel=name)
            panel.locator_params(axis="x", integer=True)
            if np.nanmin(values) > 0.0:
                logarithmic(panel.yaxis)
            panel.grid(alpha=0.3)
            entitle(panel, f"{name.partition(' [')[0].capitalize()}: from {values[0]:.3g} to {values[-1]:.3g}")
    return figure


def gains_figure(data: ReportData) -> "Figure":
    """Two bars per designed throw; exploration throws are marked."""
    with new_figure(WIDTH, 3.4, DOTS) as figure:
        panel = figure.subplots()
        places = np.array([throw.number for throw in data.throws], dtype=float)
        for shift, colour, label, values in (
            (-0.2, PALE.web, "planned", [throw.planned for throw in data.throws]),
            (0.2, BLUE.web, "realised", [throw.realised for throw in data.throws]),
        ):
            panel.bar(places + shift, [value or 0.0 for value in values], width=0.4, color=colour, label=label)
        exploration = [throw.number for throw in data.throws if throw.planned is None]
        if exploration:
            heights, label = [0.0] * len(exploration), "exploration: nothing planned"
            panel.plot(exploration, heights, linestyle="", marker="^", color=VERMILION.web, label=label, clip_on=False)
        panel.set(xlabel="throw", ylabel="gain in log-det [nats]", xlim=(0.3, places.max() + 0.7))
        panel.locator_params(axis="x", integer=True)
        panel.grid(alpha=0.3, axis="y")
        entitle(panel, _gains_message(data.throws), columns=3)
    return figure


def _gains_message(throws: Sequence[ReportedThrow]) -> str:
    ratios = [throw.realised / throw.planned for throw in throws if throw.planned and throw.realised is not None]
    designed = sum(throw.planned is not None for throw in throws)
    made = f"{designed} of {len(throws)} throws are designed"
    return f"{made}; they gain {np.median(ratios):.2f} of what was planned (median)" if ratios else made


def spectrum_figure(data: ReportData) -> "Figure":
    """Eigenvalues of the selected set's information per toss, relative to the pool's."""
    with new_figure(WIDTH, 3.4, DOTS) as figure:
        panel = figure.subplots()
        values = np.sort(data.spectrum)
        panel.plot(np.arange(1, values.size + 1), values, color=BLUE.web, marker="o", markersize=4, label="selected tosses")
        panel.axhline(1.0, color=INK.web, linestyle="--", label="all tosses")
        panel.set(xlabel="direction of the parameters, weakest first", ylabel="information per toss,\nall tosses = 1")
        panel.locator_params(axis="x", integer=True)
        panel.grid(alpha=0.3)
        weakest = f"Weakest direction: {values[0]:.2g} of the average information per toss"
        entitle(panel, f"{weakest} (ε = {data.epsilon:.3g})", columns=2)
    return figure


def nodes_figure(data: ReportData) -> "Figure":
    """When each node ran, and when it was started again."""
    nodes = list(dict.fromkeys(event.node for event in data.events))
    with new_figure(WIDTH, 1.3 + 0.28 * len(nodes), DOTS) as figure:
        panel = figure.subplots()
        for row, node in enumerate(nodes):
            for begin, end in _runs([event for event in data.events if event.node == node], data.seconds):
                panel.barh(row, end - begin, left=begin, height=0.5, color=GREEN.web, label="" if row else "runs")
        died = [(event.seconds, nodes.index(event.node)) for event in data.events if event.event == "died"]
        if died:
            seconds, rows = zip(*died)
            panel.plot(seconds, rows, linestyle="", marker="x", color=INK.web, markersize=8, markeredgewidth=2, label="died")
        panel.set(yticks=range(len(nodes)), yticklabels=nodes, xlabel="time [s]", xlim=(0.0, max(data.seconds, 1.0)))
        panel.invert_yaxis()
        panel.grid(alpha=0.3, axis="x")
        count = "No node died" if not died else f"Nodes died {len(died)} times" if len(died) > 1 else "One node died"
        entitle(panel, count)
    return figure


def _runs(events: Sequence[ReportedEvent], end: float) -> list[tuple[float, float]]:
    """Begin and end of each run of a node."""
    runs: list[tuple[float, float]] = []
    began: float | None = None
    for event in events:
        if event.event in GONE:
            runs += [(began, event.seconds)] if began is not None else []
            began = None
        else:
            began = event.seconds
    return runs + ([(began, end)] if began is not None else [])
