"""Sends ExecuteThrow goals, one at a time; the outcome of each is reported exactly once, whatever happens to the thrower."""

import threading
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

from action_msgs.msg import GoalStatus
from contact_curation_msgs.action import ExecuteThrow
from rclpy.action import ActionClient
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future

from contact_curation.motion.toss import NANOSECONDS
from contact_curation.nodes.ros.own_namespace import action_name

LONGEST_REASON = 400
"""Characters of a thrower's message that are passed on."""


class Outcome(NamedTuple):
    """The outcome of a goal: the message of the executed throw, or None and the reason."""

    executed: Any
    message: str


class ThrowGoals:
    """Sends one goal after the other to `execute_throw`.

    Use it on the executor's thread only: if another thread sends, the response may come before the client waits for it, and is
    lost.

    Args:
        node: node that sends.
        told: called once per goal with its outcome, on the executor's thread.
        patience: a goal without feedback and result for this time on the steady clock is given up [s].
    """

    def __init__(self, node: Node, told: Callable[[Outcome], None], patience: float) -> None:
        self._name = action_name(node, "execute_throw")
        self._client = ActionClient(node, ExecuteThrow, self._name)
        self._servers = partial(node.count_services, node.resolve_service_name(f"{self._name}/_action/send_goal"))
        self._told = told
        self._patience = patience
        self._clock = Clock(clock_type=ClockType.STEADY_TIME)
        self._lock = threading.RLock()
        self._heard_ns: int | None = None
        self._handle: Any = None
        self._number = 0

    @property
    def missing(self) -> str:
        """What the next goal has to wait for; empty for nothing. A goal goes to all servers of its action at once."""
        if not self._client.server_is_ready():
            return f"a thrower (action {self._name})"
        servers = self._servers()
        return "" if servers <= 1 else f"a single thrower: found {servers} servers of {self._name}, which would all throw"

    @property
    def busy(self) -> bool:
        """Whether a goal is under way."""
        return self._heard_ns is not None

    def send(self, throw: Any) -> None:
        """Commands a throw, given as a message; no other goal may be under way."""
        with self._lock:
            self._number += 1
            number, self._heard_ns = self._number, self._clock.now().nanoseconds
            goal = ExecuteThrow.Goal(throw_command=throw)
            future = self._client.send_goal_async(goal, feedback_callback=lambda _: self._heard(number))
        future.add_done_callback(lambda done: self._answered(number, done))

    def look(self) -> None:
        """Gives up a goal that is silent for too long or whose thrower is gone; call it regularly."""
        with self._lock:
            if self._heard_ns is None:
                return
            waited = (self._clock.now().nanoseconds - self._heard_ns) / NANOSECONDS
            gone = not self._client.server_is_ready()
            handle = self._handle
        if gone or waited > self._patience:
            if handle is not None and not gone:
                handle.cancel_goal_async()
            self._end(
                self._number,
                Outcome(None, "the thrower is gone" if gone else f"no feedback or result for {self._patience:g} s"),
            )

    def _heard(self, number: int) -> None:
        """Notes feedback, after which the time limit starts again; a simulated thrower may be slow on a busy machine."""
        with self._lock:
            if self._heard_ns is not None and number == self._number:
                self._heard_ns = self._clock.now().nanoseconds

    def _answered(self, number: int, future: Future) -> None:
        handle = future.result()
        if not handle.accepted:
            self._end(number, Outcome(None, "the thrower rejected the goal"))
            return
        with self._lock:
            given_up = self._heard_ns is None or number != self._number
            if not given_up:
                self._handle = handle
        if given_up:
            handle.cancel_goal_async()
            return
        handle.get_result_async().add_done_callback(lambda done: self._resulted(number, done))

    def _resulted(self, number: int, future: Future) -> None:
        status, result = future.result().status, future.result().result
        if status == GoalStatus.STATUS_SUCCEEDED and result.success:
            self._end(number, Outcome(result.executed, result.message))
        else:
            self._end(number, Outcome(None, _why(result)))

    def _end(self, number: int, outcome: Outcome) -> None:
        """Reports the outcome of a goal, once."""
        with self._lock:
            if self._heard_ns is None or number != self._number:
                return
            self._heard_ns, self._handle = None, None
        self._told(outcome)


def _why(result: Any) -> str:
    """Why a throw was not made, in one line, as its result has it."""
    said = " ".join(result.message.split())[:LONGEST_REASON] or "the thrower gave no reason"
    return f"its result says success, but its goal was not succeeded ({said})" if result.success else said
