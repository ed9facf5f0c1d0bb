"""What a recorded session leaves behind: its bag ranked offline, summary, figures and report."""

import json
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import replace
from platform import platform
from typing import Any

from contact_curation import __version__
from contact_curation.cli.online.options import OnlineConfig
from contact_curation.dashboard.figures.report_data import save_figures
from contact_curation.dashboard.figures.session_report import save_report
from contact_curation.files import write_atomically
from contact_curation.pipeline.wording import json_line
from contact_curation.session.events import EventLog
from contact_curation.session.node_settings import SessionFolder
from contact_curation.session.offline_ranking import rank_command, ranking_figure_of
from contact_curation.session.parameter_files import Parameters
from contact_curation.session.report_data import report_data_of
from contact_curation.session.summary import Summary


def finish_record(
    config: OnlineConfig,
    folder: SessionFolder,
    parameters: Mapping[str, Parameters],
    command: tuple[str, ...],
    summary: Summary,
    events: EventLog,
) -> Summary:
    """Ranks the bag and writes what belongs in the folder.

    Returns:
        The summary, with where things lie and whether offline ranking gives the session's own.
    """
    words = rank_command(folder, parameters, config.body_file)
    ranked, replay = _replayed(words, summary)
    summary = replace(summary, document={**summary.document, **replay, "folder": str(folder.root)})
    story = report_data_of(f"Session of {len(summary.document['throws'])} throws", folder.bag, summary, events.events, ranked)
    figures = save_figures(story, folder.figures)
    if ranked:
        figures["Ranking"] = ranking_figure_of(folder)
    save_report(story, figures, folder.report)
    summary = replace(summary, document={**summary.document, "report": str(folder.report)})
    own = {
        "format_version": 1,
        "command": list(command),
        "rank_command": words,
        "version": __version__,
        "python": sys.version.split()[0],
        "platform": platform(),
        "parameters": parameters,
        "summary": summary.document,
    }
    write_atomically(folder.summary, (json_line(own) + "\n").encode())
    return summary


def _replayed(words: list[str], summary: Summary) -> tuple[dict[str, Any], dict[str, Any]]:
    """What `rank` says of the session's bag, empty where it fails; and whether that is the session's own ranking."""
    done = subprocess.run(
        [sys.executable, "-m", "contact_curation.cli.main", *words[1:], "--json"], capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        why = done.stderr.strip().rpartition("\n")[2].removeprefix("contact-curation: error: ")
        return {}, {"same": False, "replay": f"the bag could not be ranked: {why}"}
    told: dict[str, Any] = json.loads(done.stdout)
    kept = [row["toss_id"] for row in told["tosses"] if row["kept"]]
    same = kept == summary.document["kept"]
    what = f"the same {len(kept)} tosses in the same order" if same else f"other tosses than the session's: {', '.join(kept)}"
    return told, {"same": same, "replay": f"rank gives {what}", "manifest": told["out"]}
