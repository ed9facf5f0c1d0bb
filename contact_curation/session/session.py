"""A session: nodes that are kept running and followed by their stores, until the throws are made and all has come to rest."""

import re
import time
from collections.abc import Callable
from typing import Any

from contact_curation.cli.online.options import OnlineConfig
from contact_curation.cli.stop_signals import StopSignals
from contact_curation.contact.body import Body
from contact_curation.errors import UnreadableInputError
from contact_curation.session.events import EventLog
from contact_curation.session.log_follower import LogFollower
from contact_curation.session.node_settings import DASHBOARD, SessionFolder
from contact_curation.session.parameter_files import Parameters
from contact_curation.session.settling import awaits_gain, awaits_motion, is_scored, rejected_motion, training_is_due
from contact_curation.session.standstill import Standstill
from contact_curation.session.stores import SessionStores, Standing, ThrowMade
from contact_curation.session.supervisor import Supervisor

ARM, DESIGNER = "sim_arm", "throw_designer"

POLL = 0.25
"""[s] between looks."""

AT_REST = 1.0
"""[s] that nothing must have changed for."""

PATIENCE = 120.0
"""[s] without any change, after the last throw, that are waited for, beyond the time that the designer gives a toss."""

GAIN_PATIENCE = 20.0
"""[s] that are waited for what the last throw's toss taught: after a kill it may never be known."""

ADDRESS = re.compile(r"dashboard at (\S+)")

NO_THROW = re.compile(r"no throw: (.*?)(?: \(\d+ times so far\))?; dropped")
"""What the designer says when it finds none that may be commanded."""

ROUND_DEFAULTS = {"least_tosses": 2, "settling_rounds": 3}
"""The trainer's."""


class Session:
    """Follows the nodes until there is nothing more to come.

    Args:
        config: what was asked for.
        body: that is thrown.
        parameters: of the nodes.
        folder: of the session.
        events: takes what happens.
        say: told one line about each throw, and the dashboard's address.
    """

    def __init__(
        self,
        config: OnlineConfig,
        body: Body,
        parameters: dict[str, Parameters],
        folder: SessionFolder,
        events: EventLog,
        say: Callable[[str], None],
    ) -> None:
        self._config = config
        self._rounds = {name: int(parameters["trainer"].get(name, default)) for name, default in ROUND_DEFAULTS.items()}
        self._toss_timeout = float(parameters["throw_designer"]["toss_timeout"]) + AT_REST
        self._stores = SessionStores(folder, body)
        self._folder = folder
        self._events = events
        self._say = say
        self._told = 0
        self._complaints = LogFollower(folder.logs / f"{DESIGNER}.log", NO_THROW)
        self._complaint = ""
        self._changed = time.monotonic()
        self._trained: tuple[Any, str] = (None, "")
        self.standing = Standing()
        self.settled = False
        self.address = ""

    def follow(self, supervisor: Supervisor, stop: StopSignals) -> None:
        """Until the throws are over and everything is at rest, or a signal comes.

        Raises:
            ProgramFailedError: a node cannot be kept running, or no throws come.
        """
        standstill = Standstill(time.monotonic(), self._toss_timeout)
        while not (stop.wanted or self._is_over()):
            time.sleep(POLL)
            supervisor.look()
            self._look()
            self._look_for_address()
            self._look_for_complaints()
            throws = len(self.standing.throws)
            if throws < self._config.throws and standstill.found(throws, time.monotonic(), self._complaint):
                self._say("no throw for long: the arm, which may have stopped itself, is started again")
                supervisor.kill(ARM)
        self._tell_of_throws(everything=True)

    def stay(self, supervisor: Supervisor, stop: StopSignals) -> None:
        """Keeps what still runs running until a signal comes."""
        while not stop.wanted:
            time.sleep(POLL)
            supervisor.look()

    def _is_over(self) -> bool:
        """Whether all throws were made, and nothing is to come of them any more."""
        waited = time.monotonic() - self._changed
        if not self._config.throws or len(self.standing.throws) < self._config.throws or waited < AT_REST:
            return False
        self.settled = self._at_rest()
        return self.settled or waited > PATIENCE + self._toss_timeout

    def _at_rest(self) -> bool:
        standing = self.standing
        waited = time.monotonic() - self._changed
        if (awaits_motion(standing) and waited < self._toss_timeout) or (awaits_gain(standing) and waited < GAIN_PATIENCE):
            return False
        if not is_scored(standing) or training_is_due(standing, **self._rounds):
            return False
        return standing.training is None or self._trained_version(standing) == standing.version

    def _trained_version(self, standing: Standing) -> str:
        """Of the checkpoint, which is read when it has changed."""
        if self._trained[0] != standing.training:
            self._trained = standing.training, self._stores.trained_version()
        return self._trained[1]

    def _look(self) -> None:
        try:
            standing = self._stores.look()
        except UnreadableInputError as error:  # a node that is just making its store
            self._events.note("unreadable", detail=str(error))
            return
        if standing != self.standing:
            if len(standing.throws) > len(self.standing.throws):
                self._complaint = ""
            self.standing, self._changed = standing, time.monotonic()
            self._tell_of_throws()

    def _tell_of_throws(self, *, everything: bool = False) -> None:
        """A line about each throw, in order, once it is known what came of it; of the last one at the end in any case."""
        for throw in self.standing.throws[self._told :]:
            last = throw is self.standing.throws[-1]
            if last and (awaits_motion(self.standing) or awaits_gain(self.standing)) and not everything:
                return
            self._told += 1
            self._tell(throw)

    def _tell(self, throw: ThrowMade) -> None:
        place = self.standing.throws.index(throw)
        outcome = outcome_of(self.standing, place)
        self._events.note(
            "throw",
            throw=throw.throw_id,
            number=place + 1,
            kind="designed" if throw.warm_up is None else "warm-up",
            planned=throw.planned,
            realised=throw.realised,
            toss=throw.toss_id,
            outcome=outcome,
        )
        of = f" of {self._config.throws}" if self._config.throws else ""
        self._say(f"throw {place + 1:3d}{of}  {gains(throw):<34}  {outcome}  ({self._events.seconds:.0f} s)")

    def _look_for_complaints(self) -> None:
        """Says why no throw is commanded; the same reason again only after a throw."""
        for complaint in self._complaints.new():
            if complaint != self._complaint:
                self._complaint = complaint
                self._say(f"no throw: {complaint}")

    def _look_for_address(self) -> None:
        path = self._folder.logs / f"{DASHBOARD}.log"
        if not self._config.dashboard or self.address or not path.exists():
            return
        found = ADDRESS.search(path.read_text(errors="replace"))
        if found:
            self.address = found[1]
            self._say(f"dashboard: {self.address}")


def gains(throw: ThrowMade) -> str:
    """What a throw was planned to teach, and what its toss did."""
    if throw.planned is None:
        return "warm-up"
    realised = "none known" if throw.realised is None else f"{throw.realised:.3g} realised"
    return f"gain {throw.planned:.3g} planned, {realised}"


def outcome_of(standing: Standing, place: int) -> str:
    """What became of the toss of a throw, in words."""
    throw = standing.throws[place]
    if throw.toss_id:
        rank = standing.kept.index(throw.toss_id) + 1 if throw.toss_id in standing.kept else None
        return f"kept, rank {rank} of {len(standing.kept)}" if rank else "not kept"
    rejected = rejected_motion(standing, place)
    return "no motion was seen" if rejected is None else f"rejected: {rejected.reasons[0]}"
