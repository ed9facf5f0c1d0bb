"""Node `throw_designer`: plans the throw with the largest predicted information; with `auto` it has throws made, one by one."""

import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from contact_curation_msgs.msg import CuratedBuffer, ModelParameters, TossRejected, TrainingStatus
from contact_curation_msgs.srv import ProposeThrow
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from std_msgs.msg import Bool

from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.design.releases import PriorConfig, published_prior
from contact_curation.design.throw import ThrowKind
from contact_curation.errors import ContactCurationError, InvalidValueError
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.nodes.messages.headers import Stamped, check_format, nanoseconds_of
from contact_curation.nodes.messages.model_parameters import theta_in
from contact_curation.nodes.messages.throw import executed_throw_of, throw_message
from contact_curation.nodes.messages.toss_information import INFORMATION, information_of
from contact_curation.nodes.ros.body_parameter import declared_body_and_params, warn_of_kept
from contact_curation.nodes.ros.catch_up import CatchUp
from contact_curation.nodes.ros.design_parameters import declared_design, declared_loop, declared_thrower
from contact_curation.nodes.ros.health import Health, HealthReport
from contact_curation.nodes.ros.node_main import StageNode, run
from contact_curation.nodes.ros.parameters import declare, declare_config
from contact_curation.nodes.ros.qos import RESULTS_DEPTH, latched
from contact_curation.nodes.ros.throttled_warnings import ThrottledWarnings
from contact_curation.nodes.ros.worker import Worker
from contact_curation.nodes.throw_goals import Outcome, ThrowGoals
from contact_curation.nodes.throw_reports import ThrowReports
from contact_curation.stages.design import DesignStage, RankedBuffer, TrainerRest
from contact_curation.stages.records import Cursor, Proposal
from contact_curation.stages.scored_theta import polytope_of, read_scored_theta
from contact_curation.stages.throw_loop import ThrowLoop
from contact_curation.storage.stores.state import StateStore

PERIOD = 0.05
"""Time between checks whether the next throw is due [s]."""

RESTING = (TrainingStatus.WAITING, TrainingStatus.FAILED)
"""States of a trainer that waits for the buffer to change."""

MOST_PROPOSALS = 8
"""Largest number of calls of `propose_throw` that wait for the worker; further ones are refused at once."""


class ThrowDesigner(StageNode):
    """Proposes throws on request; with `auto` commands them, the next when the toss of the last one was scored or rejected."""

    def __init__(self) -> None:
        super().__init__("throw_designer")
        about_params = "theta to begin with: JSON file or checkpoint; empty: none yet"
        self._body, parameters = declared_body_and_params(self, about_params)
        config, prior = declared_design(self), published_prior(declare_config(self, PriorConfig(), "prior."))
        store = Path(declare(self, "store", "throws.sqlite", "file that stores throws, theta and gains"))
        self._board_frame = declare(self, "board_frame", "body_surface", "frame that throws are given in")
        declare(self, "auto", False, "make one throw after the other", fixed=False)
        about_tracker = "wait with throws until pose_ingest reports (topic tracked) that the body's poses are published"
        self._awaits_tracker = declare(self, "await_tracker", True, about_tracker)
        self._tracked = False
        loop = declared_loop(self)
        geometry: ContactGeometry | None = None
        if parameters:
            theta, self._body = read_scored_theta(Path(parameters), self._body)
            geometry = polytope_of(theta)
        self._states = StateStore(store)
        self._states.claim()
        self._stage = DesignStage(self._body, config, self._states, geometry, prior, declared_thrower(self, self._body))
        if parameters and self._stage.keeps_newer:
            warn_of_kept(self, parameters)
        self._warnings = ThrottledWarnings(self)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._loop = ThrowLoop(self._stage, loop, self._now)
        self._to_send: Any = None
        self._last: Proposal | None = None
        self._no_throw, self._lost, self._toss_timeout = "", "", loop.toss_timeout
        self._reports = ThrowReports(self, self._board_frame)
        self._reports.tell(self._stage.reports)
        self._goals = ThrowGoals(self, self._told, loop.goal_timeout)
        self._worker = Worker(self.fail)
        self._proposals = 0
        # In a group of its own: a call that waits for its throw keeps no other callback waiting.
        self.create_service(ProposeThrow, "propose_throw", self._propose, callback_group=ReentrantCallbackGroup())
        self.create_subscription(ModelParameters, "model_parameters", self._parameters_came, latched(1))
        self.create_subscription(CuratedBuffer, "curated_buffer", self._buffer_came, latched(1))
        self.create_subscription(TrainingStatus, "training_status", self._status_came, latched(1))
        self.create_subscription(TossRejected, "toss_rejected", self._rejected_came, latched(RESULTS_DEPTH))
        self.create_subscription(Bool, "tracked", self._tracked_came, latched(1))
        self._information = CatchUp(self, self._worker, INFORMATION, Cursor(), self._take)
        self.create_timer(PERIOD, self._look, clock=self._steady)
        HealthReport(self, "throws", self._health, self._body.name)

    def close(self) -> None:
        self._worker.stop()
        self._states.close()

    def _look(self) -> None:
        """Plans the next throw when it is due, and commands it once it is planned."""
        self._goals.look()
        auto = self.get_parameter("auto").value
        if self._to_send is not None:
            message, self._to_send = self._to_send, None
            if auto and not self._goals.missing:
                self._goals.send(message)
            else:
                self._told(Outcome(None, f"waiting for {self._goals.missing}" if auto else "auto was turned off"))
        if auto and not self._missing and not self._goals.busy and self._loop.due():
            self._worker.do(self._throw_next)

    @property
    def _missing(self) -> str:
        """What the next throw has to wait for; empty for nothing."""
        if missing := self._goals.missing:
            return missing
        tracked = self._tracked and self.count_publishers("tracked") > 0
        return "" if tracked or not self._awaits_tracker else "a tracker (topic tracked of pose_ingest)"

    def _tracked_came(self, message: Any) -> None:
        self._tracked = bool(message.data)

    def _throw_next(self) -> None:
        """Plans the next throw; on the worker's thread."""
        lost = self._stage.throws[-1].commanded.throw_id if self._stage.awaits_toss else ""
        if lost not in ("", self._lost):
            self._warnings.note(
                "no toss",
                f"{lost}: found no toss or rejected motion after its release, expected one within "
                f"{self._toss_timeout:g} s; is the body tracked, and is the release stamped by the tracker's clock?",
                dropped=False,
            )
        self._lost = lost
        try:
            self._last = self._loop.next()
        except ContactCurationError as error:
            self._no_throw = str(error)
            self._warnings.note("no throw", self._no_throw, dropped=False)
            return
        self._no_throw = ""
        self._reports.tell([self._stage.begin(self._last)])
        now_ns = self.get_clock().now().nanoseconds
        self._to_send = throw_message(self._last.throw, Stamped(now_ns, self._board_frame))

    def _told(self, outcome: Outcome) -> None:
        self._worker.do(partial(self._finish, outcome))

    def _finish(self, outcome: Outcome) -> None:
        """Stores the outcome of a throw, after which the next one may begin; on the worker's thread."""
        why = outcome.message
        if outcome.executed is not None:
            try:
                self._reports.tell(self._loop.finish(*executed_throw_of(outcome.executed, self._board_frame)))
                return
            except InvalidValueError as error:
                why = str(error)
        self._warnings.note("throw not made", why, dropped=False)
        self._reports.tell(self._loop.abandon(why))

    async def _propose(self, request: Any, response: Any) -> Any:
        """Responds with a throw that the worker's thread plans; all other callbacks run meanwhile."""
        try:
            if self._proposals >= MOST_PROPOSALS:
                raise InvalidValueError(
                    "proposals under way", self._proposals, f"fewer than {MOST_PROPOSALS}: wait for an answer"
                )
            self._proposals += 1
            try:
                proposal = await self.done_by(self._worker, partial(self._plan, request))
            finally:
                self._proposals -= 1
        except ContactCurationError as error:
            response.message = str(error)
            return response
        response.success = True
        response.message = (
            "designed" if proposal.exploration is None else f"{ThrowKind.EXPLORATION.value} ({proposal.exploration})"
        )
        response.throw_command = throw_message(proposal.throw, Stamped(0, self._board_frame))
        return response

    def _plan(self, request: Any) -> Proposal:
        """Plans the throw of a request; on the worker's thread.

        Raises:
            ContactCurationError: it is for another body, or no throw can be planned.
        """
        if request.body not in ("", self._body.name):
            raise InvalidValueError("body", request.body, self._body.name)
        return self._stage.propose(int(request.seed))

    def _parameters_came(self, message: Any) -> None:
        self._worker.do(partial(self._renew, message))

    def _renew(self, message: Any) -> None:
        """Takes new parameters; on the worker's thread."""
        try:
            self._stage.renew(polytope_of(theta_in(message, self._body)))
            self._reports.tell(self._stage.reports)
        except InvalidValueError as error:
            self._warnings.note("bad parameters", str(error))

    def _buffer_came(self, message: Any) -> None:
        if message.body == self._body.name:
            self._worker.do(partial(self._select, message))

    def _select(self, message: Any) -> None:
        """Takes a new buffer; on the worker's thread."""
        try:
            check_format(message)
            newest_ns = nanoseconds_of(message.header.stamp)
            ids, version = tuple(message.toss_ids), message.parameters_version
            self._stage.select(RankedBuffer(ids, message.revision, version, message.tosses_seen, newest_ns))
        except InvalidValueError as error:
            self._warnings.note("bad buffer", str(error))

    def _status_came(self, message: Any) -> None:
        self._worker.do(partial(self._rest, message))

    def _rest(self, message: Any) -> None:
        """Takes the trainer's status; on the worker's thread."""
        try:
            check_format(message)
        except InvalidValueError as error:
            self._warnings.note("bad status", str(error))
            return
        revision = message.buffer_revision if message.state in RESTING else 0
        self._stage.rest(TrainerRest(revision, nanoseconds_of(message.header.stamp), message.parameters_version))

    def _rejected_came(self, message: Any) -> None:
        if message.body == self._body.name:
            self._worker.do(partial(self._reject, message))

    def _reject(self, message: Any) -> None:
        """Takes a rejected motion, whose throw gives no toss; on the worker's thread."""
        try:
            check_format(message)
            self._stage.reject(nanoseconds_of(message.header.stamp), tuple(message.reasons))
        except InvalidValueError as error:
            self._warnings.note("bad rejection", str(error))
        self._reports.tell(self._stage.reports)

    def _take(self, messages: Sequence[Any], cursor: Cursor) -> None:
        """Takes the information of tosses; on the worker's thread."""
        for message in messages:
            try:
                if message.body != self._body.name:
                    raise InvalidValueError(f"body of toss {message.toss_id}", message.body, self._body.name)
                self._stage.add(information_of(message), nanoseconds_of(message.header.stamp))
            except InvalidValueError as error:
                self._warnings.note("bad information", str(error))
        self._reports.tell(self._stage.reports)

    def _now(self) -> float:
        """Time of the steady clock [s], because simulated time may stand still."""
        return float(self._steady.now().nanoseconds) / NANOSECONDS

    def _health(self) -> Health:
        made, last = self._stage.throws, self._last
        auto = self.get_parameter("auto").value
        missing = self._missing if auto else ""
        values = {
            "throws": len(made),
            "under_way": self._goals.busy,
            "awaiting_toss": self._stage.awaits_toss,
            "rejected": sum(bool(one.rejected) for one in made),
            "realised_ratio": round(self._stage.ratio, 3),
            "parameters_version": self._stage.version,
            "queue": self._worker.waiting,
            **self._warnings.counts,
        }
        if missing:
            return Health(f"{len(made)} throws made, waiting for {missing}", values, warning=True, waiting_for=missing)
        if auto and self._no_throw:
            return Health(f"{len(made)} throws made, the next one cannot be planned: {self._no_throw}", values, warning=True)
        if last is None:
            return Health(f"{len(made)} throws made", values)
        how = (
            f"planned to gain {last.throw.expected_information:.3g}"
            if last.exploration is None
            else f"{ThrowKind.EXPLORATION.value}: {last.exploration}"
        )
        return Health(f"{len(made)} throws made, {last.throw.throw_id} {how}", values)


def main() -> int:
    """Runs the node."""
    return run(ThrowDesigner, "throw_designer")


if __name__ == "__main__":
    sys.exit(main())
