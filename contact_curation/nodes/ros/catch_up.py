"""Receives numbered messages, each once and in order, from a topic and the service that gives them on request.

A node stores what it publishes, and numbers it from 1. The topic is fast, the service is complete. A listener that starts late,
was killed, or finds a number missing requests from the service what follows its last message. It also does so once a second,
which costs little and finds messages that were stored but never announced. If the store was re-created, numbers start from 1
again, and everything is requested. A number that comes again may be a sign of that, so the source is asked what has the number
of the cursor. While messages of the former store are still on their way, the two stores' numbers mix: a number that comes with
another record, or a record with another number, shows that, and everything is requested, too.
"""

import threading
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future

from contact_curation.errors import InvalidValueError
from contact_curation.nodes.ros.qos import RESULTS_DEPTH, latched
from contact_curation.nodes.ros.throttled_warnings import ThrottledWarnings
from contact_curation.nodes.ros.worker import Worker
from contact_curation.stages.records import Cursor

PERIOD = 1.0
"""Time between requests when nothing is missing [s]."""

REMEMBERED = 256
"""Number of last messages whose numbers are compared with those that come."""

PATIENCE = 5
"""Number of periods after which a request without a response is repeated, because the server was killed."""


@dataclass(frozen=True)
class Source:
    """Topic and service of numbered messages.

    Attributes:
        message: type of the messages, which have the fields `sequence` and `toss_id`.
        topic: topic that announces them.
        service: type of the service; its request has `after_sequence` and `limit`, its response `last_sequence`.
        service_name: name of the service.
        field: field of the response that contains the messages.
        page: largest number of messages in a response.
        read: makes a message of its bytes, where arrays are faster than rclpy's objects; None to take rclpy's.
    """

    message: Any
    topic: str
    service: Any
    service_name: str
    field: str
    page: int
    read: Callable[[bytes], Any] | None = None


class CatchUp:
    """Follows a source from a cursor on.

    Args:
        node: node that subscribes.
        worker: worker that handles the messages.
        source: topic and service to follow.
        cursor: last message that an earlier run handled; it is compared with the source before it is used.
        handle: called on the worker with messages in order, and the cursor after them.
        caught_up: called on the worker whenever the source has confirmed that nothing is missing.
    """

    def __init__(
        self,
        node: Node,
        worker: Worker,
        source: Source,
        cursor: Cursor,
        handle: Callable[[Sequence[Any], Cursor], None],
        caught_up: Callable[[], None] = lambda: None,
    ) -> None:
        self._warnings = ThrottledWarnings(node)
        self._worker = worker
        self._source = source
        self._handle = handle
        self._caught_up = caught_up
        self._cursor = self._handled = cursor
        self._newest = cursor.sequence
        self._taken = deque[Cursor](maxlen=REMEMBERED)
        self._confirmed = cursor.sequence == 0
        self._checking = False
        self._generation = 0
        self._lock = threading.RLock()
        self._asked: Future | None = None
        self._silent = 0
        self._client = node.create_client(source.service, source.service_name)
        raw = source.read is not None
        node.create_subscription(source.message, source.topic, self._heard, latched(RESULTS_DEPTH), raw=raw)
        node.create_timer(PERIOD, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))

    @property
    def cursor(self) -> Cursor:
        """Position after the last message that was passed to the worker."""
        return self._cursor

    @property
    def complete(self) -> bool:
        """Whether all messages that the source is known to have were handled."""
        return self._handled.sequence >= self._newest

    def restart(self) -> None:
        """Requests everything again from the first message on, and drops what waits for the worker."""
        with self._lock:
            self._generation += 1
            self._begin_anew()
            self._drop_question()
        self._ask()

    def _begin_anew(self) -> None:
        self._cursor, self._handled, self._confirmed = Cursor(), Cursor(), True
        self._taken.clear()

    def _heard(self, heard: Any) -> None:
        """Takes a message of the topic if it is the next one; otherwise sends a request."""
        try:
            message = heard if self._source.read is None else self._source.read(heard)
        except InvalidValueError:  # the service has it whole
            self._ask()
            return
        if message.sequence < 1:
            self._warnings.note("bad number", f"message of {message.toss_id}: found sequence 0, expected 1 or more")
            return
        with self._lock:
            self._newest = max(self._newest, message.sequence)
            if self._contradicts(message):
                self._begin_anew()
                self._drop_question()
            elif self._confirmed and message.sequence == self._cursor.sequence + 1:
                self._take([message])
                return
            elif message.sequence <= self._cursor.sequence and _cursor_at(message) != self._cursor:
                self._confirmed = False
            missing = not self._confirmed or message.sequence > self._cursor.sequence
        if missing:
            self._ask()

    def _tick(self) -> None:
        with self._lock:
            self._silent = self._silent + 1 if self._asked is not None else 0
            if self._silent > PATIENCE:
                self._drop_question()
        if self._worker.waiting == 0:
            self._ask()

    def _ask(self) -> None:
        """Requests the next page, unless a request is under way or the service is not there."""
        with self._lock:
            if self._asked is not None:
                return
            if not self._client.service_is_ready():  # after a crash of its machine the server may lack its last records
                self._confirmed = self._cursor.sequence == 0
                return
            self._checking = not self._confirmed
            after = self._cursor.sequence - self._checking
            request = self._source.service.Request(after_sequence=after, limit=self._source.page)
            self._silent = 0
            self._asked = self._client.call_async(request)
            self._asked.add_done_callback(self._answered)

    def _answered(self, future: Future) -> None:
        with self._lock:
            if self._asked is None or future is not self._asked:
                return
            self._asked = None
            response = future.result()
            messages = list(getattr(response, self._source.field))
            self._newest = response.last_sequence
            if not self._confirmed and not self._checking:
                more = True  # doubted since the question was asked
            elif any(map(self._contradicts, messages)) or not self._same_source(messages, response.last_sequence):
                self._begin_anew()
                more = True
            else:
                fresh = [message for message in messages if message.sequence > self._cursor.sequence]
                self._take(fresh)
                more = bool(fresh) and self._cursor.sequence < response.last_sequence
        # Queued after the messages of this page, so that pages do not accumulate.
        self._worker.do(self._ask if more else self._say_caught_up)

    def _same_source(self, messages: Sequence[Any], last_sequence: int) -> bool:
        """Whether the cursor belongs to this source; a re-created store has another toss at its number, or none."""
        if self._checking:
            first = messages[0] if messages else None
            self._confirmed = first is not None and _cursor_at(first) == self._cursor
            return self._confirmed
        return last_sequence >= self._cursor.sequence

    def _contradicts(self, message: Any) -> bool:
        """Whether its number came with another record before, or its record with another number."""
        here = _cursor_at(message)
        return any((one.sequence == here.sequence) != (one[1:] == here[1:]) for one in self._taken)

    def _take(self, messages: Sequence[Any]) -> None:
        if messages:
            self._taken.extend(map(_cursor_at, messages))
            self._cursor = self._taken[-1]
            self._worker.do(partial(self._hand_over, self._generation, messages, self._cursor))

    def _hand_over(self, generation: int, messages: Sequence[Any], cursor: Cursor) -> None:
        if generation == self._generation:
            self._handle(messages, cursor)
            self._handled = cursor

    def _say_caught_up(self) -> None:
        if self.complete:
            self._caught_up()

    def _drop_question(self) -> None:
        if self._asked is not None:
            self._client.remove_pending_request(self._asked)
            self._asked = None


def _cursor_at(message: Any) -> Cursor:
    """Position after a message of a toss, or of its information."""
    return Cursor(message.sequence, message.toss_id, getattr(message, "parameters_version", ""))
