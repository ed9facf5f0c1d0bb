"""`online`: the whole graph as processes, closed to a loop: design, throw, track, ingest, score, curate, train, design."""

import argparse
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory

from contact_curation.cli.node_parameters import write_node_parameters
from contact_curation.cli.online_events import EventLog
from contact_curation.cli.online_graph import supervised
from contact_curation.cli.online_options import OnlineConfig, add_online_options, online_config
from contact_curation.cli.online_parameters import DASHBOARD, SessionFolder, session_parameters, write_tag_map
from contact_curation.cli.online_record import finish_record
from contact_curation.cli.online_session import Session
from contact_curation.cli.online_summary import Summary, print_summary, summary_of
from contact_curation.cli.report import print_json
from contact_curation.cli.stop_signals import StopSignals
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.storage.body_file import read_body


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the verb's options to its parser."""
    parser.description = (
        "Starts the nodes as processes, keeps them running, and closes the loop with a simulated arm and camera. Ctrl-C and "
        "SIGTERM end it in order; with --throws it ends by itself, once the tosses are scored and trained on."
    )
    add_online_options(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Runs a session, and says what came of it.

    Raises:
        ContactCurationError: an option's file cannot be used, or a node cannot be kept running.
        KeyboardInterrupt: a signal came before the throws were over.
    """
    config = online_config(arguments)
    with TemporaryDirectory(prefix="contact-curation-online-") as temporary:
        folder = SessionFolder(config.record or Path(temporary))
        say = _silent if arguments.json else _say
        with StopSignals() as stop:
            summary = run_session(config, folder, arguments.command, stop, say)
        if arguments.json:
            print_json(summary.document)
        else:
            print_summary(summary)
    if config.throws and not summary.complete:
        raise KeyboardInterrupt
    return 0


def run_session(
    config: OnlineConfig, folder: SessionFolder, command: tuple[str, ...], stop: StopSignals, say: Callable[[str], None]
) -> Summary:
    """A session from its start to what came of it.

    Args:
        config: what is asked for.
        folder: of the session.
        command: that asked for it, for the record.
        stop: ends it early.
        say: told a line now and then.
    """
    body = read_body(config.body_file) if config.body_file else CONTACTNETS_CUBE
    parameters = session_parameters(config, body, folder)
    folder.make()
    write_node_parameters(folder.parameters, parameters)
    write_tag_map(config, body, folder)
    with ExitStack() as running:
        events = running.enter_context(EventLog(folder.events))
        supervisor = running.enter_context(supervised(parameters, folder, events.incident))
        session = Session(config, body, parameters, folder, events, say)
        supervisor.start()
        session.follow(supervisor, stop)
        staying = config.stay and not stop.wanted
        supervisor.stop([name for name in parameters if not (staying and name == DASHBOARD)])
        summary = summary_of(config, body, session, folder.checkpoint, supervisor.restarts, events)
        if config.record:
            say("all nodes have ended; replaying the recorded session, and writing its report")
            summary = finish_record(config, folder, parameters, command, summary, events)
        if staying:
            say(f"the dashboard goes on at {session.address}, until Ctrl-C")
            session.stay(supervisor, stop)
    return summary


def _say(line: str) -> None:
    print(line, flush=True)


def _silent(line: str) -> None:
    """Only JSON is wanted."""
