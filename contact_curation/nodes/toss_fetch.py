"""Fetches tosses by id from the node that stores them, and repeats requests until it has them."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from contact_curation_msgs.srv import GetTosses
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future

from contact_curation.nodes.ros.catch_up import PATIENCE, PERIOD
from contact_curation.nodes.ros.worker import Worker

PAGE = 16
"""Largest number of tosses in a request."""


class TossFetch:
    """Fetches missing tosses, one page per request, and requests again once a second while some are missing.

    Args:
        node: node that sends the requests.
        worker: worker that handles the responses; `missing` and `handle` are called on it only.
        missing: returns the ids that are needed now.
        handle: takes the messages of a page, and the ids that the server does not know.
    """

    def __init__(
        self,
        node: Node,
        worker: Worker,
        missing: Callable[[], Sequence[str]],
        handle: Callable[[Sequence[Any], Sequence[str]], None],
    ) -> None:
        self._worker = worker
        self._missing = missing
        self._handle = handle
        self._asked: Future | None = None
        self._silent = 0
        self._client = node.create_client(GetTosses, "get_tosses")
        node.create_timer(PERIOD, partial(worker.do, self._tick), clock=Clock(clock_type=ClockType.STEADY_TIME))

    def ask(self) -> None:
        """Requests the next page, unless nothing is missing, a request is under way, or the service is not there."""
        if self._asked is not None or not self._client.service_is_ready():
            return
        wanted = list(self._missing()[:PAGE])
        if wanted:
            self._silent = 0
            self._asked = self._client.call_async(GetTosses.Request(toss_ids=wanted))
            self._asked.add_done_callback(lambda future: self._worker.do(partial(self._answered, future)))

    def _tick(self) -> None:
        self._silent += 1
        if self._asked is not None and self._silent > PATIENCE:  # the server was killed
            self._client.remove_pending_request(self._asked)
            self._asked = None
        self.ask()

    def _answered(self, future: Future) -> None:
        if self._asked is None or future is not self._asked:
            return
        self._asked = None
        response = future.result()
        self._handle(response.tosses, response.unknown_ids)
        if response.tosses:
            self.ask()
