"""Whatever a node was started with and has no use for is one line, with what to do."""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest import mock

import pytest
import rclpy
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterValue
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.exceptions import ParameterException
from rclpy.qos import ReliabilityPolicy
from std_msgs.msg import Empty

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.errors import InvalidValueError, UnknownNameError
from contact_curation.motion.gate_config import GateConfig
from contact_curation.motion.segmenter_config import SegmenterConfig
from contact_curation.nodes.ros.given_parameters import check_files, check_names
from contact_curation.nodes.ros.node_main import StageNode
from contact_curation.nodes.ros.parameters import declare, declare_config
from contact_curation.nodes.ros.pose_topics import PoseTopics
from contact_curation.nodes.ros.qos import latched
from contact_curation.nodes.trajectory_thrower import TrajectoryThrower
from contact_curation.session.free_domain import free_domain
from test.graph.parts.made_node import lone_domain, made_node


class Small(StageNode):
    """Stands for the curator."""

    def __init__(self) -> None:
        super().__init__("curator")
        self.body = declare(self, "body", "", "file")
        declare(self, "top", 32, "number", bounds=(1, 1000), fixed=False)


@contextmanager
def small(*words: str) -> Iterator[Small]:
    """The node as a command line starts it."""
    with free_domain() as domain:
        rclpy.init(args=["--ros-args", *words], domain_id=domain)
        try:
            node = Small()
            yield node
            node.destroy_node()
        finally:
            rclpy.try_shutdown()


def test_an_empty_list_is_an_empty_list() -> None:
    with small("-p", "topics:=[]", "-p", "base:=[]") as node:
        assert declare(node, "topics", [""], "names") == []
        assert declare(node, "base", [0.5], "lengths") == []
        shown = node.get_parameters(["topics", "base"])  # as for `ros2 param dump`, to which one without a value is an error
        assert [one.get_parameter_value().type for one in shown] == [9, 8]
        assert node.describe_parameter("topics").type == 9


NEW_TOP = ParameterValue(type=2, integer_value=4)


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("tpo", NEW_TOP, "unknown parameter tpo: did you mean top?"),
        ("", NEW_TOP, "unknown parameter '': "),
        ("top", ParameterValue(), "parameter top: found no value, expected one of its type"),
        ("top", ParameterValue(type=42), "parameter top: found no value, expected one of its type"),
        ("tpo", ParameterValue(type=42), "unknown parameter tpo: did you mean top?"),
    ],
)
def test_a_change_that_cannot_be_is_refused_in_one_line_and_the_node_goes_on(name: str, value: Any, says: str) -> None:
    with small() as node:
        asked = [ParameterMessage(name="top", value=NEW_TOP), ParameterMessage(name=name, value=value)]
        services = {one.srv_type: one.callback for one in node.services}
        together = services[SetParametersAtomically](
            SetParametersAtomically.Request(parameters=asked), SetParametersAtomically.Response()
        )
        assert (together.result.successful, together.result.reason.startswith(says)) == (False, True)
        assert node.get_parameter("top").value == 32
        one_by_one = services[SetParameters](SetParameters.Request(parameters=asked), SetParameters.Response())
        assert [one.successful for one in one_by_one.results] == [True, False]
        assert one_by_one.results[1].reason.startswith(says)
        assert node.get_parameter("top").value == 4
        assert not node.has_parameter(name) or name == "top"


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ("bodyfile:=brick.yaml", "unknown parameter bodyfile: did you mean body?"),
        ("curator:tpo:=4", "unknown parameter tpo: did you mean top?"),
        ("max_throws:=4", "unknown parameter max_throws: "),  # which is another node's
    ],
)
def test_a_parameter_that_the_node_does_not_have_is_refused_with_the_one_that_was_meant(given: str, says: str) -> None:
    with small("-p", given) as node, pytest.raises(UnknownNameError, match=re.escape(says)):
        check_names(node, "curator", ["--ros-args", "-p", given])


@pytest.mark.parametrize("given", ["top:=4611686018427387904", "top:=0", "top:=many"])
def test_a_value_out_of_range_or_of_another_type_is_refused_at_the_start(given: str) -> None:
    with pytest.raises(ParameterException, match="top"), small("-p", given):
        pass


def test_a_key_of_a_file_that_no_node_has_is_refused_and_another_nodes_is_not(tmp_path: Path) -> None:
    told = tmp_path / "told.yaml"
    told.write_text("/**:\n  ros__parameters: {max_throws: 4}\n")
    with small("--params-file", str(told)) as node:
        check_names(node, "curator", ["--ros-args", "--params-file", str(told)])
    told.write_text("/**:\n  ros__parameters: {max_throws: 4, bodi: brick.yaml}\n")
    with small("--params-file", str(told)) as node, pytest.raises(UnknownNameError, match="bodi: did you mean body"):
        check_names(node, "curator", ["--ros-args", "--params-file", str(told)])


def test_a_former_name_is_taken_and_the_present_one_said(capfd: pytest.CaptureFixture[str]) -> None:
    with small("-p", "body_file:=brick.yaml") as node:
        check_names(node, "curator", ["-p", "body_file:=brick.yaml"])
        assert node.body == "brick.yaml"
    assert "parameter body_file is now called body: use that name" in capfd.readouterr().err


def test_a_parameter_file_that_is_not_there_is_one_line_and_no_node(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "contact_curation.nodes.curator", "--ros-args", "--params-file", "/none.yaml"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.returncode == 1
    said = "curator: --params-file: found no file /none.yaml, expected a parameter file, such as config/nodes.yaml\n"
    assert done.stderr == said
    assert not list(tmp_path.iterdir())


def test_a_topic_that_no_topic_can_be_called_is_refused_with_the_form_of_names() -> None:
    config = mock.Mock(topic="bad topic!", camera_info="")
    says = "parameter topic: found 'bad topic!', expected a topic's name"
    with small() as node, pytest.raises(InvalidValueError, match=says):
        PoseTopics(node, "cube", config, "", 1, mock.Mock(), mock.Mock())


def test_a_type_of_message_that_nobody_reads_is_refused_with_the_one_that_was_meant() -> None:
    from contact_curation.nodes.pose_ingest import declared_type

    with mock.patch("contact_curation.nodes.pose_ingest.declare", return_value="nav_msgs/Odometry"):
        assert declared_type(mock.Mock()) == "nav_msgs/msg/Odometry"
    wrong = mock.patch("contact_curation.nodes.pose_ingest.declare", return_value="nav_msgs/msg/Odometri")
    with wrong, pytest.raises(UnknownNameError, match=r"unknown message type .*: did you mean nav_msgs/msg/Odometry"):
        declared_type(mock.Mock())


def test_files_that_are_there_are_taken(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").touch()
    check_files(["--params-file", str(tmp_path / "a.yaml"), "-p", "x:=1"])


def test_without_rclpy_a_node_is_one_line_with_the_remedy(tmp_path: Path) -> None:
    code = (
        "import sys, importlib.util as u\n"
        "find = u.find_spec\n"
        "u.find_spec = lambda name, *more: None if name == 'rclpy' else find(name, *more)\n"
        "sys.argv = ['/bin/curator']\n"
        "import contact_curation.nodes.curator\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr == (
        "curator: rclpy is missing: source a ROS 2 Jazzy workspace, or pip install 'contact-curation[ros]'\n"
    )


@pytest.mark.parametrize(("level", "shown"), [("info", True), ("error", False)])
def test_the_log_level_is_taken_from_the_command_line(level: str, shown: bool, tmp_path: Path) -> None:
    status, said = started_curator(tmp_path, "--log-level", level)
    assert status == 1
    assert ("no body given" in said) is shown


def test_a_log_level_that_there_is_not_is_one_line(tmp_path: Path) -> None:
    status, said = started_curator(tmp_path, "--log-level", "loud")
    assert status == 1
    (line,) = (line for line in said.splitlines() if "[rcl]" not in line)
    assert line.startswith("curator: failed to initialize rcl: Couldn't parse log level: '--log-level loud'")


@pytest.mark.parametrize(
    ("words", "status", "said"),
    [
        (["--help"], 0, "usage: curator --ros-args [-p NAME:=VALUE]"),
        (["--bogus"], 1, "curator: arguments: found --bogus, expected --ros-args -p NAME:=VALUE"),
        (["-p", "top:=3"], 1, "curator: arguments: found -p top:=3, expected --ros-args -p NAME:=VALUE"),
    ],
)
def test_words_that_no_node_has_are_refused(words: list[str], status: int, said: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "contact_curation.nodes.curator", *words],
        capture_output=True, text=True, check=False, timeout=120.0,
    )  # fmt: skip
    assert (done.returncode, (done.stdout + done.stderr)[: len(said)]) == (status, said)
    assert len((done.stdout + done.stderr).splitlines()) == 1


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_modules_are_imported_ends_a_node_with_status_0(number: signal.Signals) -> None:
    code = (
        "import os, sys\n"
        "sys.argv = ['/bin/trainer']\n"
        "import contact_curation.nodes\n"
        f"os.kill(os.getpid(), {number})\n"
        "import contact_curation.nodes.trainer\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=120.0)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def started_curator(folder: Path, *words: str) -> tuple[int, str]:
    """Exit status and error output of a curator whose store cannot be made."""
    command = [sys.executable, "-m", "contact_curation.nodes.curator", "--ros-args", *words]
    with free_domain() as domain:
        done = subprocess.run(
            [*command, "-p", f"store:={folder}/none/buffer.sqlite"], env={**os.environ, "ROS_DOMAIN_ID": str(domain)},
            stderr=subprocess.PIPE, text=True, check=False, timeout=120.0,
        )  # fmt: skip
    return done.returncode, done.stderr


def test_what_launch_cannot_leave_empty_has_a_word() -> None:
    from contact_curation.nodes.ros.design_parameters import declared_thrower
    from contact_curation.nodes.ros.pose_topics import declared_poses

    with small("-p", "topic:=auto", "-p", "board_frame:=none", "-p", "thrower:=none") as node:
        poses = declared_poses(node)
        assert (poses.topic, poses.board_frame) == ("", "")
        assert declared_thrower(node, CONTACTNETS_CUBE) is None


def test_the_thrower_of_a_real_arm_knows_these_words_as_pose_ingest_does() -> None:
    with lone_domain() as domain, made_node("trajectory_thrower", domain, "topic:=auto", "board_frame:=none") as (node, _):
        assert isinstance(node, TrajectoryThrower)
        assert node._tracker.config.board_frame == ""
        assert node._topics._config.topic == ""


class Talker(Small):
    """Publishes and listens."""

    def __init__(self) -> None:
        super().__init__()
        self.said = self.create_publisher(Empty, "said", latched(4))
        self.heard = self.create_subscription(Empty, "heard", lambda _: None, latched(4))


@contextmanager
def talker(*overrides: str) -> Iterator[Talker]:
    words = [word for one in overrides for word in ("-p", f"qos_overrides.{one}")]
    with free_domain() as domain:
        rclpy.init(args=["--ros-args", *words], domain_id=domain)
        try:
            node = Talker()
            check_names(node, "curator", words)
            yield node
            node.destroy_node()
        finally:
            rclpy.try_shutdown()


def test_the_quality_of_service_of_a_topic_can_be_overridden_by_ros_s_own_parameters() -> None:
    with talker("/said.publisher.depth:=9", "/heard.subscription.reliability:=best_effort") as node:
        assert node.said.qos_profile.depth == 9
        assert node.said.qos_profile.reliability == ReliabilityPolicy.RELIABLE
        assert node.heard.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
        assert node.heard.qos_profile.depth == 4


@pytest.mark.parametrize("override", ["/said.publisher.reliability:=sometimes", "/said.publisher.depth:=-3"])
def test_a_quality_of_service_that_there_is_not_is_one_line(override: str) -> None:
    with pytest.raises(InvalidValueError, match=r"qos_overrides: found .*, expected history keep_last"), talker(override):
        pass


@pytest.mark.parametrize("given", ["segmenter.shortest:=-1.0", "gates.depth:=11.0", "gates.largest_gap:=0.5"])
def test_bounds_of_segmenter_and_gates_have_ranges(given: str) -> None:
    with free_domain() as domain:
        rclpy.init(args=["--ros-args", "-p", given], domain_id=domain)
        try:
            node = StageNode("pose_ingest")
            with pytest.raises(ParameterException, match=given.partition(":")[0]):
                for config, prefix in ((SegmenterConfig(), "segmenter."), (GateConfig(), "gates.")):
                    declare_config(node, config, prefix)
            node.destroy_node()
        finally:
            rclpy.try_shutdown()
