"""What an arm of one's own is commanded by: the action of its controller, and its gripper."""

from typing import Any, NamedTuple

from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import Bool
from std_srvs.srv import SetBool

from contact_curation.errors import MissingDependencyError
from contact_curation.nodes.messages.trajectory import trajectory_message
from contact_curation.nodes.ros.node_main import StageNode
from contact_curation.nodes.ros.own_namespace import action_name
from contact_curation.nodes.ros.parameters import declare
from contact_curation.nodes.ros.qos import profile
from contact_curation.stages.trajectory_throw import Sent, TrajectoryThrow

GRIPPERS = ("action", "service", "topic")

LAST_WORD = 1.0
"""Longest time that a node which ends waits for the controller to take the stop [s]."""


ENDINGS = {GoalStatus.STATUS_CANCELED: "its goal was cancelled", GoalStatus.STATUS_ABORTED: "it aborted its goal"}
"""Of goals that were not followed to their end."""


class ControllerClient:
    """The controller's action: each trajectory replaces the one before.

    Args:
        node: node that sends.
        name: name of the action.
        joints: names of the joints.
        began_ns: stamp of the stage's time 0 [ns].
        stage: is told how the newest trajectory ended.
    """

    def __init__(self, node: StageNode, name: str, joints: tuple[str, ...], began_ns: int, stage: TrajectoryThrow) -> None:
        self._node, self._joints, self._began_ns, self._stage = node, joints, began_ns, stage
        self._name, self._number = action_name(node, name), 0
        self._taken: Any = None
        self._queued: Sent | None = None
        self._type = control("action").FollowJointTrajectory
        self._client = ActionClient(node, self._type, self._name)

    def missing(self) -> str:
        """In one line that there is no such controller; empty if there is."""
        if self._client.server_is_ready():
            return ""
        found = f"controller: found no action {self._name}"
        return f"{found}, expected one of control_msgs/FollowJointTrajectory; set controller, or load it"

    def send(self, sent: Sent) -> None:
        """Sends a trajectory; the end of an earlier one does not count any more. May be called from any thread.

        The executor's thread sends: the answer to another thread could come before the client waits for it, and be lost.
        """
        self._number += 1
        self._queued = sent
        self._node.executor.create_task(self._send, sent, self._number)

    @property
    def unsent(self) -> Sent | None:
        """The newest trajectory while it waits for the executor's thread, for `send_at_end`."""
        return self._queued

    def send_at_end(self, sent: Sent) -> None:
        """Sends a last trajectory when the node spins no more, and waits a moment until the controller has taken it."""
        self._number += 1
        executor = SingleThreadedExecutor(context=self._node.context)
        executor.add_node(self._node)
        executor.spin_until_future_complete(self._goal_sent(sent), LAST_WORD)
        executor.shutdown(0.0)

    def _goal_sent(self, sent: Sent) -> Any:
        trajectory = trajectory_message(sent, self._joints, self._began_ns)
        return self._client.send_goal_async(self._type.Goal(trajectory=trajectory))

    def _send(self, sent: Sent, number: int) -> None:
        if self._queued is sent:
            self._queued = None
        self._goal_sent(sent).add_done_callback(lambda done: self._answered(number, done.result()))

    def _answered(self, number: int, handle: Any) -> None:
        if handle.accepted:
            self._taken = handle
            handle.get_result_async().add_done_callback(lambda done: self._ended(number, done.result()))
        elif number == self._number:
            if self._taken is not None:  # a stop that is rejected: the controller shall hold the arm where it is
                self._taken.cancel_goal_async()
            self._stage.controller_ended("it rejected the trajectory")

    def _ended(self, number: int, answer: Any) -> None:
        if number == self._number:
            self._taken, result = None, answer.result
            if answer.status == GoalStatus.STATUS_SUCCEEDED and result.error_code == self._type.Result.SUCCESSFUL:
                self._stage.controller_ended("")
            else:  # controllers cancel and abort goals without a code, too, which is that of success
                why = f"error {result.error_code}" if result.error_code else ENDINGS.get(answer.status, "no success")
                self._stage.controller_ended(result.error_string or why)


class Gripper(NamedTuple):
    """How a gripper is opened.

    Attributes:
        kind: one of `GRIPPERS`.
        name: name of its action, service or topic.
        opens: value that opens a service or a topic.
        position: position that opens an action [m].
        effort: largest effort of an action [N].
    """

    kind: str
    name: str
    opens: bool
    position: float
    effort: float


def declared_gripper(node: StageNode) -> Gripper:
    """Declares the parameters of the gripper."""
    return Gripper(
        declare(node, "gripper", "service", "how the gripper is opened", choices=GRIPPERS),
        declare(node, "gripper_name", "gripper/open", "name of the gripper's action, service or topic"),
        declare(node, "gripper_open", True, "value that opens a gripper that is a service or a topic"),
        declare(node, "gripper_position", 0.08, "open position of a gripper that is an action [m]", bounds=(0.0, 1.0)),
        declare(node, "gripper_effort", 0.0, "largest effort of a gripper that is an action [N]", bounds=(0.0, 1e4)),
    )


class GripperClient:
    """Opens the gripper.

    Args:
        node: node that tells it.
        gripper: how it is opened.
        stage: is told if it answers that it does not open.
    """

    def __init__(self, node: StageNode, gripper: Gripper, stage: TrajectoryThrow) -> None:
        self._gripper, self._stage, self._name = gripper, stage, action_name(node, gripper.name)
        if gripper.kind == "action":
            self._client: Any = ActionClient(node, control("action").GripperCommand, self._name)
        elif gripper.kind == "service":
            self._client = node.create_client(SetBool, gripper.name)
        else:
            self._client = node.create_publisher(Bool, gripper.name, profile(1, reliable=True, latched=False))

    def missing(self) -> str:
        """In one line that there is no gripper; empty if there is."""
        kind = self._gripper.kind
        if kind == "action":
            ready = self._client.server_is_ready()
        elif kind == "service":
            ready = self._client.service_is_ready()
        else:
            ready = self._client.get_subscription_count() > 0
        found = f"gripper: found no {'subscriber of topic' if kind == 'topic' else kind} {self._name}"
        return "" if ready else f"{found}, expected its driver there; set gripper and gripper_name, or start it"

    def open(self) -> None:
        """Tells it to open at once, on the calling thread, and does not wait; an answer that is lost counts for nothing."""
        gripper = self._gripper
        if gripper.kind == "action":
            command = control("msg").GripperCommand(position=gripper.position, max_effort=gripper.effort)
            goal = control("action").GripperCommand.Goal(command=command)
            self._client.send_goal_async(goal).add_done_callback(self._goal_answered)
        elif gripper.kind == "service":
            self._client.call_async(SetBool.Request(data=gripper.opens)).add_done_callback(self._service_answered)
        else:
            self._client.publish(Bool(data=gripper.opens))

    def _goal_answered(self, done: Any) -> None:
        if not done.result().accepted:
            self._stage.gripper_failed("it rejected the goal to open")

    def _service_answered(self, done: Any) -> None:
        if not done.result().success:
            self._stage.gripper_failed(done.result().message or "it did not open")


def control(kind: str) -> Any:
    """control_msgs' actions or messages.

    Raises:
        MissingDependencyError: they are not installed.
    """
    try:
        import control_msgs.action
        import control_msgs.msg
    except ImportError as error:
        raise MissingDependencyError("control_msgs", "install the ROS package control_msgs, or run make") from error
    return getattr(control_msgs, kind)
