"""`online`: the whole graph as processes, closed to a loop: design, throw, track, ingest, score, curate, train, design."""

import argparse
import os
import sys
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Protocol

from contact_curation.cli.online.options import OnlineConfig, add_online_options, online_config
from contact_curation.cli.report import print_json
from contact_curation.cli.stop_signals import StopSignals
from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.errors import ContactCurationError, InvalidValueError
from contact_curation.pipeline.reading import InputReader, ReadingConfig
from contact_curation.session.events import EventLog
from contact_curation.session.free_domain import graph_domain
from contact_curation.session.graph import supervised
from contact_curation.session.node_settings import DASHBOARD, SessionFolder, judged_inputs, session_parameters, write_tag_map
from contact_curation.session.parameter_files import write_node_parameters
from contact_curation.session.record import finish_record
from contact_curation.session.session import Session
from contact_curation.session.summary import Summary, print_summary, summary_of
from contact_curation.session.supervisor import Incident, ProgramFailedError
from contact_curation.solver.compiled import load_kernel


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
    load_kernel()  # without it no node can work: better said here, once, than by all of them
    config = online_config(arguments)
    check_recordings(config)
    with TemporaryDirectory(prefix="contact-curation-online-") as temporary:
        folder = SessionFolder(config.record or Path(temporary))
        voice = _Json() if arguments.json else _Lines()
        try:
            with StopSignals() as stop:
                summary = run_session(config, folder, arguments.command, stop, voice)
        except ProgramFailedError as error:
            if config.record:
                raise
            raise ProgramFailedError(f"{error.why}; --record DIR keeps its log") from error
    if config.throws and not summary.complete:
        raise KeyboardInterrupt
    return 0


def check_recordings(config: OnlineConfig) -> None:
    """Looks into the recordings that the model is judged by: a trainer without them goes on, and nobody would see why.

    Raises:
        ContactCurationError: one of them cannot be read, or there is no toss in any.
    """
    inputs = judged_inputs(config)
    tosses, problems = 0, list[str]()
    for path in config.held_out:
        reader = InputReader(path, ReadingConfig(_body(config), inputs))
        found = next(reader.tosses(), None) is not None
        if not (found or reader.reading().complete):
            raise ContactCurationError(reader.reading().problems[0])
        tosses, problems = tosses + found, [*problems, *reader.reading().warnings]
    if config.held_out and not tosses:
        found_instead = problems[0] if problems else f"no toss in {', '.join(map(str, config.held_out))}"
        raise InvalidValueError("--held-out", found_instead, "recordings of tosses")


def _body(config: OnlineConfig) -> Body:
    return Body.from_file(config.body_file) if config.body_file else CONTACTNETS_CUBE


class Voice(Protocol):
    """Says how a session goes."""

    def say(self, line: str) -> None:
        """On the way."""

    def conclude(self, summary: Summary) -> None:
        """What came of it."""


def run_session(
    config: OnlineConfig, folder: SessionFolder, command: tuple[str, ...], stop: StopSignals, voice: Voice
) -> Summary:
    """A session from its start to what came of it.

    Args:
        config: what is asked for.
        folder: of the session.
        command: that asked for it, for the record.
        stop: ends it early.
        voice: says how it goes.
    """
    body = _body(config)
    parameters = session_parameters(config, body, folder)
    folder.make()
    write_node_parameters(folder.parameters, parameters)
    write_tag_map(config, body, folder)
    with ExitStack() as running:
        events = running.enter_context(EventLog(folder.events))
        tell = partial(_tell, events, voice)
        domain = running.enter_context(graph_domain(os.environ))
        supervisor = running.enter_context(supervised(parameters, folder, domain, tell))
        session = Session(config, body, parameters, folder, events, voice.say)
        supervisor.start()
        session.follow(supervisor, stop)
        staying = config.stay and bool(session.address) and not stop.wanted
        supervisor.stop([name for name in parameters if not (staying and name == DASHBOARD)])
        summary = summary_of(config, body, session, folder.checkpoint, supervisor.restarts, events)
        if config.record:
            voice.say("all nodes have ended; replaying the recorded session, and writing its report")
            summary = finish_record(config, folder, parameters, command, summary, events)
        voice.conclude(summary)
        if staying:
            voice.say(f"\nThe dashboard goes on until Ctrl-C: {session.address}")
            session.stay(supervisor, stop)
    return summary


def _tell(events: EventLog, voice: Voice, incident: Incident) -> None:
    """Notes an incident, and says it where somebody should know."""
    events.incident(incident)
    if incident.what == "died":
        voice.say(f"{incident.program} died ({incident.detail})")
    elif incident.what == "given up":
        voice.say(f"{incident.program} is given up ({incident.detail})")


class _Lines:
    """For people."""

    def say(self, line: str) -> None:
        print(line, flush=True)

    def conclude(self, summary: Summary) -> None:
        print_summary(summary)


class _Json:
    """For programs: one object and nothing else."""

    def say(self, line: str) -> None:
        print(line.strip(), file=sys.stderr, flush=True)

    def conclude(self, summary: Summary) -> None:
        print_json(summary.document)
