"""What a node says of itself suits diagnostic_aggregator, and while it waits its log says for what, soon and then seldom."""

import re
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
import rclpy
import yaml
from builtin_interfaces.msg import Time
from contact_curation_msgs.msg import ModelParameters
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

import contact_curation
from contact_curation.nodes.messages.shown import healths_of
from contact_curation.nodes.ros import health
from contact_curation.nodes.ros.health import (
    FIRST_WORD,
    LONGEST_PAUSE,
    LOOKS,
    PERIOD,
    RIVALS_AFTER,
    Flow,
    Flowing,
    Health,
    HealthReport,
    Rivals,
    Waiting,
    awaited,
    key_of,
    node_of,
)
from contact_curation.nodes.ros.qos import latched, profile
from contact_curation.nodes.ros.throttled_warnings import ThrottledWarnings
from contact_curation.session.free_domain import free_domain
from test.graph.parts.graph import until


class Log:
    """A log with a clock that is set by hand."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.seconds = 0.0
        self.waiting = Waiting(self.lines.append, lambda: self.seconds)

    def after(self, seconds: float, what: str) -> int:
        """Looks once a second meanwhile; how many lines there are then."""
        for _ in range(round(seconds)):
            self.seconds += 1.0
            self.waiting.look(what)
        return len(self.lines)


def test_a_short_wait_says_nothing_and_a_long_one_speaks_ever_more_seldom() -> None:
    log = Log()
    log.waiting.look("poses")
    assert log.after(FIRST_WORD - 1.0, "poses") == 0
    assert log.after(1.0, "poses") == 1
    assert log.lines == ["waiting for poses"]
    assert log.after(3600.0, "poses") == 1 + 6 + 4  # after 10, 20, ..., 320 s and then every ten minutes
    before = len(log.lines)
    assert log.after(LONGEST_PAUSE, "poses") - before == 1


def test_what_differs_only_in_a_rate_is_waited_for_on() -> None:
    log = Log()
    for rate in ("14.2", "1e+03", "15", "14.7", "14.8", "15"):
        log.after(1.0, f"usable poses: they come at {rate} Hz")
    assert log.lines == ["waiting for usable poses: they come at 15 Hz"]


def test_what_came_is_no_longer_waited_for_and_another_thing_is_said_anew() -> None:
    log = Log()
    log.after(7.0, "poses")
    assert log.after(100.0, "") == 1
    assert log.after(FIRST_WORD, "a tracker") == 1
    log.after(2.0, "a tracker")
    assert log.lines == ["waiting for poses", "waiting for a tracker"]


@pytest.mark.parametrize(
    ("name", "key"), [("bad pose", "bad_pose"), ("/tagslam/odom/body_cube", "tagslam_odom_body_cube"), ("rate_hz", "rate_hz")]
)
def test_keys_are_words(name: str, key: str) -> None:
    assert key_of(name) == key


def test_a_status_has_a_node_and_what_it_is_about_and_is_told_from_others(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    heard: list[Any] = []
    with free_domain() as domain:
        rclpy.init(domain_id=domain)
        try:
            node = Node("curator", namespace="cell_1")
            report = HealthReport(node, "selection", lambda: Health("fine", {"bad toss": 2}), "cube")
            node.create_subscription(DiagnosticArray, "/diagnostics", heard.append, profile(10, reliable=True, latched=False))
            executor = SingleThreadedExecutor()
            executor.add_node(node)
            for _ in range(600):
                executor.spin_once(timeout_sec=0.1)
                if heard:
                    break
            assert awaited(node, "tosses", "toss") == "tosses on /cell_1/toss, which nobody publishes"
            assert awaited(node, "health", "/diagnostics") == "health on /diagnostics"
            del report
            executor.shutdown()
            node.destroy_node()
        finally:
            rclpy.try_shutdown()
    status = heard[0].status[0]
    assert (status.name, status.hardware_id, status.message) == ("cell_1/curator: selection", "cube", "fine")
    assert node_of(status.name) == "/cell_1/curator"
    foreign = DiagnosticStatus(name="camera_driver: frame rate", message="fine")
    (shown,) = healths_of(DiagnosticArray(status=[status, foreign]), 1.0)
    assert (shown.name, dict(shown.values)) == ("/cell_1/curator", {"bad_toss": "2"})


def test_a_publisher_of_another_type_is_named_where_a_node_waits() -> None:
    subscription = Mock(topic_name="/toss", msg_type=ModelParameters)
    node = Mock(subscriptions=[subscription], resolve_topic_name=lambda topic: f"/{topic}")
    node.get_publishers_info_by_topic.return_value = [Mock(topic_type="std_msgs/msg/String")]
    found = "found std_msgs/msg/String there, expected contact_curation_msgs/msg/ModelParameters"
    assert awaited(node, "tosses", "toss") == f"tosses on /toss: {found}"
    node.get_publishers_info_by_topic.return_value.append(Mock(topic_type="contact_curation_msgs/msg/ModelParameters"))
    assert awaited(node, "tosses", "toss") == "tosses on /toss"


def test_the_aggregator_groups_every_status_once_in_any_namespace() -> None:
    package = Path(contact_curation.__file__).parent
    told = r'HealthReport\(self, "(\w+)"'
    found = {path.stem: re.findall(told, path.read_text()) for path in (package / "nodes").glob("*.py")}
    statuses = {f"{node}: {about}" for node, subjects in found.items() for about in subjects}
    assert len(statuses) >= 9
    analyzers = yaml.safe_load((package / "config" / "diagnostics.yaml").read_text())["analyzers"]["ros__parameters"]
    groups = [one for one in analyzers.values() if isinstance(one, dict)]
    assert {one["type"] for one in groups} == {"diagnostic_aggregator/GenericAnalyzer"}
    assert {part for one in groups for part in one["contains"]} == statuses
    for name in (*statuses, *(f"cell_1/{status}" for status in statuses)):
        assert sum(part in name for one in groups for part in one["contains"]) == 1
    assert all(one["timeout"] > 2.0 * PERIOD for one in groups)  # a late report is not stale


def test_rates_are_known_after_some_looks_between_which_messages_came_each_time() -> None:
    flow, second = Flow(), 10**9
    found = [flow.look(100 * place, 10 * place, place * second, float(place)) for place in range(LOOKS + 2)]
    assert found == [None] * LOOKS + [Flowing(100.0, 0.1, 10.0)] * 2
    assert flow.look(100 * (LOOKS + 1), 10 * (LOOKS + 1), LOOKS * second, LOOKS + 2.0) is None  # nothing came


@pytest.mark.parametrize("speed", [0.1, 10.0])
def test_the_rate_of_poses_is_that_of_their_stamps_at_any_speed_of_simulated_time(speed: float) -> None:
    flow = Flow()
    stamps = [int(1e9 * speed * place) for place in range(LOOKS + 1)]
    found = [flow.look(round(148e-9 * one), round(148e-9 * one), one, float(place)) for place, one in enumerate(stamps)][-1]
    assert found is not None
    assert found.poses == pytest.approx(148.0, rel=0.02)
    assert found.messages == pytest.approx(148.0 * speed, rel=0.02)


def test_a_warning_says_that_something_is_dropped_only_where_it_is() -> None:
    lines: list[str] = []
    warnings = ThrottledWarnings(Mock(get_logger=lambda: Mock(warning=lines.append)))
    warnings.note("bad toss", "body: found brick")
    warnings.note("throw not made", "the thrower rejected the goal", dropped=False)
    warnings.note("throw not made", "again", dropped=False)
    assert lines == ["bad toss: body: found brick; dropped", "throw not made: the thrower rejected the goal"]
    assert warnings.counts == {"bad toss": 1, "throw not made": 2}


def test_another_publisher_of_a_result_is_said_where_it_stays() -> None:
    with free_domain() as domain:
        context = rclpy.Context()
        rclpy.init(context=context, domain_id=domain)
        try:
            one, other = (Node(name, context=context, enable_rosout=False) for name in ("trainer", "trainer_2"))
            one.create_publisher(ModelParameters, "model_parameters", latched(1))
            one.create_publisher(DiagnosticArray, "/diagnostics", latched(1))
            other.create_publisher(DiagnosticArray, "/diagnostics", latched(1))
            rivals = Rivals(one)
            assert {rivals.look() for _ in range(2 * RIVALS_AFTER)} == {""}
            second = other.create_publisher(ModelParameters, "model_parameters", latched(1))
            until(lambda: one.count_publishers("model_parameters") == 2, 30.0, "the other publisher")
            assert {rivals.look() for _ in range(RIVALS_AFTER - 1)} == {""}
            assert "found others that publish /model_parameters (2 times), expected this node alone" in rivals.look()
            other.destroy_publisher(second)
            until(lambda: one.count_publishers("model_parameters") == 1, 30.0, "its end")
            assert rivals.look() == ""
        finally:
            rclpy.shutdown(context=context)


def test_another_publisher_is_a_warning_of_the_health(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(health, "RIVALS_AFTER", 1)
    node = Mock(publishers=[Mock(topic_name="/toss", msg_type=ModelParameters)], count_publishers=lambda _: 2)
    node.get_fully_qualified_name.return_value = "/trainer"
    node.get_clock.return_value.now.return_value.to_msg.return_value = Time()
    HealthReport(node, "training", lambda: Health("fine", {}))._report()
    (status,) = node.create_publisher.return_value.publish.call_args.args[0].status
    assert status.level == DiagnosticStatus.WARN
    assert status.message.startswith("fine; found others that publish /toss (2 times)")
