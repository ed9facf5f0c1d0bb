"""`online`: runs all nodes as processes in a closed loop: design, throw, track, ingest, score, curate, train."""

import argparse
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from contact_curation.cli.online.options import add_online_options, session_config
from contact_curation.cli.options.one_line_parser import OneLineParser
from contact_curation.cli.report import print_json
from contact_curation.cli.stop_signals import StopSignals
from contact_curation.files import temporary_folder
from contact_curation.session.config import SessionFolder
from contact_curation.session.session import check_recordings, run_session
from contact_curation.session.summary import SessionSummary
from contact_curation.session.supervisor import ProgramFailedError
from contact_curation.solver.compiled import load_kernel


def add_options(parser: OneLineParser) -> None:
    """Adds the verb's options to its parser."""
    parser.description = (
        "Starts the nodes as processes, restarts them if they fail, and closes the loop with a simulated arm and camera. "
        "Ctrl-C and SIGTERM end it in order; with --throws it ends by itself when all tosses are scored and trained on."
    )
    add_online_options(parser)
    parser.set_examples(
        "contact-curation online --throws 12 --dashboard --record session",
        "contact-curation online --throws 4 --camera rendered --body brick.yaml",
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Runs a session and prints its summary.

    Raises:
        ContactCurationError: an option's file cannot be used, or a node cannot be kept running.
        KeyboardInterrupt: a signal came before the last throw.
    """
    load_kernel()  # no node works without it; this reports the error once
    config = session_config(arguments)
    check_recordings(config)
    with _session_folder(config.record) as folder:
        reporter = _Json() if arguments.json else _Lines()
        try:
            with StopSignals() as stop:
                summary = run_session(config, folder, arguments.command, lambda: stop.wanted, reporter)
        except ProgramFailedError as error:
            if config.record:
                raise
            raise ProgramFailedError(f"{error.why}; --record DIR keeps its log") from error
    if not summary.complete:
        raise KeyboardInterrupt
    return 0


@contextmanager
def _session_folder(record: Path | None) -> Iterator[SessionFolder]:
    """The folder that is to be recorded in, or one that is removed at the end."""
    if record is not None:
        yield SessionFolder(record)
        return
    with temporary_folder("online") as folder:  # it is locked, so that the session claims one in it
        yield SessionFolder(folder / "session")


class _Lines:
    """Prints a session's progress and summary for people."""

    def say(self, line: str) -> None:
        print(line, flush=True)

    def conclude(self, summary: SessionSummary) -> None:
        print(summary.table())


class _Json:
    """Prints one JSON object and nothing else."""

    def say(self, line: str) -> None:
        print(line.strip(), file=sys.stderr, flush=True)

    def conclude(self, summary: SessionSummary) -> None:
        print_json(summary.document())
