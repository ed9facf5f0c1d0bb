"""The messages that pip built are those that colcon builds: same definitions, same type hashes, and they travel."""

import json
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import rclpy
from apriltag_msgs.msg import AprilTagDetection, AprilTagDetectionArray, Point
from contact_curation_msgs.action import ExecuteThrow
from contact_curation_msgs.msg import Throw, Toss
from contact_curation_msgs.srv import GetTosses
from control_msgs.msg import JointTrajectoryControllerState
from geometry_msgs.msg import Pose, TransformStamped
from rclpy.action import ActionClient, ActionServer
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from tf2_msgs.msg import TFMessage

from contact_curation.session.free_domain import free_domain
from test.packaging.type_hash import compiled_hash

MSG_DEFS = Path(__file__).resolve().parents[2] / "msg_defs"
VENDORED = ("apriltag_msgs", "control_msgs", "tf2_msgs")
FOLDERS = [MSG_DEFS, *(MSG_DEFS / "vendored" / name for name in VENDORED)]

PUBLIC_HASHES = {
    # As `ros2 topic info --verbose` prints them on an apt-installed Jazzy.
    "tf2_msgs/msg/TFMessage": "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
    "builtin_interfaces/msg/Time": "RIHS01_b106235e25a4c5ed35098aa0a61a3ee9c9b18d197f398b0e4206cea9acf9c197",
    # As the headers say that ROS's own builds of control_msgs generate.
    "control_msgs/action/FollowJointTrajectory": "RIHS01_738ebcb7a2d7cfa42f9f1001cc99ce3a4383d1cfe508015d9be8485e4b1c66f6",
    "control_msgs/action/GripperCommand": "RIHS01_e17c0e644eccf14bea84a0a93e0977182872c2eb7873ca6694900059b46dbc84",
    "control_msgs/msg/GripperCommand": "RIHS01_57eb8f326c9889ca8bb34ead82cc94cc09bf6bc5c3b6c09546dca3a00b589890",
    "control_msgs/msg/JointTolerance": "RIHS01_c254f9cece0f3b733017b6990fd46d1326e25242d6b8844398c97d9a88e7d648",
}

# The generators and this process do not share standard output (empy replaces it), so they run in their own.
DESCRIBE = """
import json, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from pip_build.generation import describe
from pip_build.interface_package import read_interface_package
from rosidl_generator_type_description import calculate_type_hash, extract_full_type_description
hashes = {}
for folder in sys.argv[3:]:
    package = read_interface_package(Path(folder))
    for path in describe(package, Path(sys.argv[2]) / package.name):
        whole = json.loads(path.read_text())["type_description_msg"]
        described = [whole["type_description"], *whole["referenced_type_descriptions"]]
        types = {each["type_name"]: each for each in described}
        hashes |= {name: calculate_type_hash(extract_full_type_description(name, types)) for name in types}
(Path(sys.argv[2]) / "hashes.json").write_text(json.dumps(hashes))
"""


@pytest.fixture(scope="module")
def hashes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Type name -> hash, computed from the definitions by the generator that colcon's build calls too."""
    build = tmp_path_factory.mktemp("described")
    command = [sys.executable, "-c", DESCRIBE, str(MSG_DEFS), str(build), *map(str, FOLDERS)]
    subprocess.run(command, check=True, capture_output=True)
    found: dict[str, str] = json.loads((build / "hashes.json").read_text())
    return found


@pytest.mark.slow
@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_the_compiled_types_have_the_hashes_of_their_definitions(hashes: dict[str, str], folder: Path) -> None:
    package = "contact_curation_msgs" if folder == MSG_DEFS else folder.name
    ours = {name: value for name, value in hashes.items() if name.startswith(package)}
    assert ours == {name: compiled_hash(name) for name in ours}
    defined = {
        f"{package}/{path.parent.name}/{path.stem}" for path in folder.glob("*/*") if path.suffix[1:] == path.parent.name
    }
    assert defined
    assert defined <= set(ours)


def test_the_standard_types_inside_have_the_hashes_that_ros_ships(hashes: dict[str, str]) -> None:
    built_here = ("contact_curation_msgs", *VENDORED)
    standard = {name: value for name, value in hashes.items() if name.split("/")[0] not in built_here}
    assert "geometry_msgs/msg/TransformStamped" in standard
    assert standard == {name: compiled_hash(name) for name in standard}


@pytest.mark.parametrize("name", PUBLIC_HASHES)
def test_a_vendored_type_is_the_one_that_ros_publishes(hashes: dict[str, str], name: str) -> None:
    assert hashes[name] == PUBLIC_HASHES[name]


def test_cmake_builds_exactly_the_definitions_there_are() -> None:
    listed = re.findall(r'"((?:msg|srv|action)/\w+\.\w+)"', (MSG_DEFS / "CMakeLists.txt").read_text())
    there = [path for kind in ("msg", "srv", "action") for path in MSG_DEFS.glob(f"{kind}/*")]
    assert sorted(listed) == sorted(str(path.relative_to(MSG_DEFS)) for path in there)


def test_cmake_and_the_manifest_agree_on_dependencies() -> None:
    cmake = (MSG_DEFS / "CMakeLists.txt").read_text()
    depends = sorted(re.findall(r"<depend>(\w+)</depend>", (MSG_DEFS / "package.xml").read_text()))
    assert re.search(r"DEPENDENCIES ([\w ]+)", cmake)[1].split() == depends  # type: ignore[index]
    assert set(depends) <= set(re.findall(r"find_package\((\w+) REQUIRED\)", cmake))


@pytest.fixture
def node(monkeypatch: pytest.MonkeyPatch) -> Iterator[Node]:
    """A node in a ROS domain of its own, on this machine only."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    context = rclpy.Context()
    with free_domain() as domain:
        rclpy.init(context=context, domain_id=domain)
        made = rclpy.create_node("packaging", context=context)
        yield made
        made.destroy_node()
        rclpy.try_shutdown(context=context)


def spin_until(node: Node, done: Any) -> None:
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    deadline = time.monotonic() + 20.0
    while not done() and time.monotonic() < deadline:
        executor.spin_once(timeout_sec=0.05)
    executor.remove_node(node)
    executor.shutdown()
    assert done()


@pytest.mark.parametrize(
    "message",
    [
        Toss(toss_id="cube-1", poses=[Pose(), Pose()], frame_period=0.00675),
        TFMessage(transforms=[TransformStamped(child_frame_id="tag36h11:3")]),
        JointTrajectoryControllerState(joint_names=["elbow"], speed_scaling_factor=0.8),
        AprilTagDetectionArray(detections=[AprilTagDetection(family="36h11", id=3, centre=Point(x=1.5, y=2.5))]),
    ],
    ids=lambda message: type(message).__name__,
)
def test_a_message_arrives_as_it_was_sent_under_its_own_type_hash(node: Node, hashes: dict[str, str], message: Any) -> None:
    received: list[Any] = []
    node.create_subscription(type(message), "sent", received.append, 10)
    publisher = node.create_publisher(type(message), "sent", 10)
    spin_until(node, lambda: publisher.get_subscription_count() == 1)
    publisher.publish(message)
    spin_until(node, lambda: bool(received))
    assert received == [message]
    package = type(message).__module__.split(".")[0]
    announced = node.get_publishers_info_by_topic("/sent")[0].topic_type_hash
    assert str(announced) == hashes[f"{package}/msg/{type(message).__name__}"]


def test_a_service_answers(node: Node) -> None:
    def serve(request: Any, response: Any) -> Any:
        response.unknown_ids = request.toss_ids
        response.last_sequence = 7
        return response

    node.create_service(GetTosses, "get_tosses", serve)
    client = node.create_client(GetTosses, "get_tosses")
    spin_until(node, client.service_is_ready)
    future = client.call_async(GetTosses.Request(toss_ids=["a", "b"]))
    spin_until(node, future.done)
    assert (future.result().unknown_ids, future.result().last_sequence) == (["a", "b"], 7)


def test_an_action_gives_feedback_and_a_result(node: Node) -> None:
    def throw(handle: Any) -> Any:
        handle.publish_feedback(ExecuteThrow.Feedback(phase="throwing", progress=0.5))
        handle.succeed()
        return ExecuteThrow.Result(success=True, executed=handle.request.throw_command)

    feedback: list[Any] = []
    server = ActionServer(node, ExecuteThrow, "execute_throw", throw)
    client = ActionClient(node, ExecuteThrow, "execute_throw")
    spin_until(node, client.server_is_ready)
    goal = client.send_goal_async(ExecuteThrow.Goal(throw_command=Throw(throw_id="t1")), feedback_callback=feedback.append)
    spin_until(node, goal.done)
    result = goal.result().get_result_async()
    spin_until(node, lambda: result.done() and bool(feedback))
    assert result.result().result.executed.throw_id == "t1"
    assert feedback[0].feedback.phase == "throwing"
    client.destroy()
    server.destroy()
