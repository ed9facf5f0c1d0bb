"""A body's poses are listened to once what the rig's publishers keep has come, so that a fast bag is not ahead of its board."""

from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any, NamedTuple
from unittest.mock import MagicMock

from geometry_msgs.msg import PoseStamped
from rclpy.qos import QoSProfile
from tf2_msgs.msg import TFMessage

from contact_curation.nodes.ros.pose_topics import LOOKS_FOR_THE_RIG, PoseTopics
from contact_curation.nodes.ros.qos import latched, profile
from contact_curation.storage.inputs.pose_source import PoseTopicConfig

POSES, RIG = "/poses", "/tf_static"
KINDS = {POSES: "geometry_msgs/msg/PoseStamped", RIG: "tf2_msgs/msg/TFMessage"}
LIVE = profile(10, reliable=True, latched=False)


class Publisher(NamedTuple):
    topic_type: str
    qos_profile: QoSProfile
    endpoint_gid: tuple[int, ...] = (1,)


class GraphOf:
    """What `PoseTopics` asks of its node, of a graph with these publishers."""

    def __init__(self, offers: dict[str, QoSProfile]) -> None:
        self.offers = offers
        self.waiting: list[tuple[Any, Mapping[str, int]]] = []
        self.callbacks: dict[str, Callable[[Any, Mapping[str, int]], None]] = {}

    def get_namespace(self) -> str:
        return "/"

    def get_topic_names_and_types(self) -> list[tuple[str, list[str]]]:
        return [(name, [KINDS[name]]) for name in self.offers]

    def count_publishers(self, name: str) -> int:
        return int(name in self.offers)

    def get_publishers_info_by_topic(self, name: str) -> list[Publisher]:
        return [Publisher(KINDS[name], self.offers[name])] if name in self.offers else []

    def resolve_topic_name(self, topic: str) -> str:
        return topic if topic.startswith("/") else f"/{topic}"

    def create_subscription(self, kind: type, topic: str, callback: Any, qos: QoSProfile, **_: Any) -> Any:
        assert kind is {POSES: PoseStamped, RIG: TFMessage}[topic]
        self.callbacks[topic] = callback
        handle = MagicMock(take_message=lambda *_: self.waiting.pop(0) if self.waiting and topic == POSES else None)
        return SimpleNamespace(topic=topic, msg_type=kind, raw=False, callback=callback, handle=handle)

    def destroy_subscription(self, subscription: Any) -> None:
        del self.callbacks[subscription.topic]


def followed(graph: Any, arrived: Callable[[Any], None] = lambda _: None) -> PoseTopics:
    return PoseTopics(graph, "cube", PoseTopicConfig(topic=POSES), "", 10, lambda _: {}, arrived)


def test_poses_wait_for_the_rig_that_its_publishers_keep() -> None:
    graph = GraphOf({POSES: LIVE, RIG: latched(1)})
    topics = followed(graph)
    topics.follow()
    assert set(graph.callbacks) == {RIG}
    graph.callbacks[RIG](TFMessage(), {"source_timestamp": 1})
    topics.follow()
    assert set(graph.callbacks) == {RIG, POSES}


def test_a_rig_that_keeps_silent_is_waited_for_so_many_looks_and_no_more() -> None:
    graph = GraphOf({POSES: LIVE, RIG: latched(1)})
    topics = followed(graph)
    for _ in range(LOOKS_FOR_THE_RIG):
        topics.follow()
        assert set(graph.callbacks) == {RIG}
    topics.follow()
    assert set(graph.callbacks) == {RIG, POSES}


def test_a_rig_that_is_found_later_than_the_poses_still_comes_first() -> None:
    graph = GraphOf({POSES: LIVE})
    topics = followed(graph)
    topics.follow()
    assert set(graph.callbacks) == set()
    graph.offers[RIG] = latched(1)
    topics.follow()
    assert set(graph.callbacks) == {RIG}
    graph.callbacks[RIG](TFMessage(), {"source_timestamp": 1})
    topics.follow()
    assert set(graph.callbacks) == {RIG, POSES}


def test_where_there_is_no_rig_poses_wait_so_many_looks_and_no_more() -> None:
    graph = GraphOf({POSES: LIVE})
    topics = followed(graph)
    for _ in range(LOOKS_FOR_THE_RIG):
        topics.follow()
        assert set(graph.callbacks) == set()
    topics.follow()
    assert set(graph.callbacks) == {POSES}


def test_nothing_is_waited_for_where_the_rigs_publisher_keeps_nothing() -> None:
    graph = GraphOf({POSES: LIVE, RIG: LIVE})
    followed(graph).follow()
    assert set(graph.callbacks) == {POSES, RIG}


def test_topics_are_left_once_what_has_come_is_taken_and_then_taken_up_at_once_without_what_is_known() -> None:
    graph, taken = GraphOf({POSES: LIVE, RIG: latched(1)}), list[int]()
    topics = followed(graph, lambda received: taken.append(received.published_ns))
    topics.follow()
    graph.callbacks[RIG](TFMessage(), {"source_timestamp": 1})
    topics.follow()
    assert topics.has_publisher
    graph.waiting = [(PoseStamped(), {"source_timestamp": stamp}) for stamp in (2, 3)]
    topics.leave()
    assert (taken, graph.callbacks, topics.has_publisher, topics.offers) == ([1, 2, 3], {}, False, {})
    topics.follow()
    assert set(graph.callbacks) == {RIG, POSES}
    for stamp in (3, 4):
        graph.callbacks[POSES](PoseStamped(), {"source_timestamp": stamp})
    assert (taken, topics.known) == ([1, 2, 3, 4], 1)
