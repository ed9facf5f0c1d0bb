"""The tables and the figure of an experiment's rows."""

import csv
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from io import StringIO
from pathlib import Path

import numpy as np

from contact_curation.dashboard.figures.experiment import Panel, Series, save_experiment_figure
from contact_curation.experiments.catalogue import Experiment
from contact_curation.experiments.cell_run import Row
from contact_curation.experiments.rules import BASELINES, OURS
from contact_curation.experiments.summary import Summary, summarised
from contact_curation.experiments.thrown.cell import FIRM, RANDOM, RAW
from contact_curation.files import write_atomically
from contact_curation.learning.evaluation.bootstrap import BootstrapConfig

LEARNING = ("model", "protocol", "steps", "rule", "size", "fault", "share", "gated")
ERRORS = {
    "position": "position error [% of width]",
    "rotation": "rotation error [deg]",
    "penetration": "penetration [% of width]",
    "vertices": "vertices off the described body [mm RMS]",
    "vertices_from_all": "vertices off the full-data fit [mm RMS]",
    "friction_from_all": "friction off the full-data fit",
}
RIGID = ("rigid_position", "rigid_rotation", "rigid_penetration")
"""Errors of a polytope whose friction acts at the vertices of the gaps."""

SELECTED = ("selected_seconds", "selected_frames", "selected_bad", "gate_hits", "gate_false_alarms", "not_finite")
LEARNED = (*ERRORS, *RIGID, "position_median", "rotation_median", "friction", *SELECTED)
THROWN = {
    **{name: ERRORS[name] for name in ("position", "rotation", "penetration", "vertices")},
    "world_position": "position error in the throws' world [% of width]",
    "world_rotation": "rotation error in the throws' world [deg]",
    "friction_from_described": "friction off the described body",
}
THROWN_MORE = (
    "world_penetration",
    "landed",
    "position_median",
    "rotation_median",
    "friction",
    "designed",
    "toss",
    "seconds",
    "planned",
    "realised",
    "not_finite",
)
SIZES = "selected tosses"
ALL = "all tosses"
"""What the level of a panel is."""

RATIOS = {"sandwich": "sandwich", "cramer_rao": "Cramér-Rao", "naive": "naive"}


@dataclass(frozen=True)
class Layout:
    """How an experiment's rows are told.

    Attributes:
        fields: what makes a group of rows.
        measures: told of each.
        panels: draws them.
        places: what stands along the figure's horizontal axis.
        title: what the figure shows.
        baselines: rules that groups are compared with.
    """

    fields: tuple[str, ...]
    measures: tuple[str, ...]
    panels: Callable[[Sequence[Summary]], list[Panel]]
    places: str
    title: str
    baselines: tuple[str, ...] = BASELINES


def write_tables(experiment: Experiment, rows: Sequence[Row], folder: Path) -> tuple[Path, ...]:
    """Writes rows.csv, summary.csv and figure.png; returns their paths."""
    layout = LAYOUTS[experiment]
    summaries = summarised(rows, layout.fields, layout.measures, layout.baselines, BootstrapConfig())
    paths = (folder / "rows.csv", folder / "summary.csv", folder / "figure.png")
    write_atomically(paths[0], csv_of(rows))
    write_atomically(paths[1], csv_of([summary.as_row() for summary in summaries]))
    save_results_figure(experiment, summaries, paths[2])
    return paths


def save_results_figure(experiment: Experiment, summaries: Sequence[Summary], path: Path) -> None:
    """Draws what an experiment's rows say together into a PNG file.

    Raises:
        InvalidValueError: there is nothing to draw, or the file cannot be written.
    """
    layout = LAYOUTS[experiment]
    counts = sorted({summary.seeds for summary in summaries})
    seeds = f"{counts[0]} to {counts[-1]}" if len(counts) > 1 else f"{counts[0]}" if counts else "no"
    bounded = any(np.isfinite(summary.median.low) for summary in summaries)  # too few seeds give no interval
    title = f"{layout.title}: medians over {seeds} seeds{' with 95 % intervals' if bounded else ''}"
    save_experiment_figure(layout.panels(summaries), title, layout.places, path)


def markdown_of(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table in Markdown, with a line of heads and a line for each row."""
    return "".join(f"| {' | '.join(cells)} |\n" for cells in (heads, ["---"] * len(heads), *rows))


def csv_of(rows: Sequence[Mapping[str, float | str]]) -> bytes:
    """A CSV file with a column for each name that any row has."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    text = StringIO(newline="")
    writer = csv.DictWriter(text, names, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue().encode()


def _over_sizes(summaries: Sequence[Summary], measures: Mapping[str, str]) -> list[Panel]:
    """A line per rule; a set of all tosses, whose size is 0, is a level."""
    panels = []
    for measure, label in measures.items():
        own = [summary for summary in summaries if summary.measure == measure]
        whole = [summary.median.value for summary in own if not dict(summary.group)["size"]]
        lines = _series([summary for summary in own if dict(summary.group)["size"]], _line_name, "size")
        if lines:
            level = whole[0] if whole else None
            panels.append(Panel(label, lines, logarithmic=measure != "penetration", level=level, level_name=ALL))
    return panels


def _quality(summaries: Sequence[Summary]) -> list[Panel]:
    return _over_sizes(summaries, ERRORS)


def _theorem(summaries: Sequence[Summary]) -> list[Panel]:
    names = {"epsilon": "epsilon", "smallest": "smallest eigenvalue", "largest": "largest eigenvalue"}
    return [replace(panel, aim=float("eigenvalue" in panel.measure)) for panel in _over_sizes(summaries, names)]


def _line_name(summary: Summary) -> str:
    group = dict(summary.group)
    world = () if group.get("world", FIRM) == FIRM else ("world",)
    return ", ".join(str(group[name]) for name in ("rule", "weights", *world) if name in group)


def _throws(summaries: Sequence[Summary]) -> list[Panel]:
    """A line per way of choosing throws."""
    panels = []
    for measure, label in THROWN.items():
        lines = _series([summary for summary in summaries if summary.measure == measure], _line_name, "throws")
        if lines:
            panels.append(Panel(label, lines, logarithmic=measure != "penetration"))
    return panels


def _robustness(summaries: Sequence[Summary]) -> list[Panel]:
    """Gated pools: the clean one, then every fault; and how many of the selected are bad without the gates."""
    names = {**ERRORS, "selected_bad": "bad among the selected [share]"}
    panels = []
    for measure, label in names.items():
        gated = measure != "selected_bad"
        own = [s for s in summaries if s.measure == measure and (bool(dict(s.group)["gated"]) is gated or not _fault(s))]
        own = [s for s in own if gated or _fault(s)]
        lines = _series(own, lambda summary: str(dict(summary.group)["rule"]), _fault_name)
        if lines:
            panels.append(Panel(label if gated else f"{label}, no gates", lines, logarithmic="vertices" in measure))
    return panels


def _fault(summary: Summary) -> str:
    return str(dict(summary.group)["fault"])


def _fault_name(summary: Summary) -> str:
    share = float(dict(summary.group)["share"])
    return f"{_fault(summary)} {100.0 * share:g} %" if _fault(summary) else "clean"


def _calibration(summaries: Sequence[Summary]) -> list[Panel]:
    own = [summary for summary in summaries if summary.measure in RATIOS]
    lines = _series(own, lambda summary: RATIOS[summary.measure], lambda summary: str(dict(summary.group)["parameters"]))
    return [
        Panel("standard deviation found / predicted", lines, logarithmic=True, level=1.0, level_name="as predicted", aim=1.0)
    ]


def _series(
    summaries: Sequence[Summary], name: Callable[[Summary], str], place: str | Callable[[Summary], str]
) -> tuple[Series, ...]:
    """Summaries of one name in a line each, along their places."""
    named: dict[str, list[Summary]] = {}
    for summary in summaries:
        named.setdefault(name(summary), []).append(summary)
    return tuple(_one_series(each, own, place) for each, own in named.items())


def _one_series(name: str, own: Sequence[Summary], place: str | Callable[[Summary], str]) -> Series:
    middle, low, high = (np.array([getattr(summary.median, end) for summary in own]) for end in ("value", "low", "high"))
    ours = name.startswith(OURS)
    if callable(place):
        return Series(name, [place(summary) for summary in own], middle, low, high, ours)
    return Series(name, [float(dict(summary.group)[place]) for summary in own], middle, low, high, ours)


LAYOUTS: dict[Experiment, Layout] = {
    Experiment.DATASET_QUALITY: Layout(LEARNING, LEARNED, _quality, SIZES, "Errors after learning from selected tosses"),
    Experiment.FUNCTIONALS: Layout(LEARNING, LEARNED, _quality, SIZES, "Errors by the criterion that selects"),
    Experiment.ROBUSTNESS: Layout(
        LEARNING, LEARNED, _robustness, "fault and share of bad tosses in the pool", "Errors after learning from a faulty pool"
    ),
    Experiment.DESIGNED_THROWS: Layout(
        ("model", "protocol", "steps", "world", "restitution", "rule", "throws"),
        (*THROWN, *THROWN_MORE),
        _throws,
        "throws",
        "Errors after learning from throws",
        (RANDOM, RAW),
    ),
    Experiment.THEOREM: Layout(
        ("rule", "weights", "size"),
        ("smallest", "largest", "epsilon"),
        _theorem,
        SIZES,
        "Information of the selected set against the pool's",
    ),
    Experiment.CALIBRATION: Layout(
        ("size", "parameters", "unit"),
        ("found", *(name + end for name in RATIOS for end in ("", "_within"))),
        _calibration,
        "parameters",
        "Standard deviations found against those predicted",
    ),
}
