"""A client of sim_arm, for tests: arms it, sends it throws, and waits for what becomes of them."""

import time
from collections.abc import Sequence
from typing import Any

from contact_curation_msgs.action import ExecuteThrow
from nav_msgs.msg import Odometry
from rclpy.action import ActionClient
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from contact_curation.design.throw import Throw
from contact_curation.nodes.messages.headers import Stamped
from contact_curation.nodes.messages.throw import throw_message
from contact_curation.nodes.qos import profile
from test.graph.graph import Graph

LONG = 60.0
SETTLING = 0.7
"""From seeing a server to being seen by it [s]."""


class Goal:
    """A goal that was sent.

    Args:
        future: of its acceptance.
        phases: that its feedback told, in their order.
    """

    def __init__(self, future: Any, phases: list[str]) -> None:
        self.phases = phases
        self.answer: Any = None
        self.handle: Any = None
        future.add_done_callback(self._taken)

    def _taken(self, future: Any) -> None:
        self.handle = future.result()
        self.handle.get_result_async().add_done_callback(self._ended)

    def _ended(self, future: Any) -> None:
        self.answer = future.result()


class Thrower:
    """Talks to the one sim_arm of a graph."""

    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        self._client = ActionClient(graph.listener.node, ExecuteThrow, "execute_throw")
        qos = profile(2000, reliable=True, latched=False)
        self.truth: list[Any] = []
        self.joints: list[Any] = []
        graph.listener.node.create_subscription(Odometry, "ground_truth", self.truth.append, qos)
        graph.listener.node.create_subscription(JointState, "/joint_states", self.joints.append, qos)

    def trigger(self, name: str) -> str:
        """Calls one of the services `arm` and `stop`."""
        return str(self._graph.listener.call(Trigger, f"/sim_arm/{name}", Trigger.Request(), LONG).message)

    def send(self, throw: Throw | Any) -> Goal:
        """Sends a throw, a record or a message."""
        self._await_server()
        phases: list[str] = []

        def told(message: Any) -> None:
            if not phases or phases[-1] != message.feedback.phase:
                phases.append(message.feedback.phase)

        message = throw_message(throw, Stamped(0, "body_surface")) if isinstance(throw, Throw) else throw
        return Goal(self._client.send_goal_async(ExecuteThrow.Goal(throw_command=message), told), phases)

    def ended(self, goal: Goal) -> Any:
        """Waits for a goal's end; its status and result."""
        self._graph.until(lambda: goal.answer is not None, LONG, "the end of a goal")
        return goal.answer

    def until_phase(self, goal: Goal, phase: str) -> None:
        self._graph.until(lambda: phase in goal.phases, LONG, f"phase {phase}")

    def _await_server(self) -> None:
        """A server that is seen may not see its client yet, and its answer would be lost."""
        if not self._client.server_is_ready():
            assert self._client.wait_for_server(LONG), self._graph.logs()
            time.sleep(SETTLING)

    def close(self) -> None:
        self._client.destroy()


def speeds(joints: Sequence[Any]) -> list[float]:
    """The fastest joint of each message [rad/s]."""
    return [max(abs(speed) for speed in message.velocity) for message in joints]
