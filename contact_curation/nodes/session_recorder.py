"""Node `session_recorder`: records every topic of the graph into one bag, as the bytes that were sent.

It finds the topics in the graph and subscribes with the quality of service of their publishers. Messages should never be lost:
queues are deep, one thread receives and another writes, and lost messages are counted. After a kill, what was written can be
read; the restarted recorder continues the same bag, and latched publishers send again what it missed.
"""

import sys
from collections import deque
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks

from contact_curation.errors import InvalidValueError, MissingDependencyError
from contact_curation.nodes.ros.health import Health, HealthReport, Rate
from contact_curation.nodes.ros.message_definition import definition_text
from contact_curation.nodes.ros.node_main import StageNode, run
from contact_curation.nodes.ros.own_namespace import is_own
from contact_curation.nodes.ros.parameters import declare
from contact_curation.nodes.ros.qos import Callback, FollowedTopic, Offer
from contact_curation.nodes.ros.throttled_warnings import ThrottledWarnings
from contact_curation.nodes.ros.worker import Latest, Worker
from contact_curation.storage.bags.records import OfferedQos, RawMessage
from contact_curation.storage.bags.session import SessionBag

LOOK_PERIOD = 0.2
"""Time between looks at the graph [s]."""

FLUSHES_AFTER = 10
"""After a toss, one at each look at the graph: a busy machine delivers poses of a toss later than the toss."""

SCHEMA_ENCODING = "ros2msg"

RESULT = "contact_curation_msgs/msg/Toss"
"""Type of a result that `pose_ingest` has stored: the poses that it was made of must be on disk, too, however all end."""


class Heard(NamedTuple):
    """A topic that is recorded.

    Attributes:
        type: ROS type name.
        schema: definition of the type.
        type_hash: hash of the type, `RIHS01_...`.
        qos: quality of service that all of its publishers offer.
    """

    type: str
    schema: str
    type_hash: str
    qos: OfferedQos


class SessionRecorder(StageNode):
    """Records all topics of its namespace that are not hidden."""

    longest_closing = 9.0
    """Time limit of closing [s], in which received messages and the recording's index are written."""

    def __init__(self) -> None:
        super().__init__("session_recorder")
        path = declare(self, "bag", "", "file to record into, *.mcap; an existing file is continued")
        self._depth = declare(self, "queue_depth", 16384, "messages per topic that wait to be processed", bounds=(1, 1 << 20))
        self._most = declare(
            self, "memory", 1 << 28, "largest number of bytes that wait to be written", bounds=(1 << 20, 1 << 40)
        )
        period = declare(
            self, "flush_period", 1.0, "messages older than this are in the file and survive a kill [s]", bounds=(0.01, 60.0)
        )
        if Path(path).suffix != ".mcap":
            raise InvalidValueError("parameter bag", repr(path), "a file name ending in .mcap")
        self._warnings = ThrottledWarnings(self)
        self._received = Rate()
        self._lost = self._known = 0
        self._bytes_in = self._bytes_out = 0  # each is changed by one thread only
        self._waiting: deque[tuple[RawMessage, OfferedQos]] = deque()
        self._topics: dict[str, FollowedTopic] = {}
        self._left_out: set[tuple[str, str]] = set()
        self._flushes_due = 0
        self._bag: SessionBag | None = None
        self._worker = Worker(self.fail)
        self._worker.do(lambda: self._open(Path(path)))
        self._writing = Latest(self._worker, self._write)
        self._flushing = Latest(self._worker, self._flush)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(LOOK_PERIOD, self._follow, clock=steady)
        self.create_timer(period, self._flushing.want, clock=steady)
        HealthReport(self, "recording", self._health)

    def close(self) -> None:
        self._worker.do(self._write)
        self._worker.stop()
        if self._bag is not None:
            self._bag.close()

    def _follow(self) -> None:
        """Subscribes to topics that are new or whose quality of service changed."""
        if self._flushes_due:
            self._flushes_due -= 1
            self._flushing.want()
        for topic, types in self.get_topic_names_and_types():
            hidden = any(part.startswith("_") for part in topic.split("/"))
            if hidden or not is_own(self, topic) or not self.count_publishers(topic):
                continue
            for more in types[1:]:
                self._leave_out(topic, more, f"found the types {', '.join(types)}, expected one")
            if topic not in self._topics:
                events = SubscriptionEventCallbacks(message_lost=self._missed)
                listener = partial(self._listener, topic)
                self._topics[topic] = FollowedTopic(self, topic, self._depth, listener, event_callbacks=events, raw=True)
            try:
                self._topics[topic].follow(types[0])
            except MissingDependencyError as error:
                self._leave_out(topic, types[0], str(error))

    def _leave_out(self, topic: str, kind: str, why: str) -> None:
        """Logs once that a topic is not recorded."""
        if (topic, kind) not in self._left_out:
            self._left_out.add((topic, kind))
            self._warnings.note("left out", f"{kind} on {topic}: {why}")

    def _listener(self, topic: str, offer: Offer) -> Callback:
        offers = [info for info in self.get_publishers_info_by_topic(topic) if info.topic_type == offer.type]
        type_hash = str(offers[0].topic_type_hash) if offers else ""
        heard = Heard(offer.type, definition_text(offer.type), type_hash, offer.qos)
        return partial(self._arrived, topic, heard)

    def _arrived(self, topic: str, heard: Heard, data: bytes, info: Mapping[str, int]) -> None:
        """Queues a message. One that was kept for late subscribers gets its time of publication, so that the order is right."""
        self._received.count += 1
        if self._bytes_in - self._bytes_out > self._most:
            self._lost += 1
            return
        published_ns, received_ns = info["source_timestamp"], info["received_timestamp"]
        logged_ns = published_ns if heard.qos.latched else received_ns
        message = RawMessage(topic, heard.type, logged_ns, data, published_ns, heard.schema, SCHEMA_ENCODING, heard.type_hash)
        self._bytes_in += len(data)
        self._waiting.append((message, heard.qos))
        self._writing.want()
        if heard.type == RESULT:
            self._flushes_due = FLUSHES_AFTER
            self._flushing.want()

    def _missed(self, event: Any) -> None:
        self._lost += event.total_count_change

    def _open(self, path: Path) -> None:
        """Opens the bag on the worker's thread, as the methods below: reading a long bag takes a while, and messages come."""
        self._bag = SessionBag(path)
        for line in self._bag.losses:
            self.get_logger().warning(line)

    def _write(self) -> None:
        assert self._bag is not None  # opened first
        for _ in range(len(self._waiting)):
            message, qos = self._waiting.popleft()
            self._bytes_out += len(message.data)
            self._known += not self._bag.write(message, qos)

    def _flush(self) -> None:
        assert self._bag is not None
        self._bag.flush()

    def _health(self) -> Health:
        written = 0 if self._bag is None else self._bag.written
        topics = sum(one.offer is not None for one in self._topics.values())
        values = {
            "written": written,
            "lost": self._lost,
            "known": self._known,
            "topics": topics,
            "queue": len(self._waiting),
            "rate_hz": f"{self._received.per_second():.0f}",
            **self._warnings.counts,
        }
        missing = "" if topics else "topics of the graph to record"
        said = f"{written} messages of {topics} topics, {self._lost} lost"
        return Health(said, values, warning=self._lost > 0, waiting_for=missing)


def main() -> int:
    """Runs the node."""
    return run(SessionRecorder, "session_recorder")


if __name__ == "__main__":
    sys.exit(main())
