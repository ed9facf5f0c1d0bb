"""What a recorded session leaves behind: its bag ranked offline, its figures, its report, and a summary of all."""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from platform import platform
from typing import Any

import numpy as np

from contact_curation.dashboard.figures.report_data import ReportData, ReportedEvent, ReportedThrow, ReportedToss, save_figures
from contact_curation.dashboard.figures.session_report import save_report
from contact_curation.design.throw import ThrowState
from contact_curation.errors import ContactCurationError
from contact_curation.files import write_atomically
from contact_curation.geometry.quaternions import Array
from contact_curation.pipeline.ranked import RankedTosses
from contact_curation.pipeline.ranking import rank_tosses
from contact_curation.pipeline.wording import json_line
from contact_curation.session.config import SessionConfig, SessionFolder
from contact_curation.session.events import EventLog
from contact_curation.session.offline_ranking import offline_ranking, rank_command
from contact_curation.session.parameter_files import Parameters
from contact_curation.session.summary import Replay, SessionSummary
from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.manifest.manifest import ManifestRow
from contact_curation.version import __version__

STATUS, REPORT = "/training_status", "/throw_report"

ERRORS = {
    "position error [% of width]": "position_error",
    "rotation error [deg]": "rotation_error",
    "held-out loss": "held_out_loss",
}
"""What a figure calls them, and what the message does."""

OF_NODES = ("started", "died", "restarted", "given up", "stopped")


def finish_record(
    config: SessionConfig,
    folder: SessionFolder,
    parameters: Mapping[str, Parameters],
    command: tuple[str, ...],
    summary: SessionSummary,
    events: EventLog,
) -> SessionSummary:
    """Ranks the bag and writes what belongs in the folder.

    Returns:
        The summary, with where things lie and whether offline ranking gives the session's own.
    """
    ranked, replayed = _replayed(config, folder, parameters, summary)
    summary = replace(summary, replay=replayed, folder=str(folder.root))
    data = report_data(folder.bag, summary, events.events, ranked)
    figures = save_figures(data, folder.figures)
    if ranked:
        figures["Ranking"] = folder.ranking_figure
    save_report(data, figures, folder.report)
    summary = replace(summary, report=str(folder.report))
    own = {
        "format_version": 1,
        "command": list(command),
        "rank_command": rank_command(config, folder, parameters),
        "version": __version__,
        "python": sys.version.split()[0],
        "platform": platform(),
        "parameters": parameters,
        "summary": summary.document(),
    }
    write_atomically(folder.summary, (json_line(own) + "\n").encode())
    return summary


def report_data(
    bag: Path, summary: SessionSummary, events: Sequence[Mapping[str, Any]], ranked: RankedTosses | None
) -> ReportData:
    """All that is reported.

    Args:
        bag: the session's.
        summary: of the session.
        events: of the session.
        ranked: the ranking of the bag; None where it failed.
    """
    learning = _learning(bag)
    evidence = ranked.evidence() if ranked else None
    return ReportData(
        title=f"Session of {len(summary.throws)} throws",
        facts=summary.facts(),
        throws=[
            ReportedThrow(one.number, one.kind, one.planned_gain, one.realised_gain, one.outcome) for one in summary.throws
        ],
        ranking=_ranking(ranked.ranked_rows if ranked else ()),
        rejected=list(summary.rejected.items()),
        events=[
            ReportedEvent(event["time"], event["event"], event["node"], event.get("detail", ""))
            for event in events
            if event["event"] in OF_NODES
        ],
        seconds=summary.seconds,
        errors=learning.errors,
        throws_then=learning.throws_then,
        spectrum=evidence.spectrum if evidence else np.zeros(0),
        epsilon=evidence.epsilon if evidence else np.nan,
    )


@dataclass(frozen=True, eq=False)
class _Learning:
    """Held-out errors at the ends of the rounds of training, and how many throws had been scored then; none without any."""

    throws_then: Array
    errors: dict[str, Array]


def _replayed(
    config: SessionConfig, folder: SessionFolder, parameters: Mapping[str, Parameters], summary: SessionSummary
) -> tuple[RankedTosses | None, Replay]:
    """The ranking of the session's bag, None where there is none; and whether it is the session's own."""
    try:
        ranked = rank_tosses([folder.bag], offline_ranking(config, config.body(), folder, parameters))
        ranked.evidence()  # refuses where nothing was ranked
        ranked.save(folder.manifest, overwrite=True)  # of this session
        ranked.save_figure(folder.ranking_figure, overwrite=True)
    except (ContactCurationError, MemoryError) as error:
        return None, Replay(False, f"the bag could not be ranked: {str(error) or 'found too little memory'}")
    selected = ranked.selected_ids
    same = selected == summary.selected
    if same:
        what = f"rank gives the same {len(selected)} tosses in the same order"
    elif summary.settled:
        lacking = [name for name in summary.selected if name not in ranked.ids]
        why = "as after a kill of this command or with parameters that were changed on the way"
        cut = f"; it finds no sound toss {', '.join(lacking)} in the bag, {why}" if lacking else ""
        what = f"rank gives other tosses than the session: {', '.join(selected)}{cut}"
    else:
        what = (
            "the session was interrupted before its last tosses were scored and trained on, so that its selection is not the "
            f"final one; rank selects {', '.join(selected)}"
        )
    return ranked, Replay(same, what, str(folder.manifest))


def _ranking(rows: Sequence[ManifestRow]) -> list[ReportedToss]:
    return [
        ReportedToss(row.rank, row.toss_id, row.score or 0.0, row.marginal_gain or 0.0, row.trace or 0.0, row.selected)
        for row in rows
        if row.rank is not None  # all ranked ones have numbers
    ]


def _learning(bag: Path) -> _Learning:
    """From the messages of the bag."""
    nothing = _Learning(np.zeros(0), {})
    if not bag.exists():  # it ended before anything was recorded
        return nothing
    with BagReader(bag) as reader:
        known = [info.name for info in reader.topics]
        messages = list(reader.messages([name for name in (STATUS, REPORT) if name in known])) if STATUS in known else []
    scored: set[str] = set()
    throws: list[int] = []
    values: dict[str, list[float]] = {name: [] for name in ERRORS}
    for one in messages:
        if one.topic == REPORT and one.message.state == ThrowState.SCORED:
            scored.add(one.message.throw_command.throw_id)
        elif one.topic == STATUS and np.isfinite(one.message.position_error):
            throws.append(len(scored))
            for name, field in ERRORS.items():
                values[name].append(float(getattr(one.message, field)))
    return _Learning(np.array(throws), {name: np.array(errors) for name, errors in values.items()}) if throws else nothing
