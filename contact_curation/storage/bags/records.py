"""Records of bags of all file formats: topics, messages, and the QoS of their publishers.

rosbag2 stores QoS profiles as YAML. They are written here as in Jazzy, and read in the forms of every release: up to metadata
version 8 the policies are numbers, from version 9 (Jazzy) on names.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import yaml

from contact_curation.files import parse_yaml


@dataclass(frozen=True)
class OfferedQos:
    """The quality of service of a topic's publishers, as far as a player needs it.

    Attributes:
        latched: durability is transient local: late subscribers receive the last messages.
        reliable: reliability is reliable, not best effort.
        depth: number of messages that the publisher keeps.
    """

    latched: bool = False
    reliable: bool = True
    depth: int = 10


@dataclass(frozen=True)
class TopicInfo:
    """One topic of a bag.

    Attributes:
        name: name with its leading slash.
        type: ROS 2 type name, e.g. `nav_msgs/msg/Odometry`.
        count: number of messages; None if it is only known after reading the whole bag.
    """

    name: str
    type: str
    count: int | None


class BagMessage(NamedTuple):
    """A decoded message: `message` has the attributes of its ROS 2 type.

    Messages of ROS 1 bags have one more attribute, `header.seq`.
    """

    topic: str
    type: str
    log_time_ns: int
    message: Any


class RawMessage(NamedTuple):
    """A serialised message: CDR bytes with their schema.

    Attributes:
        topic: name of the topic.
        type: ROS 2 type name.
        log_time_ns: time at which it was recorded [ns].
        data: CDR with its four bytes of encapsulation header; messages of a ROS 1 bag are converted to CDR.
        publish_time_ns: time at which it was sent [ns]; the log time if the format does not contain it.
        schema: definition text; empty if the bag contains none.
        schema_encoding: `ros2msg`, `ros2idl` or empty.
        type_hash: `RIHS01_...`; empty if the bag contains none.
    """

    topic: str
    type: str
    log_time_ns: int
    data: bytes
    publish_time_ns: int
    schema: str
    schema_encoding: str
    type_hash: str


@dataclass(frozen=True, eq=False)
class Channel:
    """A stream of messages of one type on one topic, as a storage file declares it; compared by identity.

    Attributes:
        topic: name of the topic.
        type: ROS 2 type name; empty if the file does not contain it.
        encoding: encoding of the messages: `cdr`, `ros1`, or one that this package cannot decode.
        schema: definition text; empty if the file contains none.
        schema_encoding: `ros2msg`, `ros2idl`, `ros1msg`, one that this package cannot read, or empty.
        type_hash: `RIHS01_...`; empty if the file contains none.
        qos: quality of service as recorded; None if the file does not contain it.
    """

    topic: str
    type: str
    encoding: str
    schema: str
    schema_encoding: str
    type_hash: str
    qos: OfferedQos | None


class StoredMessage(NamedTuple):
    """A message in the encoding of its storage."""

    log_time_ns: int
    publish_time_ns: int
    channel: Channel
    data: bytes


TRANSIENT_LOCAL = ("transient_local", 1)
BEST_EFFORT = ("best_effort", 2)
DEEPEST = 10_000
"""Largest accepted depth [messages]; more than publishers keep, and few enough for a player."""
LARGEST_PROFILE = 1 << 16
"""Longest accepted text of QoS profiles [characters], because parsing YAML is slow."""

FOREVER = {"sec": 9223372036, "nsec": 854775807}
"""The infinite duration of rmw, which means "not set"."""


def profiles_of(qos: OfferedQos) -> list[dict[str, object]]:
    """The list of profiles for metadata.yaml."""
    return [
        {
            "history": "keep_last",
            "depth": qos.depth,
            "reliability": "reliable" if qos.reliable else "best_effort",
            "durability": "transient_local" if qos.latched else "volatile",
            "deadline": dict(FOREVER),
            "lifespan": dict(FOREVER),
            "liveliness": "automatic",
            "liveliness_lease_duration": dict(FOREVER),
            "avoid_ros_namespace_conventions": False,
        }
    ]


def profiles_text(qos: OfferedQos) -> str:
    """The text of the profiles for a channel's metadata."""
    return str(yaml.safe_dump(profiles_of(qos), sort_keys=False)).strip()


def qos_from(profiles: object) -> OfferedQos | None:
    """Reads the QoS of a topic: latched and reliable if any of its publishers was.

    Args:
        profiles: a list of profiles or YAML text of one.

    Returns:
        None if `profiles` cannot be read. QoS is only needed by the player, so an error here must not lose messages.
    """
    return _qos_of_text(profiles) if isinstance(profiles, str) else _qos_of(profiles)


@lru_cache(maxsize=256)
def _qos_of_text(text: str) -> OfferedQos | None:
    """The same for all channels of a bag, mostly; parsing YAML takes most of the time that opening a bag takes."""
    return _qos_of(_parsed(text))


def _qos_of(profiles: object) -> OfferedQos | None:
    if not isinstance(profiles, list) or not profiles or not all(isinstance(profile, dict) for profile in profiles):
        return None
    depths = [profile.get("depth") for profile in profiles]
    return OfferedQos(
        latched=any(_policy(profile.get("durability")) in TRANSIENT_LOCAL for profile in profiles),
        reliable=any(_policy(profile.get("reliability")) not in BEST_EFFORT for profile in profiles),
        depth=min(max((depth for depth in depths if type(depth) is int and depth >= 0), default=OfferedQos.depth), DEEPEST),
    )


def _policy(value: object) -> object:
    return value.lower() if isinstance(value, str) else value


def _parsed(text: str) -> object:
    if len(text) > LARGEST_PROFILE:
        return None
    try:
        return parse_yaml(text)
    except ValueError:
        return None
