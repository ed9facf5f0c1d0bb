"""Finds the topics with a body's poses in the graph, and subscribes with the quality of service of their publishers.

The publishers are checked repeatedly. Messages that a transient local publisher sends again to a new subscription are
recognised by their time of publication.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

from rclpy._rclpy_pybind11 import RCLError
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.subscription import Subscription

from contact_curation.errors import InvalidValueError, MissingTopicError
from contact_curation.nodes.ros.message_types import is_installed, message_class
from contact_curation.nodes.ros.own_namespace import is_own
from contact_curation.nodes.ros.parameters import declare_config
from contact_curation.nodes.ros.qos import AS_OFFERED, Callback, FollowedTopic, Offer, profile
from contact_curation.stages.ingest import published_before
from contact_curation.storage.inputs.pose_messages import POSE_MESSAGES, TF, Measured, frame_name
from contact_curation.storage.inputs.pose_source import PoseSource, PoseTopicConfig, TypedTopic, find_pose_source
from contact_curation.storage.inputs.tag_detections import CAMERA_INFO, DETECTIONS

AUTO, NONE = "auto", "none"
"""Words for an empty topic and an empty board frame, which launch and `-p` cannot pass."""

READ_TYPES = tuple(kind for kind in (*POSE_MESSAGES, DETECTIONS, CAMERA_INFO) if is_installed(kind))
"""Of topics that are looked at without being named: what motion capture publishes beside TF needs a package of its own."""

LOOKS_FOR_A_TOPIC = 10
"""Number of looks at the graph for which a body that was heard on TF may still get a topic of its own."""

MOST_CHILDREN = 64
"""Largest number of frames that are remembered of a topic with poses of several bodies, and of its first messages that wait.

They wait for a message that names the body's frame: then they are of other bodies, otherwise they are taken as the body's."""

LOOKS_FOR_THE_RIG = 10
"""Number of looks at the graph for which poses wait for the rig's static transforms; a fast bag would be far ahead of them.

Discovery may find the publisher of the poses before that of the transforms, so they also wait if none was found yet."""


def declared_poses(node: Node) -> PoseTopicConfig:
    """Declares the parameters of the pose topics."""
    poses = declare_config(node, PoseTopicConfig())
    topic, frame = poses.topic, poses.board_frame
    return replace(poses, topic="" if topic == AUTO else topic, board_frame="" if frame == NONE else frame)


class Received(NamedTuple):
    """A received message.

    Attributes:
        topic: topic of the message.
        published_ns: time of publication on the middleware's clock [ns].
        message: the message.
    """

    topic: str
    published_ns: int
    message: Any


class PoseTopics:
    """Follows the topics of one body.

    Args:
        node: node that subscribes.
        body: name of the body.
        config: names of topics and frames; the node's remaps and namespace apply to them. Topics that it does not name are
            searched for in the node's namespace only, transforms on its `tf` and `tf_static`.
        type_name: ROS type of the body's topic, needed if the topic has several types; empty for any.
        depth: depth of the subscriptions' queues.
        found: called once with the body's topic when it is found; returns for each topic the time of publication up to which
            messages are known from an earlier run [ns].
        arrived: called with each message that is not known yet.

    Attributes:
        source: the topics that were found; None until then.
        waiting_for: what is missing until then.
        known: number of messages that were received again and ignored.
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
        self._followed: dict[str, FollowedTopic] = {}
        self._heard: set[str] = set()
        self._children: frozenset[str] = frozenset()
        self._waiting: list[Measured] | None = []
        self._frames = {body, config.body_frame_of(body)}
        self._tf_listener: Subscription | None = None
        self._looks_on_tf = 0
        self._on_tf = False
        self._looks = 0
        self.source: PoseSource | None = None
        self.waiting_for = ""
        self.known = 0

    @property
    def offers(self) -> dict[str, Offer]:
        """The subscribed topics with their types and quality of service."""
        return {topic: one.offer for topic, one in self._followed.items() if one.offer is not None}

    @property
    def has_publisher(self) -> bool:
        """Whether the body's topic is subscribed to and has a publisher of its type."""
        if self.source is None or self.source.body.name not in self.offers:
            return False
        return self.source.body.type in self._published(self.source.body.name)

    def follow(self) -> None:
        """Looks at the graph and subscribes to topics that are new or have changed; cheap, to be called often."""
        try:
            source = self._fitting()
        except MissingTopicError as error:
            self.waiting_for = str(error)
            self._listen_on_tf()
            return
        self._leave_tf()
        if self.source is None:
            self._newest = self._past(self._found(source.body.name))
            self._newest_pose_ns = self._newest.get(source.body.name, 0)
            self._config = replace(self._config, topic=source.body.name)
        elif not self.offers:  # after `leave`: the clock may have been set back meanwhile
            self._newest = self._past(self._newest)
        self.source = source.of_children(self._children)
        rig = [one.name for one in self._rig if one.name in self.source.topics and one.name != self.source.body.name]
        self._follow_topics(rig)
        self._looks += 1
        if self._looks > LOOKS_FOR_THE_RIG or self._tf_static not in rig or self._rig_is_known():
            self._follow_topics([topic for topic in self.source.topics if topic not in rig])

    def leave(self) -> None:
        """Leaves the topics once all messages that have come are taken. `follow` subscribes again, and waits for no rig."""
        for one in self._followed.values():
            one.leave()
        self._followed.clear()
        self._leave_tf()
        self._looks = LOOKS_FOR_THE_RIG

    def _past(self, newest: Mapping[str, int]) -> dict[str, int]:
        """The times of publication that are not in the future; those in the future are from before a clock was set back."""
        past, warning = published_before(newest, Clock(clock_type=ClockType.SYSTEM_TIME).now().nanoseconds)
        if warning:
            self._node.get_logger().warning(warning)
        return past

    def _follow_topics(self, topics: Sequence[str]) -> None:
        kinds = {one.name: one.type for one in (*self._rig, *(self.source.typed if self.source else ()))}
        for topic in topics:
            if topic not in self._followed:
                self._followed[topic] = FollowedTopic(self._node, topic, self._depth, partial(self._listener, topic))
            self._followed[topic].follow(kinds[topic])

    def _rig_is_known(self) -> bool:
        """Whether the static transforms were received, or their publishers keep none for late subscribers."""
        if self._tf_static not in self.offers:
            return False
        return self._tf_static in self._heard or not self.offers[self._tf_static].qos.latched

    def read(self, received: Received) -> tuple[str, int, tuple[Measured, ...]]:
        """Reads a message; returns its topic, its time of publication [ns], and its poses.

        Call it on one thread, in the order in which messages came. Images may have waited for a CameraInfo; the poses that
        follow from it count as published with the newest of these images, as do poses that have waited for the body's frame
        to be named. A CameraInfo itself is never ignored as known, because it is needed again after a restart.
        """
        if self.source is None:
            return received.topic, received.published_ns, ()
        topic, published_ns, message = received
        if topic == self.source.body.name and self.source.has_children:
            measured = self._of_the_body(self.source, message)
        else:
            measured = self.source.measured(topic, message, self._detections)
        if self.source.camera is not None and topic == self.source.camera.name:
            return self.source.body.name, self._newest_pose_ns, measured
        if topic == self.source.body.name:
            self._newest_pose_ns = published_ns
        return topic, published_ns, measured

    def _of_the_body(self, source: PoseSource, message: Any) -> tuple[Measured, ...]:
        """The body's poses, where messages of its topic may be of several bodies."""
        child = frame_name(message.child_frame_id)
        if len(self._children) < MOST_CHILDREN:
            self._children |= {child}  # another set: `follow` runs on another thread
        measured = source.of_children(self._children).measured(source.body.name, message)
        if self._waiting is None or source.is_own(child):
            self._waiting = None
            return measured
        self._waiting += measured
        if len(self._waiting) < MOST_CHILDREN:
            return ()
        waited, self._waiting = self._waiting, None
        return tuple(waited)

    def _fitting(self) -> PoseSource:
        """The topics to use: the body's topic must exist, or the body be on TF; TF is always used.

        Types are those of publishers: a subscriber may ask for another one, and hears nothing.
        """
        named = {self._config.topic, self._config.camera_info, *(one.name for one in self._rig)}
        present = [
            TypedTopic(name, kind)
            for name, kinds in self._node.get_topic_names_and_types()
            if (name == self._config.topic or any(kind in READ_TYPES for kind in kinds)) and is_own(self._node, name, named)
            for kind in self._published(name)
            if kind in READ_TYPES or name == self._config.topic
        ]
        readable = [one for one in present if self._accepted(one)]
        if self._config.topic in [one.name for one in self._rig]:
            return find_pose_source("graph", [*readable, *self._rig], self._body, self._config)
        other = [one for one in present if one.name == self._config.topic]
        if other and not any(one in readable for one in other):
            listed = [f"{one.name} ({one.type})" for one in other]
            raise MissingTopicError("graph", f"type {self._type_name} there, as the parameter type says", listed)
        on_tf = self._rig[:1] if self._on_tf and self._looks_on_tf > LOOKS_FOR_A_TOPIC else ()
        chosen = find_pose_source("graph", [*readable, *on_tf], self._body, self._config).body
        return find_pose_source("graph", [*readable, *self._rig], self._body, replace(self._config, topic=chosen.name))

    def _published(self, topic: str) -> list[str]:
        """The types of a topic's publishers."""
        return sorted({info.topic_type for info in self._node.get_publishers_info_by_topic(topic)})

    def _accepted(self, topic: TypedTopic) -> bool:
        return not self._type_name or topic.name != self._config.topic or topic.type == self._type_name

    def _listen_on_tf(self) -> None:
        """Hears whether the body is on TF, where no topic has its poses."""
        self._looks_on_tf += self._on_tf
        if self._config.topic or self._detections is not None or not self._published(self._rig[0].name):
            return
        if self._tf_listener is None:
            qos = profile(self._depth, reliable=False, latched=False)
            self._tf_listener = self._node.create_subscription(
                message_class(TF), self._rig[0].name, self._heard_on_tf, qos, qos_overriding_options=AS_OFFERED
            )

    def _heard_on_tf(self, message: Any) -> None:
        self._on_tf = self._on_tf or any(frame_name(one.child_frame_id) in self._frames for one in message.transforms)

    def _leave_tf(self) -> None:
        if self._tf_listener is not None:
            self._node.destroy_subscription(self._tf_listener)
            self._tf_listener = None

    def _listener(self, topic: str, _: Offer) -> Callback:
        after_ns = self._newest.get(topic, 0)

        def on_message(message: Any, info: Mapping[str, int]) -> None:
            published_ns = info["source_timestamp"]
            self._heard.add(topic)
            if 0 < published_ns <= after_ns:
                self.known += 1
                return
            self._newest[topic] = published_ns
            self._arrived(Received(topic, published_ns, message))

        return on_message


def _resolved(node: Node, parameter: str, topic: str) -> str:
    """The full name of a topic in the node's namespace, with the node's remaps.

    Raises:
        InvalidValueError: the text is not a valid topic name.
    """
    try:
        return str(node.resolve_topic_name(topic))
    except RCLError as error:
        raise InvalidValueError(
            f"parameter {parameter}", repr(topic), "a topic's name: letters, digits, _ and /, such as /tag_pose"
        ) from error
