"""The story of a session, from its bag, its events and what offline ranking says of it."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from contact_curation.dashboard.figures.report_data import ReportData, ReportedEvent, ReportedThrow, ReportedToss
from contact_curation.geometry.quaternions import Array
from contact_curation.session.summary import Summary, summary_lines
from contact_curation.storage.bags.reader import BagReader

STATUS, REPORT = "/training_status", "/throw_report"

ERRORS = {
    "position error [% of width]": "position_error",
    "rotation error [deg]": "rotation_error",
    "held-out loss": "held_out_loss",
}
"""What a figure calls them, and what the message does."""

OF_NODES = ("started", "died", "restarted", "given up", "stopped")


def report_data_of(
    title: str, bag: Path, summary: Summary, events: Sequence[Mapping[str, Any]], ranked: Mapping[str, Any]
) -> ReportData:
    """All that is to be told.

    Args:
        title: one line.
        bag: the session's.
        summary: of the session.
        events: of the session.
        ranked: what `rank --json` said of the bag; empty where it failed.
    """
    told = summary.document
    throws_then, errors = _learning(bag)
    diagnostics = ranked.get("diagnostics", {})
    epsilon = diagnostics.get("epsilon")
    return ReportData(
        title=title,
        facts=summary_lines(told),
        throws=[
            ReportedThrow(one["number"], one["kind"], one["planned_gain"], one["realised_gain"], one["outcome"])
            for one in told["throws"]
        ],
        ranking=_ranking(ranked.get("tosses", ())),
        rejected=list(told["rejected"].items()),
        events=[
            ReportedEvent(event["time"], event["event"], event["node"], event.get("detail", ""))
            for event in events
            if event["event"] in OF_NODES
        ],
        seconds=told["seconds"],
        errors=errors,
        throws_then=throws_then,
        spectrum=np.array(diagnostics.get("spectrum", ()), dtype=float),
        epsilon=np.nan if epsilon is None else float(epsilon),
    )


def _ranking(rows: Sequence[Mapping[str, Any]]) -> list[ReportedToss]:
    ranked = sorted((row for row in rows if row["rank"] is not None), key=lambda row: int(row["rank"]))
    return [
        ReportedToss(row["rank"], row["toss_id"], row["score"], row["marginal_gain"], row["trace"], row["kept"])
        for row in ranked
    ]


def _learning(bag: Path) -> tuple[Array, dict[str, Array]]:
    """Throws that had been scored at the end of each round of training, and the held-out errors then; none without any."""
    if not bag.exists():  # it ended before anything was recorded
        return np.zeros(0), {}
    with BagReader(bag) as reader:
        known = [info.name for info in reader.topics]
        if STATUS not in known:
            return np.zeros(0), {}
        messages = list(reader.messages([name for name in (STATUS, REPORT) if name in known]))
    scored: set[str] = set()
    throws: list[int] = []
    values: dict[str, list[float]] = {name: [] for name in ERRORS}
    for one in messages:
        if one.topic == REPORT and one.message.state == "scored":
            scored.add(one.message.throw_command.throw_id)
        elif one.topic == STATUS and np.isfinite(one.message.position_error):
            throws.append(len(scored))
            for name, field in ERRORS.items():
                values[name].append(float(getattr(one.message, field)))
    return np.array(throws), {name: np.array(errors) for name, errors in values.items()} if throws else {}
