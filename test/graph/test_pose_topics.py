"""pose_ingest takes poses as they come: types, qualities of service, bad ones, clocks that jump."""

import json
import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import Any

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseArray, PoseStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from contact_curation.motion.pose_stream import FramePose
from contact_curation.nodes.ros.health import node_of
from contact_curation.nodes.ros.qos import latched, profile
from contact_curation.storage.stores.tosses import TossStore
from test.conftest import GOLDEN
from test.graph.parts.graph import Graph
from test.graph.parts.measured import measured_of, tosses_in
from test.graph.parts.tracker import Tracker, message_of, publish

MESSAGES = 900
"""Two tosses, and what follows until the third."""

LONG = 90.0
BEST_EFFORT = profile(1000, reliable=False, latched=False)


@pytest.fixture(scope="module")
def measured() -> tuple[FramePose, ...]:
    """With the rests, in which these tests' tosses end."""
    return tuple(measured_of(GOLDEN))


@pytest.fixture
def rig(measured: tuple[FramePose, ...]) -> tuple[FramePose, ...]:
    return tuple(one for one in measured if one.static)


@pytest.fixture
def poses(measured: tuple[FramePose, ...]) -> tuple[FramePose, ...]:
    return tuple(one for one in measured[:MESSAGES] if not one.static)


def _two(messages: list[Any]) -> bool:
    return len(messages) >= 2


def ids(messages: list[Any]) -> list[str]:
    return [message.toss_id for message in messages]


def values_of(diagnostics: list[Any], node: str) -> dict[str, str]:
    """The newest details that a node reported."""
    reports = [status for array in diagnostics for status in array.status if node_of(status.name) == node]
    return {value.key: value.value for value in reports[-1].values} if reports else {}


def test_every_type_of_pose_topic_gives_the_same_tosses(
    graph: Graph, rig: tuple[FramePose, ...], poses: tuple[FramePose, ...]
) -> None:
    tracker = Tracker(graph.listener, rig)
    kinds: dict[str, tuple[type, Any]] = {
        "/odometry": (Odometry, BEST_EFFORT),
        "/pose": (PoseStamped, latched(10)),
        "/poses": (PoseArray, profile(1000, reliable=True, latched=False)),
        "/tf": (TFMessage, profile(1000, reliable=True, latched=False)),
    }
    heard = {}
    for topic in kinds:
        label = topic.strip("/")
        heard[topic] = graph.tosses(f"/{label}/toss")
        asked, names = (topic, {}) if topic != "/pose" else ("asked", {f"/{label}/asked": topic})  # by a remap, too
        graph.start(
            "pose_ingest",
            {"__ns": f"/{label}", "tf": "/tf", "tf_static": "/tf_static", **names},
            label,
            topic=asked,
            array_index=1,
            source="tracker",
        )
    listening = {"/tf": len(kinds)}  # every node listens to the transforms, whatever its own topic is
    publish([tracker.topic(kind, topic, qos, listening.get(topic, 1)) for topic, (kind, qos) in kinds.items()], poses)
    expected = [toss.toss_id for toss in tosses_in((*rig, *poses), "tracker")]
    assert len(expected) == 2
    for topic, tosses in heard.items():
        graph.until(partial(_two, tosses), LONG, f"the tosses of {topic}")
        assert ids(tosses) == expected


@pytest.mark.slow
def test_a_body_that_is_on_tf_alone_is_found_there(
    graph: Graph, rig: tuple[FramePose, ...], poses: tuple[FramePose, ...]
) -> None:
    tosses = graph.tosses()
    graph.start("pose_ingest", source="tracker")
    publisher = Tracker(graph.listener, rig).topic(TFMessage, "/tf", profile(1000, reliable=True, latched=False))
    message = message_of(TFMessage, poses[0])

    def taken() -> bool:
        publisher.publish(message)
        return "poses of cube from /tf" in graph.processes[0].log()

    graph.until(taken, LONG, "the body to be found on /tf")
    graph.until(lambda: publisher.get_subscription_count() == 1, LONG, "the first subscriber to leave")
    publish([publisher], poses)
    graph.until(partial(_two, tosses), LONG, "the tosses")
    assert ids(tosses) == [toss.toss_id for toss in tosses_in((*rig, *poses), "tracker")]


@contextmanager
def elsewhere(graph: Graph) -> Iterator[Node]:
    """A node of another participant, since one participant has one type for a topic."""
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=graph.listener.node.context.get_domain_id())
    node = rclpy.create_node("elsewhere", context=context)
    yield node
    node.destroy_node()
    rclpy.shutdown(context=context)


@pytest.mark.slow
def test_a_subscriber_that_asks_for_another_type_changes_nothing_and_a_tracker_may_come_back_with_it(
    graph: Graph, rig: tuple[FramePose, ...], poses: tuple[FramePose, ...]
) -> None:
    tosses = graph.tosses()
    with elsewhere(graph) as other:
        other.create_subscription(PoseStamped, "/odometry", lambda _: None, 10)
        graph.start("pose_ingest", source="tracker")
        publisher = Tracker(graph.listener, rig).topic(Odometry, "/odometry", latched(10))
        publish([publisher], poses)
        graph.until(partial(_two, tosses), LONG, "the tosses")
        graph.listener.node.destroy_publisher(publisher)
        again = other.create_publisher(PoseStamped, "/odometry", latched(10))
        graph.until(lambda: again.get_subscription_count() == 2, LONG, "a subscriber of the other type")


@pytest.mark.slow
def test_messages_of_which_none_is_a_pose_are_a_warning(graph: Graph, rig: tuple[FramePose, ...]) -> None:
    diagnostics = graph.diagnostics()
    graph.start("pose_ingest", topic="/odometry", label="nan")
    publisher = Tracker(graph.listener, rig).topic(Odometry, "/odometry", BEST_EFFORT)
    message = Odometry()
    message.header.frame_id = "map"
    message.pose.pose.position.x = math.nan

    def warned() -> bool:
        message.header.stamp.nanosec += 7_000_000
        publisher.publish(message)
        reports = [one for array in diagnostics for one in array.status if node_of(one.name) == "/pose_ingest"]
        return (
            bool(reports)
            and "gives a pose of cube on the board" in reports[-1].message
            and reports[-1].level == DiagnosticStatus.WARN
        )

    graph.until(warned, LONG, "a warning")


@pytest.mark.slow
def test_a_named_topic_of_another_type_is_named_with_it(graph: Graph) -> None:
    graph.listener.node.create_publisher(String, "/odometry", 10)
    graph.start("pose_ingest", topic="/odometry")
    graph.until(lambda: "found /odometry (std_msgs/msg/String)" in graph.processes[0].log(), LONG, "the type that is there")


@pytest.mark.slow
def test_a_rig_that_keeps_silent_holds_up_the_poses_for_a_while_only(graph: Graph) -> None:
    node = graph.listener.node
    node.create_publisher(TFMessage, "/tf_static", latched(1))
    poses = node.create_publisher(Odometry, "/odometry", latched(10))
    graph.start("pose_ingest", topic="/odometry")
    graph.until(poses.get_subscription_count, LONG, "a subscriber of the poses")


def test_bad_poses_are_counted_and_said_once_and_cost_no_toss(
    graph: Graph, rig: tuple[FramePose, ...], poses: tuple[FramePose, ...]
) -> None:
    tosses, diagnostics = graph.tosses(), graph.diagnostics()
    graph.start("pose_ingest", topic="/odometry")
    tracker = Tracker(graph.listener, rig)
    publisher = tracker.topic(Odometry, "/odometry", latched(10))
    broken = []
    for place, one in enumerate(poses):
        broken.append(one)
        if place % 100 == 50:
            nowhere = one.pose._replace(position=(math.nan, 0.0, 0.0))
            tilted = one.pose._replace(orientation_wxyz=(0.9, 0.0, 0.0, 0.0))
            broken += [replace(one, pose=nowhere), replace(one, pose=tilted)]
        if place == 300:  # in the middle of the first toss
            broken.append(replace(one, parent="elsewhere", stamp_ns=one.stamp_ns + 1000))
    publish([publisher], broken)
    graph.until(lambda: len(tosses) >= 2, LONG, "the tosses")
    assert ids(tosses) == [toss.toss_id for toss in tosses_in((*rig, *poses), "/odometry")]
    graph.until(lambda: values_of(diagnostics, "/pose_ingest").get("bad_pose") == "18", LONG, "the count of bad poses")
    log = graph.processes[0].log()
    assert log.count("expected finite numbers") + log.count("quaternion norm") == 1
    assert "bad frame: body_cube" in log
    assert "elsewhere" in log


@pytest.mark.slow
def test_poses_are_taken_after_the_clock_was_set_back(
    graph: Graph, rig: tuple[FramePose, ...], poses: tuple[FramePose, ...]
) -> None:
    first = graph.start("pose_ingest", topic="/odometry")
    heard = graph.diagnostics()
    publisher = Tracker(graph.listener, rig).topic(Odometry, "/odometry", profile(1000, reliable=True, latched=False))
    publish([publisher], poses[:50])
    graph.until(lambda: values_of(heard, "/pose_ingest").get("messages", "0") != "0", LONG, "poses")
    first.stop()
    graph.until(lambda: not publisher.get_subscription_count(), LONG, "its end")
    with TossStore(graph.folder / "tosses.sqlite") as store:
        state = json.loads(store.states.load("newest") or b"{}")
        hour_on = {topic: stamp_ns + 3600 * 10**9 for topic, stamp_ns in state["newest"].items()}
        store.states.save({"newest": json.dumps({**state, "newest": hour_on}).encode()})
    tosses = graph.tosses()
    second = graph.start("pose_ingest", label="again", topic="/odometry", store=graph.folder / "tosses.sqlite")
    graph.until(publisher.get_subscription_count, LONG, "a subscriber")
    publish([publisher], poses[: MESSAGES // 2])
    graph.until(lambda: tosses, LONG, "a toss")
    assert second.log().count("the clock was set back: found poses published 35") == 1


@pytest.mark.slow
def test_a_clock_that_jumps_back_ends_the_toss_and_the_same_tosses_come_once(
    graph: Graph, rig: tuple[FramePose, ...], poses: tuple[FramePose, ...]
) -> None:
    tosses, rejected = graph.tosses(), graph.rejected()
    graph.start("pose_ingest", topic="/odometry")
    tracker = Tracker(graph.listener, rig)
    publisher = tracker.topic(Odometry, "/odometry", latched(10))
    expected = tosses_in((*rig, *poses), "/odometry")
    middle = int(expected[1].stamps_ns[expected[1].frames // 2])
    publish([publisher], [one for one in poses if one.stamp_ns < middle])
    publish([publisher], poses)
    publish([publisher], poses)
    graph.until(lambda: len(tosses) >= 2 and rejected, LONG, "the tosses")
    assert ids(tosses) == [toss.toss_id for toss in expected]
    assert ids(rejected) == [expected[1].toss_id]
    assert "clock: found a jump back" in rejected[0].reasons[0]


@pytest.mark.slow
def test_what_a_live_tracker_sends_while_the_node_is_dead_shows_as_a_gap(
    graph: Graph, rig: tuple[FramePose, ...], poses: tuple[FramePose, ...]
) -> None:
    tosses, rejected = graph.tosses(), graph.rejected()
    node = graph.start("pose_ingest", topic="/odometry")
    tracker = Tracker(graph.listener, rig)
    live = profile(1000, reliable=True, latched=False)
    publisher = tracker.topic(Odometry, "/odometry", live)
    expected = tosses_in((*rig, *poses), "/odometry")
    middle = int(expected[0].stamps_ns[expected[0].frames // 2])
    publish([publisher], [one for one in poses if one.stamp_ns < middle])
    node.kill()
    graph.start("pose_ingest", topic="/odometry")
    # DDS believes in the dead subscriber for a while longer
    graph.until(lambda: publisher.get_subscription_count() == 2, LONG, "the node to come back")
    publish([publisher], [one for one in poses if one.stamp_ns > middle + 50_000_000])
    graph.until(lambda: tosses and rejected, LONG, "the second toss")
    assert ids(tosses) == [expected[1].toss_id]
    assert ids(rejected) == [expected[0].toss_id]
    assert rejected[0].reasons[0].startswith("gap: found")
