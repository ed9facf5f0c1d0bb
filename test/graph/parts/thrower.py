"""A client of sim_arm or trajectory_thrower, for tests: arms it, sends it throws, and waits for what becomes of them."""

import math
import time
from collections.abc import Sequence
from typing import Any

from contact_curation_msgs.action import ExecuteThrow
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.action import ActionClient
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from contact_curation.design.throw import Throw
from contact_curation.nodes.messages.headers import Stamped
from contact_curation.nodes.messages.throw import throw_message
from contact_curation.nodes.ros.qos import profile
from test.graph.parts.graph import Graph

LONG = 90.0
STILL = 0.02
"""An arm whose joints are slower than this stands [rad/s]."""

ATTEMPTS, PATIENCE = 12, 5.0
"""To have a goal taken, and how long each waits [s]."""


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
    """Talks to the one thrower of a graph.

    Args:
        graph: it is part of.
        name: of its node.
    """

    def __init__(self, graph: Graph, name: str = "sim_arm") -> None:
        self._graph, self._name = graph, name
        self._health = graph.diagnostics()
        self._client = ActionClient(graph.listener.node, ExecuteThrow, "execute_throw")
        qos = profile(2000, reliable=True, latched=False)
        self.truth: list[Any] = []
        self.joints: list[Any] = []
        graph.listener.node.create_subscription(Odometry, "ground_truth", self.truth.append, qos)
        graph.listener.node.create_subscription(JointState, "/joint_states", self.joints.append, qos)

    def trigger(self, name: str) -> str:
        """Calls one of the node's services."""
        return str(self._graph.listener.call(Trigger, f"/{self._name}/{name}", Trigger.Request(), LONG).message)

    def set_rate(self, rate: float) -> None:
        """Simulated seconds a second, from now on."""
        self.set_parameters(self._name, rate=rate)

    def set_parameters(self, node: str, **values: float | str) -> None:
        """Sets parameters of a node."""
        parameters = [
            Parameter(name=name, value=ParameterValue(type=4, string_value=value) if isinstance(value, str)
                      else ParameterValue(type=3, double_value=value))
            for name, value in values.items()
        ]  # fmt: skip
        answer = self._graph.listener.call(
            SetParameters, f"/{node}/set_parameters", SetParameters.Request(parameters=parameters), LONG
        )
        assert all(result.successful for result in answer.results)

    def send(self, throw: Throw | Any) -> Goal:
        """Sends a throw, a record or a message, and waits until it is taken.

        A server that is seen may not see its client yet, or may be one that was killed; the goal is then sent again.
        """
        assert self._client.wait_for_server(LONG), self._graph.logs()
        message = throw_message(throw, Stamped(0, "body_surface")) if isinstance(throw, Throw) else throw
        for _ in range(ATTEMPTS):
            goal = self._sent(message)
            end = time.monotonic() + PATIENCE
            while goal.handle is None and time.monotonic() < end:
                time.sleep(0.02)
            if goal.handle is not None:
                return goal
        raise AssertionError(f"no goal was taken\n{self._graph.logs()}")

    def _sent(self, message: Any) -> Goal:
        phases: list[str] = []

        def told(message: Any) -> None:
            if not phases or phases[-1] != message.feedback.phase:
                phases.append(message.feedback.phase)

        return Goal(self._client.send_goal_async(ExecuteThrow.Goal(throw_command=message), told), phases)

    def ended(self, goal: Goal) -> Any:
        """Waits for a goal's end; its status and result."""
        self._graph.until(lambda: goal.answer is not None, LONG, "the end of a goal")
        return goal.answer

    def until_phase(self, goal: Goal, phase: str, *, or_ended: bool = False) -> None:
        """Waits until a goal's feedback tells a phase, or it has ended."""
        self._graph.until(lambda: phase in goal.phases or (or_ended and goal.answer), LONG, f"a goal that is {phase}")

    def until_body_moves(self, speed: float) -> None:
        """Waits until the body is seen to move faster than this [m/s]."""
        seen = len(self.truth)

        def moved() -> bool:
            return any(body_speed(message) > speed for message in self.truth[seen:])

        self._graph.until(moved, LONG, f"a body at {speed} m/s")

    def until_healthy(self, *messages: str) -> None:
        """Waits until the node reports one of some states from now on."""
        seen = len(self._health)

        def said() -> bool:
            statuses = [status for array in self._health[seen:] for status in array.status]
            return any(message in status.message for status in statuses for message in messages)

        self._graph.until(said, LONG, f"the state {' or '.join(messages)}")

    def until_still(self, frames: int) -> None:
        """Waits until the arm was seen not to move for so many frames."""
        seen = len(self.joints)

        def still() -> bool:
            return len(self.joints) >= seen + frames and max(speeds(self.joints[-frames:])) < STILL

        self._graph.until(still, LONG, "an arm that stands still")

    def throws(self, throw: Throw) -> None:
        """Throws, again while the arm is still on its way home."""
        self._graph.until(lambda: self._thrown(throw), 3.0 * LONG, "a throw")

    def _thrown(self, throw: Throw) -> bool:
        result = self.ended(self.send(throw)).result
        assert result.success or "expected it at rest at home" in result.message, result.message
        return bool(result.success)

    def close(self) -> None:
        self._client.destroy()


def speeds(joints: Sequence[Any]) -> list[float]:
    """The fastest joint of each message [rad/s]."""
    return [max(abs(speed) for speed in message.velocity) for message in joints]


def body_speed(truth: Any) -> float:
    """Of a ground truth's body [m/s]."""
    velocity = truth.twist.twist.linear
    return math.sqrt(velocity.x**2 + velocity.y**2 + velocity.z**2)
