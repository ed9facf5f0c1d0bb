"""A session: nodes that are kept running and followed by their records, until the throws are made and all has come to rest."""

import os
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Protocol

from contact_curation.errors import ContactCurationError, InvalidValueError, UnreadableInputError
from contact_curation.motion.toss import Toss
from contact_curation.pipeline.reading import InputReader, ReadingConfig
from contact_curation.session.config import SessionConfig, SessionFolder
from contact_curation.session.events import EventLog
from contact_curation.session.free_domain import graph_domain
from contact_curation.session.graph import supervised
from contact_curation.session.node_parameters import (
    DASHBOARD,
    changed_parameters,
    check_camera,
    held_out_inputs,
    session_parameters,
    write_tag_map,
)
from contact_curation.session.parameter_files import Parameters, read_node_parameters, write_node_parameters
from contact_curation.session.report import finish_record
from contact_curation.session.state import SessionState, SessionStores
from contact_curation.session.summary import SessionSummary, gains, outcome_of, summary_of
from contact_curation.session.supervisor import Incident, ProgramFailedError, Supervisor
from contact_curation.stages.simulated_time import AwakeClock

ARM = "sim_arm"

POLL = 0.25
"""[s] between looks."""

LONGEST_LOOK = 0.5
"""[s] that count of the time between two looks while throws are awaited: a machine that gives this process no time gives the
nodes none either, and to start one of them again would only cost more of it."""

AT_REST = 1.0
"""[s] that nothing must have changed for."""

PATIENCE = 120.0
"""[s] without any change, after the last throw, that are waited for, beyond the time that the designer gives a toss."""

GAIN_PATIENCE = 20.0
"""[s] that are waited for the gain of the last throw's toss, which may never be known after a kill."""

LONGEST_PAUSE = 180.0
"""[s] between two throws, beyond the time that the designer gives a throw's toss: images may take minutes to be rendered."""

MOST_STARTS = 3
"""Of the arm, without a throw in between."""


SERVED = "The dashboard is served until Ctrl-C: "
"""Said before its address, once the session is over."""


class SessionReporter(Protocol):
    """Reports how a session goes."""

    def say(self, line: str) -> None:
        """Reports progress."""

    def conclude(self, summary: SessionSummary) -> None:
        """The summary of the session."""


def run_session(
    config: SessionConfig,
    folder: SessionFolder,
    command: tuple[str, ...],
    stopped: Callable[[], bool],
    reporter: SessionReporter,
) -> SessionSummary:
    """Runs a session from its start to its summary.

    Args:
        config: what is asked for.
        folder: of the session.
        command: that asked for it, for the record.
        stopped: whether it is to end early.
        reporter: says how it goes.

    Raises:
        ContactCurationError: a file cannot be used, or a node cannot be kept running.
    """
    body = config.body()
    parameters = session_parameters(config, body, folder)
    with ExitStack() as running:
        domain = running.enter_context(graph_domain(os.environ))
        folder.make(resume=config.resume)
        running.enter_context(folder.claimed())
        folder.dashboard.unlink(missing_ok=True)  # the address before a resumption is not that of today's
        events = running.enter_context(EventLog(folder.events, resume=config.resume))
        events.note_body(f"{body.name}, {body.mass:g} kg ({body.digest})")
        if config.resume and folder.parameters.exists():
            before = read_node_parameters(folder.parameters)
            check_camera(before, config)
            changed = changed_parameters(before, parameters)
            if changed:
                reporter.say(f"the session goes on with other parameters: {changed}")
        write_node_parameters(folder.parameters, parameters)
        write_tag_map(config, body, folder, parameters)

        def tell(incident: Incident) -> None:
            events.incident(incident)
            if incident.what in NEWS:
                reporter.say(f"{incident.program} {NEWS[incident.what]} ({incident.detail})")

        supervisor = running.enter_context(supervised(parameters, folder, domain, tell))
        session = Session(config, parameters, folder, events, reporter.say)
        supervisor.start()
        session.follow(supervisor, stopped)
        staying = config.stay and bool(session.state.dashboard) and not stopped()
        supervisor.stop([name for name in parameters if not (staying and name == DASHBOARD)])
        summary = summary_of(config, session.state, folder, events.restarts, events.seconds, settled=session.settled)
        summary = summary if staying else replace(summary, dashboard="")
        if config.record:
            reporter.say("all nodes have ended; replaying the recorded session, and writing its report")
            summary = finish_record(config, folder, parameters, command, summary, events)
        reporter.conclude(summary)
        if staying:
            reporter.say(f"\n{SERVED}{session.state.dashboard}")
            session.stay(supervisor, stopped)
    return summary


NEWS = {"died": "died", "given up": "is given up"}
"""Incidents that somebody should know of, and how they are said."""


def check_recordings(config: SessionConfig) -> None:
    """Looks into the recordings that the model is evaluated on: a trainer without them goes on, and nobody would see why.

    Raises:
        ContactCurationError: one of them cannot be read, or there is no toss in any.
    """
    reading = ReadingConfig(config.body(), held_out_inputs(config))
    found = [_first_toss(path, reading) for path in config.evaluate_on]
    if found and not any(isinstance(one, Toss) for one in found):
        raise InvalidValueError("--evaluate-on", next(str(one) for one in found), "recordings of tosses")


def _first_toss(path: Path, config: ReadingConfig) -> Toss | str:
    """The first sound toss of a recording, or why there is none."""
    reader = InputReader(path, config)
    first = next(reader.tosses(), None)
    if first is not None:
        return first
    reading = reader.reading()
    if not reading.complete:
        raise ContactCurationError(reading.problems[0])
    return reading.problems[0] if reading.problems else f"no toss in {path}"


class Session:
    """Follows the nodes until there is nothing more to come.

    Args:
        config: what was asked for.
        parameters: of the nodes.
        folder: of the session.
        events: takes what happens.
        say: told one line about each throw, and the dashboard's address.
    """

    def __init__(
        self,
        config: SessionConfig,
        parameters: dict[str, Parameters],
        folder: SessionFolder,
        events: EventLog,
        say: Callable[[str], None],
    ) -> None:
        self._wanted = config.throws or 0
        self._stays = config.stay
        self._toss_timeout = float(parameters["throw_designer"]["toss_timeout"]) + AT_REST
        self._stores = SessionStores(folder)
        self._events = events
        self._say = say
        self._told = events.count("throw")
        self._changed = time.monotonic()
        self.state = SessionState()
        self.settled = False

    def follow(self, supervisor: Supervisor, stopped: Callable[[], bool]) -> None:
        """Until the throws are over and everything is at rest, or it is stopped.

        Raises:
            ProgramFailedError: a node cannot be kept running, or no throws come.
        """
        awake = AwakeClock(time.monotonic, LONGEST_LOOK)
        standstill = Standstill(awake.now(), self._toss_timeout)
        while not (stopped() or self._is_over()):
            time.sleep(POLL)
            supervisor.look()
            self._look()
            throws = len(self.state.throws)
            if throws < self._wanted and standstill.found(throws, awake.tick(), self.state.no_throw):
                self._say("no throw for long: the arm, which may have stopped itself, is started again")
                supervisor.kill(ARM)
        self._tell_of_throws(everything=True)

    def stay(self, supervisor: Supervisor, stopped: Callable[[], bool]) -> None:
        """Keeps what still runs running until it is stopped."""
        while not stopped():
            time.sleep(POLL)
            supervisor.look()

    def _is_over(self) -> bool:
        """Whether all throws were made, and nothing is to come of them any more."""
        waited = time.monotonic() - self._changed
        if not self._wanted or len(self.state.throws) < self._wanted or waited < AT_REST:
            return False
        if self._stays and not self.state.dashboard and waited < PATIENCE:  # a session that goes on may be over at once
            return False
        awaits_motion = self.state.awaits_motion and waited < self._toss_timeout
        awaits_gain = self.state.awaits_gain and waited < GAIN_PATIENCE
        self.settled = not (awaits_motion or awaits_gain) and self.state.is_scored and self.state.is_trained
        return self.settled or waited > PATIENCE + self._toss_timeout

    def _look(self) -> None:
        try:
            state = self._stores.look()
        except UnreadableInputError as error:  # a node that is just making its store
            self._events.note("unreadable", detail=str(error))
            return
        if state == self.state:
            return
        before, self.state, self._changed = self.state, state, time.monotonic()
        if state.dashboard != before.dashboard:
            self._say(f"dashboard: {state.dashboard}")
        if state.no_throw and state.no_throw != before.no_throw:
            self._say(f"no throw: {state.no_throw}")
        self._tell_of_throws()

    def _tell_of_throws(self, *, everything: bool = False) -> None:
        """A line about each throw, in order, once it is known what came of it; of the last one at the end in any case."""
        for place in range(self._told, len(self.state.throws)):
            last = place == len(self.state.throws) - 1
            if last and (self.state.awaits_motion or self.state.awaits_gain) and not everything:
                return
            self._told += 1
            self._tell(place)

    def _tell(self, place: int) -> None:
        throw = self.state.throws[place]
        outcome = "accepted" if throw.toss_id else outcome_of(self.state, place)  # whether it is selected may change yet
        self._events.note(
            "throw",
            throw=throw.commanded.throw_id,
            number=place + 1,
            kind=throw.report.kind.value,
            planned=throw.planned_gain,
            realised=throw.realised_gain,
            toss=throw.toss_id,
            outcome=outcome,
        )
        of = f" of {self._wanted}" if self._wanted else ""
        self._say(f"throw {place + 1:3d}{of}  {gains(throw):<34}  {outcome}  ({self._events.seconds:.0f} s)")


class Standstill:
    """Notices when throws have stopped coming: an arm that stopped itself waits to be armed, which here only a new start does.

    Args:
        now: a steady clock [s].
        toss_timeout: so long the designer waits for a throw's toss before it commands the next [s].
    """

    def __init__(self, now: float, toss_timeout: float) -> None:
        self._pause = LONGEST_PAUSE + toss_timeout
        self._throws = 0
        self._since = now
        self._starts = 0

    def found(self, throws: int, now: float, no_throw: str = "") -> bool:
        """Whether the arm should be started again; asked often.

        Args:
            throws: made so far.
            now: the clock.
            no_throw: why the designer has commanded none since the last throw; empty where that is not why.

        Raises:
            ProgramFailedError: that has not helped, or cannot.
        """
        if throws != self._throws:
            self._throws, self._since, self._starts = throws, now, 0
        if now - self._since < self._pause:
            return False
        if no_throw:
            raise ProgramFailedError(f"found no throw for {self._pause:.0f} s after {throws} throws: {no_throw}")
        if self._starts == MOST_STARTS:
            waited = self._pause * (MOST_STARTS + 1)
            raise ProgramFailedError(
                f"found no throw for {waited:.0f} s after {throws} throws, though sim_arm was started again {MOST_STARTS} "
                "times; see the logs of sim_arm and throw_designer"
            )
        self._since = now
        self._starts += 1
        return True
