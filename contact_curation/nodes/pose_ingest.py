"""Node `pose_ingest`: cuts a tracker's poses into tosses, and stores each toss before announcing it.

Inactive, it has left the pose topics and says that there is no tracker; what it has received is processed, and what is stored
can be requested. Active again it goes on as after an interruption of the poses.
"""

import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from contact_curation_msgs.msg import Toss as TossMessage
from contact_curation_msgs.msg import TossRejected
from contact_curation_msgs.srv import GetTosses
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from std_msgs.msg import Bool

from contact_curation.contact.body import Body
from contact_curation.errors import UnknownNameError
from contact_curation.motion.calibration import NO_CORRECTION
from contact_curation.motion.gate_config import GateConfig
from contact_curation.motion.ingest import IngestConfig, TossIngest
from contact_curation.motion.pose_noise import RIG
from contact_curation.motion.pose_stream import LOWEST_RATE
from contact_curation.motion.segmenter_config import SegmenterConfig
from contact_curation.motion.toss import NANOSECONDS, Toss
from contact_curation.nodes.messages.toss import rejected_message, toss_message
from contact_curation.nodes.messages.toss_bytes import EXPECTED_TOSS, toss_bytes
from contact_curation.nodes.ros.body_parameter import declared_body
from contact_curation.nodes.ros.health import Flow, Health, HealthReport, Rate, awaited
from contact_curation.nodes.ros.managed_node import ManagedNode
from contact_curation.nodes.ros.node_main import StageNode, run
from contact_curation.nodes.ros.parameters import declare, declare_config
from contact_curation.nodes.ros.pose_topics import READ_TYPES, PoseTopics, Received, declared_poses
from contact_curation.nodes.ros.qos import RESULTS_DEPTH, latched, profile
from contact_curation.nodes.ros.throttled_warnings import ThrottledWarnings
from contact_curation.nodes.ros.worker import Inbox, Latest, Worker
from contact_curation.stages.ingest import Arrival, IngestJournal
from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.inputs.pose_source import PoseTopicConfig
from contact_curation.storage.inputs.recording_notes import RULES_NOTE, with_recorded_rules
from contact_curation.storage.stores.tosses import StoredRejected, StoredToss, TossStore

PAUSE = 10.0
"""[s] between two warnings that poses come too fast."""

LOOK_PERIOD = 0.2
"""Time between looks at the graph for pose topics [s]."""

MOSTLY = 0.8
"""Share of the messages that must be poses, for the rate of the poses to be that of the tracker."""

BATCH = 64
"""Number of messages that are read and committed to the store together."""

MOST_WAITING = 4096
"""Largest number of messages that wait in the node; beyond it the callback waits, and the middleware queues (`queue_depth`)."""

LARGEST_PAGE = 32
"""Largest number of tosses in a response of `get_tosses`."""


class PoseIngest(ManagedNode):
    """Stores and announces the tosses of one body."""

    def __init__(self) -> None:
        super().__init__("pose_ingest")
        self._body = declared_body(self)
        self._poses = declared_poses(self)
        self._config = declared_ingest(self, self._body, self._poses)
        self._source = declare(self, "source", "", "name of the recording in toss ids; empty: the pose topic")
        type_name = declared_type(self)
        depth = declare(self, "queue_depth", 32768, "poses that wait to be processed", bounds=(296, 1 << 20))
        self._store = TossStore(Path(declare(self, "store", "tosses.sqlite", "file that stores tosses")))
        self._store.claim()
        self._warnings = ThrottledWarnings(self)
        self._inbox = Inbox[Received](MOST_WAITING, self.context.ok)
        self._received, self._on_topic, self._flow, self._dropped = Rate(), 0, Flow(), ""
        self._newest_ns: int | None = None
        self._journal: IngestJournal | None = None
        self._ingest: TossIngest | None = None
        self._tracker = RIG
        self._backlog = (
            f"poses come faster than they are processed: {MOST_WAITING} wait here, and up to {depth} more in the middleware, "
            "which drops the oldest beyond that; play more slowly, or raise queue_depth"
        )
        self._worker, self._aside = Worker(self.fail), Worker(self.fail)
        self._taking = Latest(self._worker, self._take)
        self._tosses = self.create_publisher(TossMessage, "toss", latched(RESULTS_DEPTH))
        self._rejected = self.create_publisher(TossRejected, "toss_rejected", latched(RESULTS_DEPTH))
        self._expected = self.create_publisher(TossMessage, EXPECTED_TOSS, profile(1, reliable=True, latched=False))
        self._tracked = self.create_publisher(Bool, "tracked", latched(1))
        self._said_tracked: bool | None = None
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_service(GetTosses, "get_tosses", self._asked_for, callback_group=ReentrantCallbackGroup())
        self._topics = PoseTopics(self, self._body.name, self._poses, type_name, depth, self._found, self._arrived)
        self.create_timer(LOOK_PERIOD, self._look, clock=self._steady)
        HealthReport(self, "poses", self._health, self._body.name)
        self.start()

    def deactivated(self) -> None:
        self._topics.leave()
        self._look()

    def close(self) -> None:
        self._worker.stop()
        self._aside.stop()
        self._store.close()

    def _look(self) -> None:
        """Follows the graph, and publishes on `tracked` whether there is a tracker, without which no throw may be commanded."""
        if self.active:
            self._topics.follow()
        if self._topics.has_publisher != self._said_tracked:
            self._said_tracked = self._topics.has_publisher
            self._tracked.publish(Bool(data=self._said_tracked))

    def _found(self, topic: str) -> dict[str, int]:
        """Continues an earlier run on this topic: announces tosses that were stored and not announced."""
        source = self._source or topic
        self.get_logger().info(f"poses of {self._body.name} from {topic}")
        self._ingest = TossIngest(self._config, self._body, source=source, complete=self._complete)
        body = self._body
        shape = f"{body.vertices.tolist()} {body.mass} {body.inertia.tolist()} {body.friction} {body.gravity}"
        made_of = f"{self._config} {body.name} {shape} {source}"
        self._journal = IngestJournal(self._ingest, self._store, made_of, topic)
        if self._journal.others:
            self.get_logger().warning(
                f"the store holds {self._journal.others} tosses, and was last used with another topic, body or other settings: "
                "they stay as they are; to cut and judge them anew, name another store"
            )
        while any(missed := self._journal.unannounced()):
            self._announce(*missed)
        return self._journal.newest

    def _arrived(self, received: Received) -> None:
        if len(self._inbox) >= MOST_WAITING:
            self.get_logger().warning(self._backlog, throttle_duration_sec=PAUSE)
        self._inbox.put(received)
        self._received.count += 1
        self._on_topic += self._topics.source is not None and received.topic == self._topics.source.body.name
        self._taking.want()

    def _take(self) -> None:
        """Processes all messages that have arrived; on the worker's thread."""
        while self._journal is not None and self._inbox:
            read = [self._topics.read(one) for one in self._inbox.take(BATCH)]
            arrivals = [Arrival(topic, published_ns, one) for topic, published_ns, measured in read for one in measured]
            if arrivals:
                self._newest_ns = self._newest_stamp_ns(arrivals)
                self._store_and_announce(self._journal, arrivals)

    def _newest_stamp_ns(self, arrivals: Sequence[Arrival]) -> int | None:
        """The stamp of the newest measurement on the body's topic so far."""
        topic = "" if self._topics.source is None else self._topics.source.body.name
        return next((one.measured.stamp_ns for one in reversed(arrivals) if one.topic == topic), self._newest_ns)

    def _store_and_announce(self, journal: IngestJournal, arrivals: Sequence[Arrival]) -> None:
        happened = journal.take(arrivals)
        self._announce(happened.tosses, happened.rejected)
        if not self._inbox and (expected := journal.expected()) is not None:
            self._ahead(expected)
            self._aside.do(journal.sync_ahead)
        elif not self._inbox and (nearing := journal.nearing_end()) is not None:
            self._ahead(nearing)
        if self._ingest is not None and (noise := self._ingest.noise_done) and self._ingest.tracker != self._tracker:
            self._tracker = self._ingest.tracker
            self.get_logger().info(noise)
        for bad in happened.bad:
            self._dropped = bad.why
            self._warnings.note(f"bad {bad.kind}", f"{bad.child} at {bad.stamp_ns} ns: {bad.why}")
        for conflict in happened.conflicts:
            self._warnings.note("conflict", conflict)

    def _complete(self, toss: Toss) -> None:
        """Takes a toss that is neither judged nor stored; it is scored meanwhile where that takes no time from this node."""
        if not self.shares_process:
            self._ahead(toss)

    def _ahead(self, toss: Toss) -> None:
        """Publishes a toss that is not announced yet, unless more poses wait."""
        if self._journal is not None and not self._inbox:
            self._expected.publish(toss_bytes(toss, 0, self._poses.board_frame))

    def _announce(self, tosses: Sequence[StoredToss], rejected: Sequence[StoredRejected]) -> None:
        for one in rejected:
            self._rejected.publish(rejected_message(one.rejected, self._poses.board_frame))
            self.get_logger().info(f"rejected {one.rejected.toss.toss_id}: {'; '.join(one.rejected.reasons)}")
        for stored in tosses:
            self._tosses.publish(toss_bytes(stored.toss, stored.sequence, self._poses.board_frame))
            self.get_logger().info(f"toss {stored.toss.toss_id}: {stored.toss.frames} frames, {stored.toss.duration:.2f} s")
        if self._journal is not None and (tosses or rejected):
            last = tosses[-1].sequence if tosses else 0
            self._journal.announced(last, rejected[-1].sequence if rejected else 0)

    async def _asked_for(self, request: Any, response: Any) -> Any:
        return await self.done_by(self._aside, partial(self._get_tosses, request, response))

    def _get_tosses(self, request: Any, response: Any) -> Any:
        """Responds with a page of tosses; beside the worker, on a thread that keeps neither poses nor callbacks waiting."""
        wanted = list(request.toss_ids)
        response.last_sequence = self._store.last_sequence
        limit = min(request.limit or LARGEST_PAGE, LARGEST_PAGE)
        stored = self._store.get(wanted[:limit]) if wanted else self._store.after(request.after_sequence, limit)
        response.tosses = [toss_message(one.toss, one.sequence, self._poses.board_frame) for one in stored]
        response.unknown_ids = sorted(set(wanted[:limit]) - {one.toss.toss_id for one in stored})
        return response

    def _health(self) -> Health:
        offers = {topic: str(offer) for topic, offer in self._topics.offers.items()}
        counts = {} if self._ingest is None else self._ingest.counts
        rate = self._received.per_second()
        values = {
            "messages": self._received.count, "known": self._topics.known, "rate_hz": f"{rate:.1f}", "queue": len(self._inbox),
            "tosses_stored": self._store.last_sequence, "rejected_stored": self._store.last_rejected_sequence,
            **counts, **self._warnings.counts, **offers,
        }  # fmt: skip
        if self._ingest is not None:
            values["stamps"] = self._ingest.stamps_done or "as they came"
            values["noise"] = f"{self._ingest.noise.multiple:.1f}"
            if rate and (text := self._ingest.noise_warning()):
                return Health(text, values, warning=True)
        if not self.active:
            return Health(self.inactive, values, warning=True)
        if self._topics.source is None:
            what = f"poses: {self._topics.waiting_for or 'none yet'}"
            return Health(f"waiting for {what}", values, warning=True, waiting_for=what)
        topic = self._topics.source.body.name
        if fault := self._fault():
            return Health(f"{topic}: {fault}", values, warning=True, waiting_for=f"usable poses on {topic}: {fault}")
        missing = "" if self._received.count and self._topics.has_publisher else awaited(self, "poses", topic)
        if not (missing or self._store.last_sequence or self._store.last_rejected_sequence):
            missing = f"a first toss on {topic}; if there was one, record it: contact-curation check BAG says what is wrong"
        return Health(f"{rate:.0f} messages/s from {topic}", values, warning=rate == 0.0, waiting_for=missing)

    def _fault(self) -> str:
        """What is wrong with messages that come; empty for nothing."""
        poses = 0 if self._ingest is None else self._ingest.counts["poses"]
        flowing = self._flow.look(self._on_topic, poses, self._newest_ns, self._steady.now().nanoseconds / NANOSECONDS)
        if flowing is None:
            return ""
        if not flowing.share:
            name, frame = self._body.name, self._poses.body_frame_of(self._body.name)
            why = (
                self._dropped or f"no transform leads from their frame to '{self._poses.board_frame}', or none is of '{frame}'"
            )
            return f"none of {flowing.messages:.0f} messages/s gives a pose of {name} on the board: {why}"
        if flowing.poses < LOWEST_RATE and flowing.share > MOSTLY:
            return f"poses come at {flowing.poses:.3g} Hz by their stamps, expected 60 Hz or more: tosses may go unseen"
        return ""


def declared_ingest(node: StageNode, body: Body, poses: PoseTopicConfig) -> IngestConfig:
    """Declares the parameters of the stages and returns their configuration; gravity is the body's, as in offline ranking."""
    segmenter = declare_config(node, SegmenterConfig(), "segmenter.")
    recording = declare(node, "rules_of", "", "recording whose segmenting rules are used where none are set; empty: none")
    if recording:
        with BagReader(Path(recording)) as reader:
            segmenter = with_recorded_rules(segmenter, reader.note(RULES_NOTE))
    gates = declare_config(node, GateConfig(), "gates.")
    return IngestConfig(poses.tracker(body, poses.board_frame), segmenter, gates, declare_config(node, NO_CORRECTION, "rig."))


def declared_type(node: StageNode) -> str:
    """Declares the type of the pose topic; empty for that of its publisher.

    Raises:
        UnknownNameError: messages of that type cannot be read as poses.
    """
    given = declare(node, "type", "", "ROS type of the pose topic, e.g. nav_msgs/msg/Odometry; empty: as its publisher says")
    package, _, name = given.partition("/")
    full = given if not given or "/msg/" in given else f"{package}/msg/{name}"
    if full and full not in READ_TYPES:
        raise UnknownNameError("message type", given, READ_TYPES)
    return str(full)


def main() -> int:
    """Runs the node."""
    return run(PoseIngest, "pose_ingest")


if __name__ == "__main__":
    sys.exit(main())
