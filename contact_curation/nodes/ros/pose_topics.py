"""Subscriptions to the topics with a body's poses: found in the graph and matched to their publishers.

A reliable subscriber hears nothing from a best-effort publisher, and only a transient local one gets what was published before
it came. So the publishers are looked at again and again, and a topic whose publishers changed is subscribed to again. What a
publisher then sends a second time is known by its time of publication.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from rclpy._rclpy_pybind11 import RCLError
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.subscription import Subscription

from contact_curation.errors import InvalidValueError, MissingTopicError
from contact_curation.nodes.ros.message_types import message_class
from contact_curation.nodes.ros.own_namespace import is_own
from contact_curation.nodes.ros.qos import AS_OFFERED, offered, profile
from contact_curation.stages.ingest import published_before
from contact_curation.storage.bags.records import OfferedQos
from contact_curation.storage.inputs.pose_messages import POSE_MESSAGES, TF, Measured
from contact_curation.storage.inputs.pose_source import PoseSource, PoseTopicConfig, TypedTopic, find_pose_source
from contact_curation.storage.inputs.tag_detections import CAMERA_INFO, DETECTIONS

READ_TYPES = (*POSE_MESSAGES, DETECTIONS, CAMERA_INFO)

LOOKS_FOR_THE_RIG = 10
"""Looks at the graph for which poses wait for the rig's static transforms: a fast bag would be far ahead of them.

Discovery may find the publisher of the poses before that of the transforms, so they also wait where none was found yet."""


class Offer(NamedTuple):
    """What all publishers of a topic offer.

    Attributes:
        type: ROS type name.
        qos: how they offer it.
    """

    type: str
    qos: OfferedQos


class Received(NamedTuple):
    """A message as it came.

    Attributes:
        topic: topic that it came on.
        published_ns: when it was published, by the middleware's clock.
        message: message of that topic's type.
    """

    topic: str
    published_ns: int
    message: Any


class PoseTopics:
    """Follows the topics of one body.

    Args:
        node: node that subscribes.
        body: name of the body.
        config: which topics; the names of the node's remaps and namespace hold for them. What it leaves open is looked for
            in the node's namespace only, transforms on its `tf` and `tf_static`.
        type_name: ROS type of the body's topic, where the graph has several under its name; empty for any.
        depth: samples kept per topic until they are taken.
        found: called once, with the body's topic when it is found; gives per topic the time of publication up to which
            everything is known already [ns].
        arrived: called with each message that is not known yet.

    Attributes:
        source: the topics that fit; None until they are there.
        waiting_for: what is missing until then.
        known: messages that came once more and were left out.
    """

    def __init__(
        self,
        node: Node,
        body: str,
        config: PoseTopicConfig,
        type_name: str,
        depth: int,
        found: Callable[[str], Mapping[str, int]],
        arrived: Callable[[Received], None],
    ) -> None:
        self._node = node
        self._body = body
        names = {"topic": config.topic, "camera_info": config.camera_info}
        resolved: dict[str, Any] = {key: _resolved(node, key, name) for key, name in names.items() if name}
        self._config = replace(config, **resolved)
        self._tf_static = node.resolve_topic_name("tf_static")
        self._rig = (TypedTopic(node.resolve_topic_name("tf"), TF), TypedTopic(self._tf_static, TF))
        self._type_name = type_name
        self._depth = depth
        self._detections = config.detections(body)
        self._found = found
        self._newest: dict[str, int] = {}
        self._newest_pose_ns = 0
        self._arrived = arrived
        self._subscriptions: dict[str, tuple[Offer, Subscription]] = {}
        self._heard: set[str] = set()
        self._looks = 0
        self.source: PoseSource | None = None
        self.waiting_for = ""
        self.known = 0

    @property
    def offers(self) -> dict[str, Offer]:
        """What is subscribed to, by topic."""
        return {topic: offer for topic, (offer, _) in self._subscriptions.items()}

    @property
    def has_publisher(self) -> bool:
        """Whether the body's topic is followed, and somebody publishes it."""
        topic = "" if self.source is None else self.source.body.name
        return topic in self._subscriptions and self._node.count_publishers(topic) > 0

    def follow(self) -> None:
        """Looks at the graph and subscribes to what is new or has changed; cheap, to be called often."""
        try:
            source = self._fitting()
        except MissingTopicError as error:
            self.waiting_for = str(error)
            return
        if self.source is None:
            self._newest = self._past(self._found(source.body.name))
            self._newest_pose_ns = self._newest.get(source.body.name, 0)
            self._config = replace(self._config, topic=source.body.name)
        self.source = source
        rig = [one.name for one in self._rig if one.name in self.source.topics and one.name != self.source.body.name]
        self._follow_topics(rig)
        self._looks += 1
        if self._looks > LOOKS_FOR_THE_RIG or self._tf_static not in rig or self._rig_is_known():
            self._follow_topics([topic for topic in self.source.topics if topic not in rig])

    def _past(self, newest: Mapping[str, int]) -> dict[str, int]:
        """Times of publication before the present one; later ones are from a clock that was set back."""
        past, warning = published_before(newest, Clock(clock_type=ClockType.SYSTEM_TIME).now().nanoseconds)
        if warning:
            self._node.get_logger().warning(warning)
        return past

    def _follow_topics(self, topics: Sequence[str]) -> None:
        for topic in topics:
            offer = self._offer(topic)
            known = self._subscriptions.get(topic)
            if offer is not None and (known is None or known[0] != offer):
                self._subscribe(topic, offer)

    def _rig_is_known(self) -> bool:
        """Whether the static transforms have come, or their publishers keep none for late subscribers."""
        if self._tf_static not in self._subscriptions:
            return False
        return self._tf_static in self._heard or not self._subscriptions[self._tf_static][0].qos.latched

    def read(self, received: Received) -> tuple[str, int, tuple[Measured, ...]]:
        """Reads a message: its topic, its time of publication [ns], and its poses.

        To be called on one thread, in the order in which messages came. Images may have waited for a CameraInfo, so what it
        gives counts as of the newest of them; it itself is needed again after a restart and so is never known.
        """
        if self.source is None:
            return received.topic, received.published_ns, ()
        topic, published_ns, message = received
        measured = self.source.measured(topic, message, self._detections)
        if self.source.camera is not None and topic == self.source.camera.name:
            return self.source.body.name, self._newest_pose_ns, measured
        if topic == self.source.body.name:
            self._newest_pose_ns = published_ns
        return topic, published_ns, measured

    def _fitting(self) -> PoseSource:
        """The topics that fit; the body's own has to be there, TF is listened to in any case."""
        named = {self._config.topic, self._config.camera_info, *(one.name for one in self._rig)}
        present = [
            TypedTopic(name, kind)
            for name, kinds in self._node.get_topic_names_and_types()
            for kind in kinds
            if kind in READ_TYPES and self._node.count_publishers(name) and self._accepted(name, kind)
            if is_own(self._node, name, named)
        ]
        if self._config.topic in [one.name for one in self._rig]:
            return find_pose_source("graph", [*present, *self._rig], self._body, self._config)
        chosen = find_pose_source("graph", present, self._body, self._config).body
        return find_pose_source("graph", [*present, *self._rig], self._body, replace(self._config, topic=chosen.name))

    def _accepted(self, name: str, kind: str) -> bool:
        return not self._type_name or name != self._config.topic or kind == self._type_name

    def _offer(self, topic: str) -> Offer | None:
        """What the publishers of a topic offer; None while there are none of the right type."""
        wanted = {one.name: one.type for one in (*self._rig, *(self.source.typed if self.source else ()))}[topic]
        profiles = [info.qos_profile for info in self._node.get_publishers_info_by_topic(topic) if info.topic_type == wanted]
        if not profiles:
            return None
        return Offer(wanted, offered(profiles))

    def _subscribe(self, topic: str, offer: Offer) -> None:
        after_ns = self._newest.get(topic, 0)

        def on_message(message: Any, info: Mapping[str, int]) -> None:
            published_ns = info["source_timestamp"]
            self._heard.add(topic)
            if 0 < published_ns <= after_ns:
                self.known += 1
                return
            self._newest[topic] = published_ns
            self._arrived(Received(topic, published_ns, message))

        if topic in self._subscriptions:
            self._node.destroy_subscription(self._subscriptions[topic][1])
        qos = profile(self._depth, reliable=offer.qos.reliable, latched=offer.qos.latched)
        subscription = self._node.create_subscription(
            message_class(offer.type), topic, on_message, qos, qos_overriding_options=AS_OFFERED
        )
        self._subscriptions[topic] = offer, subscription


def _resolved(node: Node, parameter: str, topic: str) -> str:
    """The name of a topic where the node is, with its remaps.

    Raises:
        InvalidValueError: no topic can be called so.
    """
    try:
        return str(node.resolve_topic_name(topic))
    except RCLError as error:
        raise InvalidValueError(
            f"parameter {parameter}", repr(topic), "a topic's name: letters, digits, _ and /, such as /tag_pose"
        ) from error
