"""Finds the topics of a bag or a graph with the body's poses, and reads their messages."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

from contact_curation.configs import ranged
from contact_curation.contact.body import Body
from contact_curation.errors import InvalidValueError, MissingTopicError, near_name
from contact_curation.motion.body_tracker import TrackerConfig
from contact_curation.motion.pose_stream import BadPose
from contact_curation.motion.tags.pose import TagPoseConfig
from contact_curation.storage.inputs.pose_messages import (
    BODY_PREFIX,
    ONLY,
    POSE_MESSAGES,
    TAG_FRAME,
    TAG_FRAMES,
    TF,
    Measured,
    frame_name,
    measured_pose,
    measured_tags,
    measured_transforms,
)
from contact_curation.storage.inputs.tag_detections import CAMERA_INFO, DETECTIONS, TagDetections
from contact_curation.storage.tag_map_file import read_tag_rig

TF_STATIC_NAME = "tf_static"
NOT_TRACKED = ("ground_truth", "grip")
"""Last names of topics with poses that no tracker measured: of a simulation, and of the grip that a throw wants."""

POSE_TYPES = (*POSE_MESSAGES, TF, *TAG_FRAMES)
"""Types of the topic with a body's poses."""

WITH_CHILD = ("nav_msgs/msg/Odometry", "geometry_msgs/msg/TransformStamped")
"""Types whose messages say in `child_frame_id` whose pose they have."""

BY_TAG_MAP = "detections of tags are read with a tag map"
"""Said where no topic has poses, but one has detections."""


class TypedTopic(NamedTuple):
    """A topic and its ROS 2 type name."""

    name: str
    type: str


MOST_AHEAD = 1.0
"""Of transforms [s]: poses wait for no more."""


@dataclass(frozen=True)
class PoseTopicConfig:
    """Where the body's poses are; what is left empty is found.

    Attributes:
        topic: topic with the body's poses, or a TF topic; empty: the only one that fits.
        body_frame: frame of the body; empty: `body_<name>`, as TagSLAM names it. Only messages on TF must name it.
        board_frame: frame of the board; empty: the frame that the poses are given in.
        array_index: index of the body's pose in a PoseArray; -1: the only one.
        tag_map: YAML file with the tags of body and board, in our form or TagSLAM's; poses are then computed from
            AprilTagDetectionArray.
        camera_info: topic of the camera that saw the tags, whatever frame it has; empty: the only one, or the one beside the
            detections, of the frame of these.
        rectified: whether tags were detected in rectified images, so that P of CameraInfo holds; otherwise K and D hold.
        tags: requirements on a pose that is computed from tags.
        largest_speed: largest speed between two poses from tags; a faster one is a tracking outlier [m/s].
        largest_spin: largest angular speed between two poses from tags [rad/s].
        transforms_ahead: transforms that move a camera or a board are ahead of poses with the same stamps by so much;
            negative: behind [s].
    """

    topic: str = ""
    body_frame: str = ""
    board_frame: str = "body_surface"
    array_index: int = ONLY
    tag_map: str = ""
    camera_info: str = ""
    rectified: bool = True
    tags: TagPoseConfig = field(default_factory=TagPoseConfig)
    largest_speed: float = 10.0
    largest_spin: float = 60.0
    transforms_ahead: float = ranged(0.0, -MOST_AHEAD, MOST_AHEAD)

    def __post_init__(self) -> None:
        if self.array_index < ONLY:
            raise InvalidValueError("array_index", self.array_index, "0 or more, or -1 for the only one")
        if not abs(self.transforms_ahead) <= MOST_AHEAD:
            expected = f"seconds from {-MOST_AHEAD:g} to {MOST_AHEAD:g}"
            raise InvalidValueError("transforms_ahead", self.transforms_ahead, expected)
        for name in ("body_frame", "board_frame"):  # as the frames of messages
            object.__setattr__(self, name, frame_name(getattr(self, name)))

    def body_frame_of(self, body: str) -> str:
        """The frame of a body."""
        return self.body_frame or f"body_{body}"

    def tracker(self, body: Body, board_frame: str) -> TrackerConfig:
        """The frames of a body and a board as the tracker wants them; it looks for jumps in poses from tags alone."""
        speed, spin = (self.largest_speed, self.largest_spin) if self.tag_map else (inf, inf)
        x, y, z = body.center_of_mass.tolist()
        return TrackerConfig(
            self.body_frame_of(body.name),
            board_frame,
            largest_speed=speed,
            largest_spin=spin,
            center_of_mass=(x, y, z),
            transforms_ahead=self.transforms_ahead,
        )

    def detections(self, body: str) -> TagDetections | None:
        """A reader of detections, to be used for one recording or node; None where poses come as such.

        Raises:
            UnreadableInputError: the tag map cannot be read, or has no tags of the body.
        """
        if not self.tag_map:
            return None
        rig = read_tag_rig(Path(self.tag_map), self.body_frame_of(body), self.board_frame)
        return TagDetections(rig, self.tags, rectified=self.rectified, any_frame=bool(self.camera_info))


@dataclass(frozen=True)
class PoseSource:
    """The topics that are read for one body.

    Attributes:
        body: topic with the body's poses; a topic of `transforms` if they are only there.
        body_frame: frame of the body.
        board: topic with the board's poses, or None.
        board_frame: frame of the board; empty if the body's poses are given on the board.
        transforms: topics with poses of many frames, of which the body's may be one: TF, and the one that is chosen with
            poses of tags.
        array_index: index of the body's pose in a PoseArray; -1: the only one.
        camera: topic with the camera's CameraInfo, if the body's topic has tag detections.
        wanted_board: the configured frame of the board, even if nothing leads to it.
        children: frames that messages of the body's topic are of (`child_frame_id`), if they are of several or of the body's.
        other_tags: topics with poses of tags that are not read.
    """

    body: TypedTopic
    body_frame: str
    board: TypedTopic | None
    board_frame: str
    transforms: tuple[str, ...]
    array_index: int = ONLY
    camera: TypedTopic | None = None
    wanted_board: str = ""
    children: frozenset[str] = frozenset()
    other_tags: tuple[str, ...] = ()

    def of_children(self, children: frozenset[str]) -> "PoseSource":
        """The same, where messages of the body's topic were seen to be of these frames."""
        return replace(self, children=children) if len(children) > 1 or children & self._own_names else self

    @property
    def has_children(self) -> bool:
        """Whether messages of the body's topic say whose poses they are, and its name does not."""
        return self.body.type in WITH_CHILD and _last_part(self.body.name) not in self._own_names

    @property
    def is_mixed(self) -> bool:
        """Whether the body's topic has poses of several frames, none of them the body's."""
        return len(self.children) > 1 and not self.children & self._own_names

    @property
    def _own_names(self) -> frozenset[str]:
        return frozenset((self.body_frame, self.body_frame.removeprefix(BODY_PREFIX)))

    def is_own(self, child: str) -> bool:
        """Whether a frame that messages of the body's topic are of (`child_frame_id`) is the body's."""
        return frame_name(child) in self._own_names

    def _is_of_another(self, child: str) -> bool:
        """Whether a message of the body's topic is of another body: then some are of this one."""
        return bool(self.children & self._own_names) and not self.is_own(child)

    @property
    def typed(self) -> tuple[TypedTopic, ...]:
        """The topics that belong to this body and its rig only."""
        return tuple(one for one in (self.body, self.board, self.camera) if one is not None)

    @property
    def topics(self) -> tuple[str, ...]:
        """All topics to read."""
        return tuple(dict.fromkeys((*(one.name for one in self.typed), *self.transforms)))

    def measured(self, topic: str, message: Any, detections: TagDetections | None = None) -> tuple[Measured, ...]:
        """The poses of the body and the rig in a message of one of `topics`.

        TF often repeats what the body's own topic says; there it is left out.

        Args:
            topic: topic of the message.
            message: message, decoded by any library.
            detections: reader of tag detections, if the body's topic has them.
        """
        if detections is not None and self.camera is not None and topic in (self.camera.name, self.body.name):
            return detections.calibrated(message) if topic == self.camera.name else detections.detected(message)
        if topic in self.transforms:
            kind, static = self.type_of(topic), self.is_static(topic)
            transforms = measured_tags(kind, message) if kind in TAG_FRAMES else measured_transforms(message, static=static)
            return tuple(one for each in transforms if (one := self._named(topic, each)) is not None)
        if self.board is not None and topic == self.board.name:
            return (measured_pose(self.board.type, message, self.board_frame),)
        if self.children and self._is_of_another(message.child_frame_id):
            return ()
        return (measured_pose(self.body.type, message, self.body_frame, self.array_index),)

    def type_of(self, topic: str) -> str:
        """The ROS 2 type name that messages of one of `topics` are read by."""
        if topic in self.transforms and topic != self.body.name:
            return TF
        return self.board.type if self.board is not None and topic == self.board.name else self.body.type

    def is_static(self, topic: str) -> bool:
        """Whether the poses of a topic hold for all times."""
        return topic in self.transforms and _last_part(topic) == TF_STATIC_NAME

    def frames(self, topic: str, parent: str, child: str) -> tuple[str, str] | None:
        """Parent and child of a pose whose message calls them so; None where it is left out.

        On TF, TagSLAM's frames are renamed, `cube` to `body_cube`; what is between the two names of one frame is left out. So
        are moving tags where they are read from a topic of their own.
        """
        parent = frame_name(parent)
        if topic not in self.transforms:
            if self.board is not None and topic == self.board.name:
                return parent, self.board_frame
            return None if self.children and self._is_of_another(child) else (parent, self.body_frame)
        child = frame_name(child)
        known = self._known_frames
        renamed = known.get(parent, parent), known.get(child, child)
        if renamed[0] == renamed[1] and renamed != (parent, child):
            return None
        return None if self._is_elsewhere(topic, renamed[1]) else renamed

    def _is_elsewhere(self, topic: str, child: str) -> bool:
        """Whether another topic than this one of `transforms` is read for a frame."""
        if self.body.type in TAG_FRAMES:
            return topic != self.body.name and not self.is_static(topic) and bool(TAG_FRAME.fullmatch(child))
        return self.body.type != TF and child == self.body_frame

    def _named(self, topic: str, transform: Measured) -> Measured | None:
        """The transform with its frames as `frames` has them."""
        if isinstance(transform, BadPose):
            child = self._known_frames.get(transform.child, transform.child)
            return None if self._is_elsewhere(topic, child) else replace(transform, child=child)
        renamed = self.frames(topic, transform.parent, transform.child)
        return renamed and replace(transform, parent=renamed[0], child=renamed[1])

    @property
    def _known_frames(self) -> dict[str, str]:
        return {frame.removeprefix(BODY_PREFIX): frame for frame in (self.body_frame, self.board_frame) if frame}


def find_pose_source(where: Path | str, topics: Collection[TypedTopic], body: str, config: PoseTopicConfig) -> PoseSource:
    """Chooses the topics with a body's poses.

    The body's topic is the configured one; else the one named after the body (TagSLAM's `.../body_<name>`); else the only one
    of the first type of `POSE_MESSAGES` that exists, of topics in a namespace named after the body (`/vrpn/<name>/pose`) or,
    if there are none, of all; else TF; else the only one with poses of tags. Poses that no tracker measured are only used if
    they are named. The board has a topic if one is named after its frame. If nothing can lead to the board, the poses count
    as given on it, which the reader reports (`BagTosses.left_out`).

    Args:
        where: the bag or graph, for error messages.
        topics: the existing topics.
        body: name of the body.
        config: configured topics and frames.

    Raises:
        MissingTopicError: no topic fits, or more than one does.
    """
    if config.tag_map:
        return _tag_source(where, topics, body, config)
    body_frame = config.body_frame_of(body)
    named = _named(topics, config.topic) if config.topic else None
    boards = (one for one in topics if one.type in POSE_MESSAGES and _last_part(one.name) == config.board_frame)
    board = next((one for one in boards if one != named), None)
    transforms = tuple(one.name for one in topics if one.type == TF)
    chosen = named if config.topic else _fitting(topics, board, {body, body_frame, f"body_{body}"})
    if chosen is None:
        listed = sorted(f"{one.name} ({one.type})" for one in topics)
        others = [one.name for one in topics if one.name != config.topic]
        wanted = (
            f"topic {config.topic} with poses{near_name(config.topic, others)}"
            if config.topic
            else f"one topic with poses of {body}; name it (`topic`) if there are several"
        )
        if any(one.type == DETECTIONS for one in topics):
            wanted += f"; {BY_TAG_MAP}"
        if not any(one.type in POSE_TYPES for one in topics):
            wanted += f", of a type that is read: {', '.join(POSE_TYPES)}"
        raise MissingTopicError(where, wanted, listed)
    transforms += (chosen.name,) if chosen.type in TAG_FRAMES else ()
    leads_to_board = bool(transforms) or board is not None
    return PoseSource(
        body=chosen,
        body_frame=body_frame,
        board=board,
        board_frame=config.board_frame if leads_to_board else "",
        transforms=transforms,
        array_index=config.array_index,
        wanted_board=config.board_frame,
        other_tags=tuple(one.name for one in topics if one.type in TAG_FRAMES and one != chosen),
    )


def is_of_another(topic: str, body: str, config: PoseTopicConfig) -> bool:
    """Whether a topic is named after another body, in TagSLAM's form `body_<name>`."""
    name = _last_part(topic)
    return not config.topic and name.startswith("body_") and name != config.body_frame_of(body)


def _tag_source(where: Path | str, topics: Collection[TypedTopic], body: str, config: PoseTopicConfig) -> PoseSource:
    """The topics with tag detections and with their camera's CameraInfo; TF may lead from the camera to the board."""
    detections = _only(topics, DETECTIONS, config.topic)
    beside = "" if detections is None else f"{detections.name.rpartition('/')[0]}/camera_info"
    camera = _only(topics, CAMERA_INFO, config.camera_info) or _only(topics, CAMERA_INFO, beside)
    if detections is None or camera is None:
        wanted = (
            f"one topic with {DETECTIONS} and one with {CAMERA_INFO}, as there is a tag map; name them if there are several"
        )
        if any(one.type in TAG_FRAMES for one in topics):
            wanted += "; poses of tags are read without a tag map"
        raise MissingTopicError(where, wanted, sorted(f"{one.name} ({one.type})" for one in topics))
    transforms = tuple(one.name for one in topics if one.type == TF)
    return PoseSource(detections, config.body_frame_of(body), None, config.board_frame, transforms, camera=camera)


def _only(topics: Collection[TypedTopic], kind: str, name: str) -> TypedTopic | None:
    """The topic of a type with the given name; without a name the only topic of the type."""
    fitting = [one for one in topics if one.type == kind and (not name or one.name.lstrip("/") == name.lstrip("/"))]
    return fitting[0] if len(fitting) == 1 else None


def _named(topics: Collection[TypedTopic], name: str) -> TypedTopic | None:
    return next((one for one in topics if one.name.lstrip("/") == name.lstrip("/") and one.type in POSE_TYPES), None)


def _fitting(topics: Collection[TypedTopic], board: TypedTopic | None, names: set[str]) -> TypedTopic | None:
    candidates = [
        one for one in topics if one.type in POSE_MESSAGES and one != board and _last_part(one.name) not in NOT_TRACKED
    ]
    called = [one for one in candidates if names.intersection(one.name.split("/"))]
    frames = sorted((one for one in topics if one.type == TF), key=lambda one: _last_part(one.name) == TF_STATIC_NAME)[:1]
    moving = [one for one in frames if _last_part(one.name) != TF_STATIC_NAME]
    tiers: Sequence[list[TypedTopic]] = (
        [one for one in candidates if _last_part(one.name) in names],
        *([one for one in called if one.type == kind] for kind in POSE_MESSAGES),
        *([one for one in candidates if one.type == kind] for kind in POSE_MESSAGES),
        moving,
        [one for one in topics if one.type in TAG_FRAMES],
        frames,
    )
    first = next((tier for tier in tiers if tier), [])
    return first[0] if len(first) == 1 else None


def _last_part(topic: str) -> str:
    return topic.rpartition("/")[2]
