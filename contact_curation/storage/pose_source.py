"""Which topics of a bag or a graph tell where the body is, and how their messages are read."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from contact_curation.errors import InvalidValueError, MissingTopicError
from contact_curation.storage.pose_messages import POSE_TYPES, TF, Measured, measured_pose, measured_transforms

TF_STATIC_NAME = "tf_static"


class TypedTopic(NamedTuple):
    """A topic and its ROS 2 type name."""

    name: str
    type: str


@dataclass(frozen=True)
class PoseTopicConfig:
    """Where the body's poses are; what is left empty is found.

    Attributes:
        topic: with the body's poses, or a TF topic; empty: the one that fits.
        body_frame: the body's frame; empty: `body_<name>`, as TagSLAM calls it. Only on TF does a message have to name it.
        board_frame: the board's frame; empty: the one that the poses are given in.
        array_index: which pose of a PoseArray is the body's.
    """

    topic: str = ""
    body_frame: str = ""
    board_frame: str = "body_surface"
    array_index: int = 0

    def __post_init__(self) -> None:
        if self.array_index < 0:
            raise InvalidValueError("array_index", self.array_index, "0 or more")


@dataclass(frozen=True)
class PoseSource:
    """The topics that are read for one body.

    Attributes:
        body: topic with the body's poses; a TF topic where they are only there.
        body_frame: what its poses are of.
        board: topic with the board's poses, or None.
        board_frame: what those are of; empty where the body's poses are given on the board.
        transforms: TF topics.
        array_index: which pose of a PoseArray is the body's.
    """

    body: TypedTopic
    body_frame: str
    board: TypedTopic | None
    board_frame: str
    transforms: tuple[str, ...]
    array_index: int = 0

    @property
    def topics(self) -> tuple[str, ...]:
        """All topics to read."""
        board = () if self.board is None else (self.board.name,)
        return tuple(dict.fromkeys((self.body.name, *board, *self.transforms)))

    def measured(self, topic: str, message: Any) -> tuple[Measured, ...]:
        """What a message of one of `topics` tells of the body and the rig.

        TF often repeats what the body's own topic says; there it is left out.
        """
        if topic in self.transforms:
            found = measured_transforms(message, static=_last_part(topic) == TF_STATIC_NAME)
            return found if self.body.type == TF else tuple(one for one in found if one.child != self.body_frame)
        if self.board is not None and topic == self.board.name:
            return (measured_pose(self.board.type, message, self.board_frame),)
        return (measured_pose(self.body.type, message, self.body_frame, self.array_index),)


def find_pose_source(where: Path | str, topics: Collection[TypedTopic], body: str, config: PoseTopicConfig) -> PoseSource:
    """Chooses the topics that tell of a body.

    The body's topic is the one configured; or the one named after the body (TagSLAM's `.../body_<name>`); or the only one of
    the first of `POSE_TYPES` that there is; or TF. The board has a topic if one is named after its frame; where nothing else
    could lead to it, the poses are taken to be given on it.

    Args:
        where: the bag or graph, for messages.
        topics: what there is.
        body: its name.
        config: what is wanted.

    Raises:
        MissingTopicError: nothing fits, or several topics do.
    """
    body_frame = config.body_frame or f"body_{body}"
    board = next((one for one in topics if one.type in POSE_TYPES and _last_part(one.name) == config.board_frame), None)
    transforms = tuple(one.name for one in topics if one.type == TF)
    chosen = _named(topics, config.topic) if config.topic else _fitting(topics, board, {body, body_frame, f"body_{body}"})
    if chosen is None:
        listed = sorted(f"{one.name} ({one.type})" for one in topics)
        wanted = (
            f"topic {config.topic} with poses"
            if config.topic
            else f"one topic with poses of {body}; name it if there are several"
        )
        raise MissingTopicError(where, wanted, listed)
    leads_to_board = bool(transforms) or board is not None
    return PoseSource(chosen, body_frame, board, config.board_frame if leads_to_board else "", transforms, config.array_index)


def _named(topics: Collection[TypedTopic], name: str) -> TypedTopic | None:
    return next((one for one in topics if one.name.lstrip("/") == name.lstrip("/") and one.type in (*POSE_TYPES, TF)), None)


def _fitting(topics: Collection[TypedTopic], board: TypedTopic | None, names: set[str]) -> TypedTopic | None:
    candidates = [one for one in topics if one.type in POSE_TYPES and one != board]
    tiers: Sequence[list[TypedTopic]] = (
        [one for one in candidates if _last_part(one.name) in names],
        *([one for one in candidates if one.type == kind] for kind in POSE_TYPES),
        sorted((one for one in topics if one.type == TF), key=lambda one: _last_part(one.name) == TF_STATIC_NAME)[:1],
    )
    first = next((tier for tier in tiers if tier), [])
    return first[0] if len(first) == 1 else None


def _last_part(topic: str) -> str:
    return topic.rpartition("/")[2]
