"""A node's state at 1 Hz on /diagnostics, for diagnostic_aggregator, rqt_robot_monitor and the dashboard.

A status is named `node: what it reports on`, as diagnostic_updater names it, with the namespace before the node; its keys are
words that stay the same. What a node waits for is also said in its log: soon after it began to wait, and then ever more seldom.
"""

import re
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from contact_curation.motion.toss import NANOSECONDS
from contact_curation.nodes.ros.qos import profile

PERIOD = 1.0
"""[s] of the steady clock: it also goes on where simulated time stands still."""

FIRST_WORD, LONGEST_PAUSE = 5.0, 600.0
"""[s] that a node waits before it says so, and between two such lines at most."""

PACKAGE = KeyValue(key="package", value="contact_curation")
"""By which statuses of these nodes are told from others'."""

NO_WORD = re.compile(r"\W+")
"""What is no part of a key."""


class Health(NamedTuple):
    """The state of a node.

    Attributes:
        message: one line.
        values: details by name.
        warning: whether someone should look.
        waiting_for: what it cannot go on without; empty where nothing is missing.
    """

    message: str
    values: Mapping[str, Any]
    warning: bool = False
    waiting_for: str = ""


class Rate:
    """Counts what happens, and how often since it was asked last."""

    def __init__(self) -> None:
        self.count = 0
        self._clock = Clock(clock_type=ClockType.STEADY_TIME)
        self._before = (0, self._clock.now().nanoseconds)

    def per_second(self) -> float:
        """Since the last call, or the start."""
        (count, then_ns), self._before = self._before, (self.count, self._clock.now().nanoseconds)
        elapsed_ns: int = self._before[1] - then_ns
        return (self.count - count) * NANOSECONDS / max(elapsed_ns, 1)


class Waiting:
    """When a node that waits says so: after a while, and then after pauses that double.

    Args:
        say: logs a line.
        now: steady time [s].
    """

    def __init__(self, say: Callable[[str], None], now: Callable[[], float]) -> None:
        self._say, self._now = say, now
        self._what = ""
        self._due = self._pause = 0.0

    def look(self, what: str) -> None:
        """Takes what the node waits for now; empty where nothing is missing."""
        if what != self._what:
            self._what, self._pause = what, FIRST_WORD
            self._due = self._now() + FIRST_WORD
        elif what and self._now() >= self._due:
            self._say(f"waiting for {what}")
            self._pause = min(2.0 * self._pause, LONGEST_PAUSE)
            self._due = self._now() + self._pause


class HealthReport:
    """Publishes what `look` gives, once a second.

    Args:
        node: that reports.
        about: what it reports on, in a word.
        look: gives its health.
        body: that the node works on, which stands for the hardware.
    """

    def __init__(self, node: Node, about: str, look: Callable[[], Health], body: str = "none") -> None:
        self._node = node
        self._look = look
        self._name = f"{node.get_fully_qualified_name().lstrip('/')}: {about}"
        self._body = body
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._waiting = Waiting(node.get_logger().info, lambda: float(steady.now().nanoseconds) / NANOSECONDS)
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", profile(10, reliable=True, latched=False))
        node.create_timer(PERIOD, self._report, clock=steady)

    def _report(self) -> None:
        health = self._look()
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
    """A key of a status: words, joined by underscores."""
    return NO_WORD.sub("_", name).strip("_")


def node_of(status: str) -> str:
    """The full name of the node that a status is of."""
    return f"/{status.partition(':')[0].lstrip('/')}"


def awaited(node: Node, what: str, topic: str) -> str:
    """What a node waits for, where it comes from, and that nobody is there to send it."""
    name = node.resolve_topic_name(topic)
    return f"{what} on {name}" + ("" if node.count_publishers(name) else ", which nobody publishes")
