"""Node `dashboard`: subscribes to all results and shows them in a browser. It cannot slow the graph.

Callbacks only put messages into a bounded queue; one worker translates, computes and draws. Messages that do not fit into the
queue are dropped and counted by topic, and the dashboard shows the counts. Dropped tosses and information are requested again
when the worker is idle. Only the newest selected set and the newest theta are drawn.
"""

import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from contact_curation_msgs.msg import CuratedBuffer, ModelParameters, ThrowReport, TossRejected, TrainingStatus
from contact_curation_msgs.msg import Toss as TossMessage
from contact_curation_msgs.srv import GetTosses
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType

from contact_curation.contact.loss_config import DEFAULT_LOSS
from contact_curation.dashboard.live.health_view import NodeHealth
from contact_curation.dashboard.live.layout import live_layout
from contact_curation.dashboard.live.serving import HERE, ServingConfig, close_screen, open_screen
from contact_curation.dashboard.live.session import LiveSession
from contact_curation.errors import ContactCurationError
from contact_curation.files import BLUEPRINT
from contact_curation.information.ranker import RankingConfig
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.nodes.messages.headers import check_format, nanoseconds_of
from contact_curation.nodes.messages.shown import first_theta, healths_of, selected_set_of, theta_of, throw_made_of, training_of
from contact_curation.nodes.messages.toss import toss_of
from contact_curation.nodes.messages.toss_information import INFORMATION, information_of
from contact_curation.nodes.ros.body_parameter import declared_body_and_params
from contact_curation.nodes.ros.catch_up import PERIOD, Source
from contact_curation.nodes.ros.follow import HELD, Follow
from contact_curation.nodes.ros.health import Health, HealthReport, awaited
from contact_curation.nodes.ros.node_main import StageNode, run
from contact_curation.nodes.ros.own_namespace import is_own
from contact_curation.nodes.ros.parameters import declare, declare_config
from contact_curation.nodes.ros.qos import latched, profile
from contact_curation.nodes.ros.throttled_warnings import ThrottledWarnings
from contact_curation.nodes.ros.worker import Latest, Worker
from contact_curation.stages.records import ServedDashboard, write_record
from contact_curation.stages.scoring import checked_body
from contact_curation.storage.outputs import check_replaceable

TOSSES = Source(TossMessage, "toss", GetTosses, "get_tosses", "tosses", page=16)

NEWEST_TOSSES = 64
"""Number of earlier tosses that a dashboard requests when it starts late; it requests all information."""


class Dashboard(StageNode):
    """Shows a session."""

    def __init__(self) -> None:
        super().__init__("dashboard")
        about_params = "theta to begin with: JSON file or checkpoint; empty: the body as described"
        self._body, parameters = declared_body_and_params(self, about_params)
        loss = declare_config(self, replace(DEFAULT_LOSS, threads=1), "loss.")
        self._limit = declare(
            self, "queue", 512, "largest number of waiting messages; further ones are dropped", bounds=(1, 1 << 20)
        )
        throws = declare(self, "throws", 0, "number of planned throws, for `throw n of N`; 0: not known", bounds=(0, 1_000_000))
        prior = declare(self, "prior", RankingConfig.prior, "prior information of the ranking, as the curator has it")
        cut = declare(self, "cut", RankingConfig.cut, "eigenvalues that are not identifiable, as the curator has it")
        ranking = RankingConfig(prior=prior, cut=cut)
        state = declare(self, "state", "", "file to write the dashboard's address to once it is served; empty: none")
        serving = declared_serving(self)
        theta, self._body = first_theta(parameters, self._body)
        self._screen = open_screen(serving, live_layout(self._body))
        self._session = LiveSession(self._screen, self._body, theta, loss, throws, ranking)
        self._dropped: Counter[str] = Counter()
        self._warnings = ThrottledWarnings(self)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._closing = False
        self._buffer: Any = None
        self._revision, self._pending = 0, False
        self._nodes: dict[str, NodeHealth] = {}
        self._model_parameters: Any = None
        self._worker = Worker(self.fail)
        self._ranking = Latest(self._worker, partial(self._guarded, self._draw_ranking))
        self._theta = Latest(self._worker, partial(self._guarded, self._take_theta))
        self._health_page = Latest(self._worker, self._draw_health)
        Follow(self, TOSSES, partial(self._offer, self._take_tosses), self._idle, NEWEST_TOSSES)
        Follow(self, INFORMATION, partial(self._offer, self._take_information), self._idle)
        self._listen(TossRejected, "toss_rejected", self._take_rejected)
        self._listen(TrainingStatus, "training_status", self._take_training)
        self._listen(ThrowReport, "throw_report", self._take_throw)
        self.create_subscription(CuratedBuffer, "curated_buffer", self._buffer_came, latched(1))
        self.create_subscription(ModelParameters, "model_parameters", self._parameters_came, latched(1))
        lossy = profile(100, reliable=False, latched=False)
        self.create_subscription(DiagnosticArray, "/diagnostics", self._health_came, lossy)
        self.create_timer(PERIOD, self._health_page.want, clock=self._steady)
        HealthReport(self, "dashboard", self._health, self._body.name)
        if serving.web_port:
            self.get_logger().info(f"dashboard at {serving.address}")
            if state:
                write_record(Path(state), ServedDashboard(serving.address))

    def close(self) -> None:
        self._closing = True
        self._worker.stop()
        close_screen(self._screen)

    def _listen(self, kind: Any, topic: str, take: Callable[[Any], None]) -> None:
        def heard(message: Any) -> None:
            self._offer(lambda messages: take(messages[0]), topic, [message])

        self.create_subscription(kind, topic, heard, latched(HELD))

    def _offer(self, take: Callable[[list[Any]], None], topic: str, messages: list[Any]) -> bool:
        """Queues messages of a topic for the worker, or drops them."""
        if self._worker.waiting >= self._limit:
            self._dropped[topic] += len(messages)
            return False
        self._worker.do(partial(self._guarded, partial(take, messages)))
        return True

    def _idle(self) -> bool:
        return self._worker.waiting == 0

    def _buffer_came(self, message: Any) -> None:
        self._buffer = message
        self._ranking.want()

    def _parameters_came(self, message: Any) -> None:
        self._model_parameters = message
        self._theta.want()

    def _health_came(self, message: Any) -> None:
        """Keeps the newest health of each node; it needs no queue, because it is small."""
        self._nodes.update({one.name: one for one in healths_of(message, self._seconds()) if is_own(self, one.name)})

    def _guarded(self, job: Callable[[], None]) -> None:
        """Runs a job on the worker's thread, as all methods below but the last; a bad message is counted and dropped."""
        if self._closing:
            return
        try:
            job()
        except ContactCurationError as error:
            self._warnings.note("not shown", str(error))

    def _take_tosses(self, messages: list[Any]) -> None:
        for message in messages:
            self._session.add_toss(checked_body(toss_of(message), self._body))

    def _take_information(self, messages: list[Any]) -> None:
        for message in messages:
            self._session.add_information(information_of(message))
        self._ranking.want()

    def _take_rejected(self, message: Any) -> None:
        check_format(message)
        stamp_ns = nanoseconds_of(message.header.stamp)
        self._session.add_rejected(message.toss_id, message.frames, message.reasons, stamp_ns)

    def _take_training(self, message: Any) -> None:
        self._session.add_training(training_of(message), nanoseconds_of(message.header.stamp))

    def _take_throw(self, message: Any) -> None:
        self._session.add_throw(throw_made_of(message))

    def _take_theta(self) -> None:
        """Draws the newest theta."""
        self._session.set_theta(theta_of(self._model_parameters, self._body))
        self._session.show_motion()

    def _draw_ranking(self) -> None:
        """Draws the newest selected set, and again while information that it was chosen from is still arriving."""
        message, self._buffer = self._buffer, None
        if message is not None:
            self._session.set_selected(selected_set_of(message), nanoseconds_of(message.header.stamp))
            self._revision, self._pending = message.revision, True
        if self._pending:
            self._pending = not self._session.show_ranking()

    def _draw_health(self) -> None:
        if not self._closing:
            nodes = dict(self._nodes)
            running = {f"{space.rstrip('/')}/{name}" for name, space in self.get_node_names_and_namespaces()}
            self._session.show_health(nodes, dict(self._dropped), self._seconds(), nodes.keys() - running)

    def _seconds(self) -> float:
        nanoseconds: int = self._steady.now().nanoseconds
        return nanoseconds / NANOSECONDS

    def _health(self) -> Health:
        dropped = {f"dropped {topic}": count for topic, count in self._dropped.items()}
        values = {
            "queue": self._worker.waiting,
            "tosses": self._session.tosses,
            "buffer": 0 if self._pending else self._revision,
            **dropped,
            **self._warnings.counts,
        }
        if self._screen.viewer is not None and not self._screen.viewer.serves:
            return Health("the page's server has ended; start the dashboard again", values, warning=True)
        lost = sum(self._dropped.values())
        said = f"{lost} messages not shown" if lost else "everything is shown"
        missing = "" if self._session.tosses else awaited(self, "tosses", TOSSES.topic)
        return Health(said, values, warning=bool(lost), waiting_for=missing)


def declared_serving(node: StageNode) -> ServingConfig:
    """Declares the parameters of the page and the recording, and returns their values.

    Raises:
        InvalidValueError: there is neither a page nor a file to write to, or the file must not be replaced.
    """
    recording = declare(node, "rrd", "", "Rerun file (.rrd) to write the session to; empty: none")
    if recording:
        for path in (Path(recording), Path(recording).with_suffix(BLUEPRINT)):
            check_replaceable("parameter rrd", path, "a new name, or that of an earlier dashboard's file")
    return ServingConfig(
        web_port=declare(node, "web_port", 9090, "port of the web page; 0: none is served"),
        grpc_port=declare(node, "grpc_port", 9876, "port of the data that the web page shows"),
        bind=declare(node, "bind", HERE, "IPv4 address that page and data are served at; 0.0.0.0: to other machines, too"),
        recording=Path(recording) if recording else None,
    )


def main() -> int:
    """Runs the node."""
    return run(Dashboard, "dashboard")


if __name__ == "__main__":
    sys.exit(main())
