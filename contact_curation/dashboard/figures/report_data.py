"""The data of a session's report and its figures: what was learned, gained and selected, and what happened on the way.

matplotlib is imported when a figure is drawn.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from contact_curation.dashboard.style import BLUE, GREEN, INK, PALE, VERMILION, save_figure
from contact_curation.geometry.quaternions import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH, DOTS = 10.0, 110
GONE = ("died", "given up", "stopped")
"""Events that end a run of a node."""


@dataclass(frozen=True)
class ReportedThrow:
    """A throw and what came of it.

    Attributes:
        number: from 1.
        kind: designed or exploration.
        planned: gain in log-det; None for exploration.
        realised: gain of its toss; None where it is not known.
        outcome: of its toss, in words.
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
        rank: from 1.
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
        seconds: since the session began.
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
        rejected: motions that the gates rejected: id and reasons.
        events: of the nodes, in order.
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
        data: of the session.
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
    figure = _figure(3.2)
    panels = figure.subplots(1, len(data.errors), squeeze=False)[0]
    for panel, (name, values) in zip(panels, data.errors.items()):
        panel.plot(data.throws_then, values, color=BLUE.web, marker="o", markersize=4)
        panel.set(yscale="log", xlabel="throws scored", ylabel=name)
        panel.grid(alpha=0.3, which="both")
    return figure


def gains_figure(data: ReportData) -> "Figure":
    """Two bars per designed throw; exploration throws are marked."""
    figure = _figure(3.2)
    panel = figure.subplots()
    places = np.array([throw.number for throw in data.throws], dtype=float)
    for shift, colour, label, values in (
        (-0.2, PALE.web, "planned", [throw.planned for throw in data.throws]),
        (0.2, BLUE.web, "realised", [throw.realised for throw in data.throws]),
    ):
        panel.bar(places + shift, [value or 0.0 for value in values], width=0.4, color=colour, label=label)
    exploration = [throw.number for throw in data.throws if throw.planned is None]
    panel.plot(
        exploration, [0.0] * len(exploration), linestyle="", marker="^", color=VERMILION.web, label="exploration", clip_on=False
    )
    panel.set(xlabel="throw", ylabel="gain in log-det [nats]")
    panel.legend(frameon=False)
    panel.grid(alpha=0.3, axis="y")
    return figure


def spectrum_figure(data: ReportData) -> "Figure":
    """Eigenvalues of the selected set's information per toss, relative to the pool's."""
    figure = _figure(3.2)
    panel = figure.subplots()
    panel.plot(np.arange(1, data.spectrum.size + 1), np.sort(data.spectrum)[::-1], color=BLUE.web, marker="o", markersize=4)
    panel.axhline(1.0, color=INK.web, linestyle=":", label="as the pool")
    ratio = "information per toss,\nselected set / pool"
    panel.set(xlabel="direction of theta", ylabel=ratio, title=f"epsilon {data.epsilon:.3g}")
    panel.legend(frameon=False)
    panel.grid(alpha=0.3)
    return figure


def nodes_figure(data: ReportData) -> "Figure":
    """When each node ran, and when it was started again."""
    nodes = list(dict.fromkeys(event.node for event in data.events))
    figure = _figure(0.9 + 0.28 * len(nodes))
    panel = figure.subplots()
    for row, node in enumerate(nodes):
        for begin, end in _runs([event for event in data.events if event.node == node], data.seconds):
            panel.barh(row, end - begin, left=begin, height=0.5, color=GREEN.web)
        deaths = [event.seconds for event in data.events if event.node == node and event.event == "died"]
        panel.plot(deaths, [row] * len(deaths), linestyle="", marker="x", color=INK.web, markersize=8, markeredgewidth=2)
    panel.set(yticks=range(len(nodes)), yticklabels=nodes, xlabel="time [s]", xlim=(0.0, max(data.seconds, 1.0)))
    panel.invert_yaxis()
    panel.grid(alpha=0.3, axis="x")
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


def _figure(height: float) -> "Figure":
    from matplotlib.figure import Figure

    return Figure(figsize=(WIDTH, height), dpi=DOTS, layout="constrained")
