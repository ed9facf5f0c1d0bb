"""Publishes a node's health at 1 Hz on /diagnostics, for diagnostic_aggregator, rqt_robot_monitor and the dashboard.

A status is named `node: subject`, as by diagnostic_updater, with the namespace before the node; its keys never change. What a
node waits for is also logged: after a few seconds, and then at growing intervals.
"""

import re
from collections import deque
from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from contact_curation.motion.toss import NANOSECONDS
from contact_curation.nodes.ros.qos import profile

PERIOD = 1.0
"""Time between two reports on the steady clock, which continues when simulated time stands still [s]."""

FIRST_WORD, LONGEST_PAUSE = 5.0, 600.0
"""Time before a node logs what it waits for, and longest time between two such lines [s]."""

RIVALS_AFTER = 30
"""Reports for which another publisher must be there: Fast DDS counts that of a killed node for 20 s more."""

RESULTS = "contact_curation_msgs."
"""Modules of the messages in which nodes publish results."""

LOOKS = 4
"""Number of intervals of `Flow`: poses may wait for transforms for a while."""

PACKAGE = KeyValue(key="package", value="contact_curation")
"""Key that identifies statuses of this package's nodes."""

NO_WORD = re.compile(r"\W+")
"""Characters that are not part of a key."""


NUMBER = re.compile(r"\d+(\.\d+)?(e[+-]?\d+)?")


class Health(NamedTuple):
    """The health of a node.

    Attributes:
        message: summary in one line.
        values: details by name.
        warning: whether the level of the status is WARN.
        waiting_for: what the node waits for; empty if it waits for nothing.
    """

    message: str
    values: Mapping[str, Any]
    warning: bool = False
    waiting_for: str = ""


class Rate:
    """Counts events, and their rate since the last query."""

    def __init__(self) -> None:
        self.count = 0
        self._clock = Clock(clock_type=ClockType.STEADY_TIME)
        self._before = (0, self._clock.now().nanoseconds)

    def per_second(self) -> float:
        """Events per second since the last call, or since the start."""
        (count, then_ns), self._before = self._before, (self.count, self._clock.now().nanoseconds)
        elapsed_ns: int = self._before[1] - then_ns
        return (self.count - count) * NANOSECONDS / max(elapsed_ns, 1)


class Flowing(NamedTuple):
    """What comes, over some looks.

    Attributes:
        messages: rate [1/s].
        share: of the messages, poses for each.
        poses: rate by their stamps [1/s]: simulated or recorded time may run at any rate.
    """

    messages: float
    share: float
    poses: float


class Flow:
    """How many messages and poses come, over the last looks, which are a second apart."""

    def __init__(self) -> None:
        self._looks: deque[tuple[int, int, int | None, float]] = deque(maxlen=LOOKS + 1)

    def look(self, messages: int, poses: int, newest_ns: int | None, now: float) -> Flowing | None:
        """What comes; None as long as looks are too few, or while no message came between two of them.

        Args:
            messages: since the start.
            poses: that came of them since the start.
            newest_ns: stamp of the newest of them; None before the first.
            now: time of a steady clock [s].
        """
        self._looks.append((messages, poses, newest_ns, now))
        looks = [*self._looks]
        if len(looks) <= LOOKS or any(one[0] == later[0] for one, later in pairwise(looks)):
            return None
        first, last = looks[0], looks[-1]
        came, placed = last[0] - first[0], last[1] - first[1]
        stamped_ns = 0 if first[2] is None or last[2] is None else last[2] - first[2]
        return Flowing(came / max(last[3] - first[3], 1e-9), placed / came, placed * NANOSECONDS / max(stamped_ns, 1))


class Waiting:
    """Logs what a node waits for: after a few seconds, and then at intervals that double.

    Args:
        say: logs a line.
        now: gives the time of a steady clock [s].
    """

    def __init__(self, say: Callable[[str], None], now: Callable[[], float]) -> None:
        self._say, self._now = say, now
        self._kind = ""
        self._due = self._pause = 0.0

    def look(self, what: str) -> None:
        """Updates what the node waits for now; empty for nothing. Numbers in it, such as rates, may differ."""
        if (kind := NUMBER.sub("", what)) != self._kind:
            self._kind, self._pause = kind, FIRST_WORD
            self._due = self._now() + FIRST_WORD
        elif what and self._now() >= self._due:
            self._say(f"waiting for {what}")
            self._pause = min(2.0 * self._pause, LONGEST_PAUSE)
            self._due = self._now() + self._pause


class Rivals:
    """Notices another publisher of a result that its subscribers take from one node alone, as of a node that runs twice.

    Args:
        node: node with the results.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._reports = 0

    def look(self) -> str:
        """What is wrong, if it has been so for a while; empty for nothing. It is logged once."""
        topics = [one.topic_name for one in self._node.publishers if one.msg_type.__module__.startswith(RESULTS)]
        doubled = [f"{topic} ({count} times)" for topic in topics if (count := self._node.count_publishers(topic)) > 1]
        self._reports = self._reports + 1 if doubled else 0
        if self._reports < RIVALS_AFTER:
            return ""
        words = f"found others that publish {', '.join(doubled)}, expected this node alone: end them, or rename their topics"
        if self._reports == RIVALS_AFTER:
            self._node.get_logger().warning(words)
        return words


class HealthReport:
    """Publishes the health that `look` returns once a second.

    Args:
        node: node that reports.
        about: subject of the report, one word.
        look: returns the node's health.
        body: name of the node's body, published as `hardware_id`.
    """

    def __init__(self, node: Node, about: str, look: Callable[[], Health], body: str = "none") -> None:
        self._node = node
        self._look = look
        self._name = f"{node.get_fully_qualified_name().lstrip('/')}: {about}"
        self._body = body
        self._rivals = Rivals(node)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._waiting = Waiting(node.get_logger().info, lambda: float(steady.now().nanoseconds) / NANOSECONDS)
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", profile(10, reliable=True, latched=False))
        node.create_timer(PERIOD, self._report, clock=steady)

    def _report(self) -> None:
        health = self._look()
        if rivals := self._rivals.look():
            health = health._replace(message=f"{health.message}; {rivals}", warning=True)
        self._waiting.look(health.waiting_for)
        status = DiagnosticStatus(
            level=DiagnosticStatus.WARN if health.warning else DiagnosticStatus.OK,
            name=self._name,
            message=health.message,
            hardware_id=self._body,
            values=[PACKAGE, *(KeyValue(key=key_of(name), value=str(value)) for name, value in health.values.items())],
        )
        array = DiagnosticArray(status=[status])
        array.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(array)


def key_of(name: str) -> str:
    """Makes a key of a status from a name: words joined by underscores."""
    return NO_WORD.sub("_", name).strip("_")


def node_of(status: str) -> str:
    """The full name of a status's node."""
    return f"/{status.partition(':')[0].lstrip('/')}"


def awaited(node: Node, what: str, topic: str) -> str:
    """Says what a node waits for, on which topic, and whether anybody publishes it, as a type that the node subscribes to."""
    name = node.resolve_topic_name(topic)
    found = {one.topic_type for one in node.get_publishers_info_by_topic(name)}
    expected = {_type_name(one.msg_type) for one in node.subscriptions if one.topic_name == name}
    if not found:
        return f"{what} on {name}, which nobody publishes"
    if expected and not expected & found:
        return f"{what} on {name}: found {', '.join(sorted(found))} there, expected {', '.join(sorted(expected))}"
    return f"{what} on {name}"


def _type_name(message: type) -> str:
    return f"{message.__module__.partition('.')[0]}/msg/{message.__name__}"
