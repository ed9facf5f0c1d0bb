"""The clients of an arm's controller and gripper, against servers in the same process."""

import threading
import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import rclpy
from action_msgs.srv import CancelGoal
from control_msgs.action import FollowJointTrajectory, GripperCommand
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import Bool
from std_srvs.srv import SetBool

from contact_curation.nodes.arm_clients import ControllerClient, Gripper, GripperClient
from contact_curation.nodes.ros.node_main import StageNode
from contact_curation.session.free_domain import free_domain
from contact_curation.simulation.arm.path import JointPath
from contact_curation.stages.trajectory_throw import Sent, TrajectoryThrow

pytestmark = pytest.mark.slow

LONG = 20.0
JOINTS = ("first", "second")


def sent(begin: float, samples: int = 20) -> Sent:
    return Sent(begin, JointPath(*(np.full((samples, 2), begin) for _ in range(3))))


class Cell:
    """A node that serves, one that asks, and what both heard."""

    def __init__(self, domain: int) -> None:
        rclpy.init(args=["--ros-args", "-r", "grip:=/robot/open"], domain_id=domain)
        self.server, self.node = Node("arm"), StageNode("thrower")
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.server)
        self.executor.add_node(self.node)
        self.ended: list[str] = []
        self.failed: list[str] = []
        said = SimpleNamespace(controller_ended=self.ended.append, gripper_failed=self.failed.append)
        self.stage = cast("TrajectoryThrow", said)
        self._thread = threading.Thread(target=self.executor.spin, daemon=True)
        self._thread.start()

    def until(self, true: Callable[[], Any]) -> None:
        end = time.monotonic() + LONG
        while not true():
            assert time.monotonic() < end
            time.sleep(0.01)

    def end_spinning(self) -> None:
        self.executor.shutdown()
        self._thread.join()

    def close(self) -> None:
        self.end_spinning()
        self.node.destroy_node()
        self.server.destroy_node()
        rclpy.try_shutdown()


@pytest.fixture
def cell(monkeypatch: pytest.MonkeyPatch) -> Iterator[Cell]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    with free_domain() as domain:
        made = Cell(domain)
        yield made
        made.close()


def serve(cell: Cell, kind: str, heard: list[Any], answer: bool, name: str = "open") -> None:
    def served(request: Any, response: Any) -> Any:
        heard.append(request.data)
        response.success, response.message = answer, "no air"
        return response

    def asked(goal: Any) -> GoalResponse:
        heard.append(goal.command.position)
        return GoalResponse.ACCEPT if answer else GoalResponse.REJECT

    def reached(handle: Any) -> Any:
        handle.succeed()
        return GripperCommand.Result()

    if kind == "service":
        cell.server.create_service(SetBool, name, served)
    elif kind == "action":
        server = ActionServer(cell.server, GripperCommand, name, reached, goal_callback=asked)
        cell.opened = server  # type: ignore[attr-defined]
    else:
        cell.server.create_subscription(Bool, name, lambda message: heard.append(message.data), 1)


@pytest.mark.parametrize(("kind", "opens"), [("service", False), ("action", 0.07), ("topic", False)])
def test_a_gripper_that_is_not_there_is_told_and_one_that_is_gets_the_value_that_opens_it(
    cell: Cell, kind: str, opens: object
) -> None:
    gripper = GripperClient(cell.node, Gripper(kind, "open", False, 0.07, 20.0), cell.stage)
    assert gripper.missing().startswith("gripper: found no ")
    assert gripper.missing().count("/open, expected its driver there") == 1
    heard: list[Any] = []
    serve(cell, kind, heard, True)
    cell.until(lambda: not gripper.missing())
    gripper.open()
    cell.until(lambda: heard)
    assert heard == [opens]
    assert not cell.failed


@pytest.mark.parametrize("kind", ["service", "action", "topic"])
def test_a_gripper_under_another_name_is_remapped(cell: Cell, kind: str) -> None:
    gripper = GripperClient(cell.node, Gripper(kind, "grip", False, 0.07, 20.0), cell.stage)
    assert "/robot/open, expected its driver there" in gripper.missing()
    serve(cell, kind, [], True, "/robot/open")
    cell.until(lambda: not gripper.missing())


@pytest.mark.parametrize(("kind", "line"), [("service", "no air"), ("action", "it rejected the goal to open")])
def test_a_gripper_that_answers_that_it_does_not_open_is_told(cell: Cell, kind: str, line: str) -> None:
    gripper = GripperClient(cell.node, Gripper(kind, "open", True, 0.07, 20.0), cell.stage)
    serve(cell, kind, [], False)
    cell.until(lambda: not gripper.missing())

    def failed() -> bool:
        gripper.open()  # again, as an answer may be lost
        time.sleep(0.1)
        return bool(cell.failed)

    cell.until(failed)
    assert cell.failed[0] == line


class Follower:
    """A controller that holds every goal until it is told how it ended."""

    def __init__(self, cell: Cell) -> None:
        self.handles: list[Any] = []
        self.cancelled: list[Any] = []
        self.takes = True
        self._server = ActionServer(
            cell.server, FollowJointTrajectory, "follow", lambda _: FollowJointTrajectory.Result(),
            goal_callback=lambda _: GoalResponse.ACCEPT if self.takes else GoalResponse.REJECT,
            handle_accepted_callback=self.handles.append, cancel_callback=self._cancel,
        )  # fmt: skip

    def _cancel(self, handle: Any) -> CancelResponse:
        self.cancelled.append(handle)
        return CancelResponse.ACCEPT

    def end(self, handle: Any, code: int, line: str) -> None:
        def ended(one: Any) -> Any:
            one.succeed()
            return FollowJointTrajectory.Result(error_code=code, error_string=line)

        handle.execute(ended)

    def give_up(self, handle: Any, *, cancelled: bool) -> None:
        """Ends a goal without a word, as some controllers do."""

        def ended(one: Any) -> Any:
            one.canceled() if cancelled else one.abort()
            return FollowJointTrajectory.Result()

        handle.execute(ended)


def test_a_trajectory_arrives_whole_and_only_the_end_of_the_newest_counts(cell: Cell) -> None:
    client = ControllerClient(cell.node, "follow", JOINTS, 3_000_000_000, cell.stage)
    assert client.missing() == (
        "controller: found no action /follow, expected one of control_msgs/FollowJointTrajectory; set controller, or load it"
    )
    follower = Follower(cell)
    cell.until(lambda: not client.missing())
    for number in (0, 1):
        client.send(sent(1.5 + number))
        cell.until(lambda: len(follower.handles) > number)  # noqa: B023
    message = follower.handles[0].request.trajectory
    assert tuple(message.joint_names) == JOINTS
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (4, 500_000_000)
    times = [point.time_from_start.nanosec for point in message.points]
    assert len(times) == 4  # samples 0, 8, 16 and 19, a sample every 1/1036 s
    assert times[0] == 0
    assert times[-1] == pytest.approx(1e9 * 19 / 1036)
    assert all(list(point.positions) == [1.5, 1.5] for point in message.points)
    assert client.unsent is None
    follower.end(follower.handles[0], FollowJointTrajectory.Result.INVALID_GOAL, "replaced")
    follower.end(follower.handles[1], FollowJointTrajectory.Result.PATH_TOLERANCE_VIOLATED, "path tolerance violated")
    cell.until(lambda: cell.ended)
    assert cell.ended == ["path tolerance violated"]


@pytest.mark.parametrize(("cancelled", "line"), [(True, "its goal was cancelled"), (False, "it aborted its goal")])
def test_a_goal_that_the_controller_gives_up_without_a_code_was_not_followed(cell: Cell, cancelled: bool, line: str) -> None:
    client, follower = ControllerClient(cell.node, "follow", JOINTS, 0, cell.stage), Follower(cell)
    cell.until(lambda: not client.missing())
    client.send(sent(1.0))
    cell.until(lambda: follower.handles)
    if cancelled:  # by whom is not known
        anybody = cell.node.create_client(CancelGoal, "follow/_action/cancel_goal")
        cell.until(anybody.service_is_ready)
        anybody.call_async(CancelGoal.Request())
        cell.until(lambda: follower.cancelled)
        cell.until(lambda: follower.handles[0].is_cancel_requested)
    follower.give_up(follower.handles[0], cancelled=cancelled)
    cell.until(lambda: cell.ended)
    assert cell.ended == [line]


def test_the_arm_is_held_where_it_is_if_a_stop_is_rejected(cell: Cell) -> None:
    client, follower = ControllerClient(cell.node, "follow", JOINTS, 0, cell.stage), Follower(cell)
    cell.until(lambda: not client.missing())
    client.send(sent(1.0))
    cell.until(lambda: follower.handles)
    time.sleep(0.2)  # until the client knows that its goal was taken
    follower.takes = False
    client.send(sent(2.0))
    cell.until(lambda: follower.cancelled)
    assert cell.ended == ["it rejected the trajectory"]


def test_a_stop_that_was_not_sent_any_more_is_taken_from_a_node_that_spins_no_more(
    cell: Cell, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = SingleThreadedExecutor()
    client, follower = ControllerClient(cell.node, "follow", JOINTS, 0, cell.stage), Follower(cell)
    cell.until(lambda: not client.missing())
    with monkeypatch.context() as late:
        late.setattr(cell.executor, "create_task", lambda *_: None)
        client.send(sent(1.0))
    cell.end_spinning()
    other.add_node(cell.server)
    serving = threading.Thread(target=other.spin, daemon=True)
    serving.start()
    assert client.unsent is not None
    client.send_at_end(client.unsent)
    assert [handle.request.trajectory.header.stamp.sec for handle in follower.handles] == [1]
    other.shutdown()
    serving.join()
