"""What a recorded session leaves behind: its bag ranked offline, its figures, its report, and a summary of all."""

import json
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from platform import platform
from typing import Any

import numpy as np

from contact_curation.configs import ConfigField, fields_of
from contact_curation.contact.loss_config import DEFAULT_LOSS
from contact_curation.dashboard.figures.report_data import ReportData, ReportedEvent, ReportedThrow, ReportedToss, save_figures
from contact_curation.dashboard.figures.session_report import save_report
from contact_curation.design.throw import ThrowState
from contact_curation.files import write_atomically
from contact_curation.geometry.quaternions import Array
from contact_curation.information.ranker import RankingConfig
from contact_curation.information.scoring import ScoringConfig
from contact_curation.motion.calibration import NO_CORRECTION
from contact_curation.motion.gates import GateConfig
from contact_curation.motion.segmenter_config import SegmenterConfig
from contact_curation.pipeline.wording import json_line
from contact_curation.session.config import SessionConfig, SessionFolder
from contact_curation.session.events import EventLog
from contact_curation.session.parameter_files import Parameters
from contact_curation.session.summary import Replay, SessionSummary
from contact_curation.session.supervisor import ProgramFailedError
from contact_curation.stages.curation import CurationConfig
from contact_curation.stages.parameters import as_parameter, with_parameters
from contact_curation.stages.selection import ranking_for
from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.inputs.pose_source import PoseTopicConfig
from contact_curation.version import __version__

NAME = "contact-curation"

RANKING_OPTIONS, SCORING_OPTIONS = ("criterion", "top", "seed", "variant"), ("estimator", "form", "influence_bound")
"""Fields of the ranking and of the scoring that `rank` has options of the same names for."""

POSE_OPTIONS = ("body_frame", "board_frame", "tag_map")
"""Likewise of the pose topics, where they are not empty."""

ELSEWHERE = ("gravity", "threads", "topic")
"""Last names of fields that are the body's, of no consequence for digits, or the recording's."""

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
    figure = folder.figures / "ranking.png"
    words = rank_command(folder, parameters, config.body_file, figure)
    ranked, replayed = _replayed(words, summary)
    summary = replace(summary, replay=replayed, folder=str(folder.root))
    data = report_data(folder.bag, summary, events.events, ranked)
    figures = save_figures(data, folder.figures)
    if ranked:
        figures["Ranking"] = figure
    save_report(data, figures, folder.report)
    summary = replace(summary, report=str(folder.report))
    own = {
        "format_version": 1,
        "command": list(command),
        "rank_command": words,
        "version": __version__,
        "python": sys.version.split()[0],
        "platform": platform(),
        "parameters": parameters,
        "summary": summary.document(),
    }
    write_atomically(folder.summary, (json_line(own) + "\n").encode())
    return summary


def rank_command(
    folder: SessionFolder, parameters: Mapping[str, Parameters], body_file: Path | None, figure: Path
) -> list[str]:
    """The command that gives a session's own final ranking from its bag: what its nodes were told, as options.

    Args:
        folder: of the session.
        parameters: of its nodes.
        body_file: describes the body; None for ContactNets' cube.
        figure: that it draws.
    """
    ingest, scorer, curator = (parameters[node] for node in ("pose_ingest", "fisher_scorer", "curator"))
    ranking = ranking_for(with_parameters(CurationConfig(), curator).selection, with_parameters(RankingConfig(), curator))
    scoring = with_parameters(ScoringConfig(), scorer)
    words = [NAME, "rank", str(folder.bag), "--out", str(folder.manifest), "--figure", str(figure)]
    words += ["--body", str(body_file)] if body_file else []
    words += ["--params", str(folder.checkpoint)] if folder.checkpoint.exists() else []
    words += _options(ranking, RankingConfig(), RANKING_OPTIONS, curator)
    words += _options(scoring, ScoringConfig(), SCORING_OPTIONS, scorer)
    words += [word for name in POSE_OPTIONS if ingest.get(name) for word in (_option(name), str(ingest[name]))]
    words += _settings("segmenter", with_parameters(SegmenterConfig(), ingest, "segmenter."), SegmenterConfig())
    words += _settings("rig", with_parameters(NO_CORRECTION, ingest, "rig."), NO_CORRECTION)
    words += _settings("gates", with_parameters(GateConfig(), ingest, "gates."), GateConfig())
    words += _settings("poses", with_parameters(PoseTopicConfig(), ingest), PoseTopicConfig(), POSE_OPTIONS)
    words += _settings("loss", scoring.loss, DEFAULT_LOSS)
    words += _settings("ranking", ranking, RankingConfig(), RANKING_OPTIONS)
    return words


def verb_output(*words: str) -> str:
    """What a command of ours prints on its standard output.

    Raises:
        ProgramFailedError: it fails; with its error.
    """
    command = [sys.executable, "-m", "contact_curation.cli.main", *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise ProgramFailedError(done.stderr.strip().rpartition("\n")[2].removeprefix(f"{NAME}: error: "))
    return done.stdout


def report_data(
    bag: Path, summary: SessionSummary, events: Sequence[Mapping[str, Any]], ranked: Mapping[str, Any]
) -> ReportData:
    """All that is reported.

    Args:
        bag: the session's.
        summary: of the session.
        events: of the session.
        ranked: what `rank --json` said of the bag; empty where it failed.
    """
    learning = _learning(bag)
    diagnostics = ranked.get("diagnostics", {})
    epsilon = diagnostics.get("epsilon")
    return ReportData(
        title=f"Session of {len(summary.throws)} throws",
        facts=summary.facts(),
        throws=[
            ReportedThrow(one.number, one.kind, one.planned_gain, one.realised_gain, one.outcome) for one in summary.throws
        ],
        ranking=_ranking(ranked.get("tosses", ())),
        rejected=list(summary.rejected.items()),
        events=[
            ReportedEvent(event["time"], event["event"], event["node"], event.get("detail", ""))
            for event in events
            if event["event"] in OF_NODES
        ],
        seconds=summary.seconds,
        errors=learning.errors,
        throws_then=learning.throws_then,
        spectrum=np.array(diagnostics.get("spectrum", ()), dtype=float),
        epsilon=np.nan if epsilon is None else float(epsilon),
    )


@dataclass(frozen=True, eq=False)
class _Learning:
    """Held-out errors at the ends of the rounds of training, and how many throws had been scored then; none without any."""

    throws_then: Array
    errors: dict[str, Array]


def _options(config: Any, default: Any, names: Sequence[str], given: Parameters) -> Iterator[str]:
    """Options of those fields that were given, or are not as they are by default."""
    standard = {field.path: field for field in fields_of(default)}
    for field in fields_of(config):
        if field.path in names and (field.path in given or field != standard[field.path]) and field.default != float("inf"):
            yield from (_option(field.path), _text(field))


def _settings(stage: str, config: Any, default: Any, optional: Sequence[str] = ()) -> Iterator[str]:
    """`--set` for each field that is not as it is by default, but for those that are optional of their own."""
    for field, standard in zip(fields_of(config), fields_of(default)):
        if field != standard and field.path not in optional and field.path.rpartition(".")[2] not in ELSEWHERE:
            yield from ("--set", f"{stage}.{field.path}={_text(field)}")


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _text(field: ConfigField) -> str:
    """A field's value as it would be given."""
    if field.default is None:
        return "none"
    value = as_parameter(field.default)
    return ",".join(map(str, value)) if isinstance(value, list) else str(value)


def _replayed(words: Sequence[str], summary: SessionSummary) -> tuple[dict[str, Any], Replay]:
    """What `rank` says of the session's bag, empty where it fails; and whether that is the session's own ranking."""
    try:
        ranked: dict[str, Any] = json.loads(verb_output(*words[1:], "--json"))
    except ProgramFailedError as error:
        return {}, Replay(False, f"the bag could not be ranked: {error.why}")
    selected = tuple(row["toss_id"] for row in ranked["tosses"] if row["selected"])
    same = selected == summary.selected
    what = f"the same {len(selected)} tosses in the same order"
    other = f"other tosses than the session: {', '.join(selected)}"
    return ranked, Replay(same, f"rank gives {what if same else other}", ranked["out"])


def _ranking(rows: Sequence[Mapping[str, Any]]) -> list[ReportedToss]:
    ranked = sorted((row for row in rows if row["rank"] is not None), key=lambda row: int(row["rank"]))
    return [
        ReportedToss(row["rank"], row["toss_id"], row["score"], row["marginal_gain"], row["trace"], row["selected"])
        for row in ranked
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
