"""A node's state at 1 Hz on /diagnostics, for rqt_robot_monitor and the dashboard."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from contact_curation.motion.toss import NANOSECONDS
from contact_curation.nodes.ros.qos import profile

PERIOD = 1.0
"""[s] of the steady clock: it also goes on where simulated time stands still."""


class Health(NamedTuple):
    """The state of a node.

    Attributes:
        message: one line.
        values: details by name.
        warning: whether someone should look.
    """

    message: str
    values: Mapping[str, Any]
    warning: bool = False


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


class HealthReport:
    """Publishes what `look` gives, once a second."""

    def __init__(self, node: Node, look: Callable[[], Health]) -> None:
        self._node = node
        self._look = look
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", profile(10, reliable=True, latched=False))
        node.create_timer(PERIOD, self._report, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _report(self) -> None:
        health = self._look()
        status = DiagnosticStatus(
            level=DiagnosticStatus.WARN if health.warning else DiagnosticStatus.OK,
            name=self._node.get_fully_qualified_name(),
            message=health.message,
            values=[KeyValue(key=key, value=str(value)) for key, value in health.values.items()],
        )
        array = DiagnosticArray(status=[status])
        array.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(array)
