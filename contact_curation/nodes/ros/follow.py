"""Receives numbered messages for a node that may miss some, and requests those from the service later.

`catch_up.CatchUp` queues everything in order. Here a message for which the node has no room is dropped and requested later, so
that a node that cannot keep up holds a bounded number of messages. They may come twice and in any order.
"""

from collections.abc import Callable
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future

from contact_curation.nodes.ros.catch_up import PATIENCE, PERIOD, Source
from contact_curation.nodes.ros.qos import latched

HELD = 4096
"""Depth of the subscription's queue; far more than nodes keep for late subscribers."""


class Follow:
    """Follows a source.

    Args:
        node: node that subscribes.
        source: topic and service to follow.
        offer: takes a batch of messages; returns False if there is no room for it.
        idle: returns whether there is time to request missed messages.
        newest: number of earlier messages to request at the start; None for all.
    """

    def __init__(
        self,
        node: Node,
        source: Source,
        offer: Callable[[str, list[Any]], bool],
        idle: Callable[[], bool],
        newest: int | None = None,
    ) -> None:
        self._source = source
        self._offer = offer
        self._idle = idle
        self._newest = newest
        self._taken = 0
        self._asked: Future[Any] | None = None
        self._silent = 0
        self._client = node.create_client(source.service, source.service_name)
        node.create_subscription(source.message, source.topic, self._heard, latched(HELD))
        node.create_timer(PERIOD, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _heard(self, message: Any) -> None:
        if self._offer(self._source.topic, [message]) and message.sequence == self._taken + 1:
            self._taken = message.sequence

    def _tick(self) -> None:
        self._silent += 1
        if self._asked is not None and self._silent > PATIENCE:  # the server was killed
            self._client.remove_pending_request(self._asked)
            self._asked = None
        self._ask()

    def _ask(self) -> None:
        if self._asked is None and self._idle() and self._client.service_is_ready():
            self._silent = 0
            request = self._source.service.Request(after_sequence=self._taken, limit=self._source.page)
            self._asked = asked = self._client.call_async(request)
            asked.add_done_callback(self._answered)

    def _answered(self, future: "Future[Any]") -> None:
        if self._asked is None or future is not self._asked:
            return
        self._asked = None
        response: Any = future.result()
        start = response.last_sequence - self._newest if self._newest is not None else 0
        messages = list(getattr(response, self._source.field))
        if response.last_sequence < self._taken:  # the store was re-created
            self._taken = 0
        elif self._taken < start:
            self._taken = start
        elif not messages:
            return
        elif self._offer(self._source.topic, messages):
            self._taken = max(self._taken, messages[-1].sequence)
        self._ask()
