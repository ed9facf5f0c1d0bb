"""session_recorder hears all topics of a graph, whatever they are offered with, and a kill costs nothing that was latched."""

import time
from itertools import count
from pathlib import Path
from typing import Any

import pytest
from contact_curation_msgs.msg import Toss
from nav_msgs.msg import Odometry
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from std_msgs.msg import Float64MultiArray, String

from contact_curation.nodes.ros.message_definition import definition_text
from contact_curation.nodes.ros.qos import latched, profile
from contact_curation.storage.bags.reader import BagReader
from test.graph.parts.graph import Graph, until

LONG = 90.0
TYPES = [
    "nav_msgs/msg/Odometry",
    "sensor_msgs/msg/CameraInfo",
    "diagnostic_msgs/msg/DiagnosticArray",
    "tf2_msgs/msg/TFMessage",
    "rcl_interfaces/msg/ParameterEvent",
    "std_msgs/msg/Float64MultiArray",
]


@pytest.mark.parametrize("name", TYPES)
def test_the_definition_made_from_a_class_is_that_of_the_standard_type(name: str) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    ours = get_typestore(Stores.EMPTY)
    ours.register(get_types_from_msg(definition_text(name), name))
    assert ours.hash_rihs01(name) == store.hash_rihs01(name)


def test_bounded_strings_and_sequences_keep_their_bounds(monkeypatch: pytest.MonkeyPatch) -> None:
    class Made:
        @staticmethod
        def get_fields_and_field_types() -> dict[str, str]:
            return {
                "a": "sequence<double, 3>",
                "b": "string<8>",
                "c": "boolean[2]",
                "d": "sequence<string>",
                "e": "octet",
                "f": "sequence<string<8>, 2>",
            }

    monkeypatch.setattr("contact_curation.nodes.ros.message_definition.message_class", lambda _: Made)
    lines = definition_text("made_msgs/msg/Made").splitlines()
    assert lines == ["float64[<=3] a", "string<=8 b", "bool[2] c", "string[] d", "byte e", "string<=8[<=2] f"]


def recorded(path: Path, topic: str) -> list[Any]:
    if not path.exists():
        return []
    with BagReader(path) as reader:
        return [one.message for one in reader.messages([topic])] if topic in [one.name for one in reader.topics] else []


def test_everything_is_recorded_and_a_kill_costs_nothing_that_was_latched(graph: Graph) -> None:
    bag = graph.folder / "session.mcap"
    node = graph.listener.node
    toss = node.create_publisher(Toss, "toss", latched(256))
    poses = node.create_publisher(Odometry, "tagslam/odom/body_cube", latched(4096))
    truth = node.create_publisher(String, "truth", profile(1000, reliable=True, latched=False))
    rough = node.create_publisher(Float64MultiArray, "rough", profile(100, reliable=False, latched=False))
    publishers = toss, poses, truth, rough

    def heard() -> bool:
        return all(one.get_subscription_count() for one in publishers)

    def pose(number: int) -> Odometry:
        message = Odometry()
        message.header.stamp.sec = number
        return message

    recorder = graph.start("session_recorder", bag=bag)
    until(heard, LONG, "subscribers")
    toss.publish(Toss(toss_id="first"))
    for number in range(500):
        poses.publish(pose(number))
        truth.publish(String(data=str(number)))
    graph.until(lambda: len(recorded(bag, "/truth")) == 500, LONG, "500 messages")

    def rough_heard() -> bool:
        rough.publish(Float64MultiArray(data=[1.0]))  # one that is sent best effort may be lost
        return bool(recorded(bag, "/rough"))

    graph.until(rough_heard, LONG, "a message that is sent best effort")
    recorder.kill()
    for number in range(500, 520):
        poses.publish(pose(number))
    recorder = graph.start("session_recorder", bag=bag)
    graph.until(lambda: len(recorded(bag, "/tagslam/odom/body_cube")) == 520, LONG, "what was missed")
    toss.publish(Toss(toss_id="second", stamps=[pose(7).header.stamp]))
    graph.until(lambda: len(recorded(bag, "/toss")) == 2, LONG, "the second toss")
    assert recorder.stop() == 0
    assert [one.header.stamp.sec for one in recorded(bag, "/tagslam/odom/body_cube")] == list(range(520))
    assert [one.data for one in recorded(bag, "/truth")] == [str(number) for number in range(500)]
    assert recorded(bag, "/toss")[1].stamps[0].sec == 7
    with BagReader(bag) as reader:
        assert [reader.qos(topic).latched for topic in ("/toss", "/truth")] == [True, False]
        assert not reader.qos("/rough").reliable
        assert "/diagnostics" in [one.name for one in reader.topics]
        assert not any("/_" in one.name for one in reader.topics)
        sent = next(iter(reader.raw_messages(["/toss"])))
        assert not reader.losses
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(sent.schema, sent.type))
    assert store.hash_rihs01(sent.type) == sent.type_hash


def test_the_poses_of_a_toss_that_is_stored_survive_a_kill_of_all_processes(graph: Graph) -> None:
    bag, node = graph.folder / "session.mcap", graph.listener.node
    toss = node.create_publisher(Toss, "toss", latched(256))
    poses = node.create_publisher(Odometry, "tagslam/odom/body_cube", latched(4096))
    recorder = graph.start("session_recorder", bag=bag, flush_period=60.0)
    until(lambda: toss.get_subscription_count() and poses.get_subscription_count(), LONG, "subscribers")
    for _ in range(100):
        poses.publish(Odometry())
    toss.publish(Toss(toss_id="first"))
    graph.until(lambda: len(recorded(bag, "/tagslam/odom/body_cube")) == 100, 30.0, "poses, before the flush period is over")
    recorder.kill()
    assert len(recorded(bag, "/toss")) == 1


@pytest.mark.slow
def test_a_publisher_with_another_quality_of_service_that_comes_and_goes_costs_no_message(graph: Graph) -> None:
    bag, node = graph.folder / "session.mcap", graph.listener.node
    truth = node.create_publisher(String, "truth", profile(1000, reliable=True, latched=False))
    recorder = graph.start("session_recorder", bag=bag)
    until(truth.get_subscription_count, LONG, "a subscriber")
    others, sent = list[Any](), count()

    def next_one() -> None:
        truth.publish(String(data=str(next(sent))))
        time.sleep(0.002)

    def heard() -> bool:
        next_one()
        return bool(others[0].get_subscription_count())

    others.append(node.create_publisher(String, "truth", profile(1000, reliable=False, latched=False)))
    graph.until(heard, LONG, "a subscriber of the other publisher")
    for _ in range(1500):  # longer than both subscriptions are there
        next_one()
    others[0].publish(String(data="other"))
    node.destroy_publisher(others[0])
    for _ in range(500):
        next_one()
    last = next(sent)
    graph.until(lambda: len(recorded(bag, "/truth")) == last + 1, LONG, "all messages")
    assert recorder.stop() == 0
    assert [one.data for one in recorded(bag, "/truth") if one.data != "other"] == [str(number) for number in range(last)]


def test_a_bag_that_is_no_mcap_is_refused_in_one_line(graph: Graph) -> None:
    node = graph.start("session_recorder", bag=graph.folder / "session.bag")
    assert node.wait(LONG) == 1
    assert "expected a file name ending in .mcap" in node.log()
