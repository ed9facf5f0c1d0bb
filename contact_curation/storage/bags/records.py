"""Records of bags of all file formats: topics, messages, and the QoS of their publishers.

rosbag2 keeps QoS profiles as YAML: written here as Jazzy does, read in the forms of every release. Up to metadata version 8 the
policies are numbers, from version 9 (Jazzy) on they are names.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import yaml

from contact_curation.files import parse_yaml


@dataclass(frozen=True)
class OfferedQos:
    """The quality of service a topic was published with, as far as a player needs it.

    Attributes:
        latched: durability is transient local: who subscribes late still gets the last messages.
        reliable: reliability is reliable, not best effort.
        depth: how many messages the publisher kept.
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
        count: number of messages the bag holds; None when only reading the whole bag would show it.
    """

    name: str
    type: str
    count: int | None


class BagMessage(NamedTuple):
    """A decoded message: `message` has the attributes of its ROS 2 type.

    Messages of ROS 1 bags carry one attribute more: `header.seq`.
    """

    topic: str
    type: str
    log_time_ns: int
    message: Any


class RawMessage(NamedTuple):
    """A message as it is on the wire: CDR bytes and the schema that explains them.

    Attributes:
        topic: name.
        type: ROS 2 type name.
        log_time_ns: when it was recorded.
        data: CDR with its four bytes of encapsulation header; of a ROS 1 bag: translated to CDR.
        publish_time_ns: when it was sent; the log time where the format does not say.
        schema: definition text; empty where the bag carries none.
        schema_encoding: `ros2msg`, `ros2idl` or empty.
        type_hash: `RIHS01_...` as the bag says; empty where it does not.
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
        topic: name.
        type: ROS 2 type name; empty where the file does not say.
        encoding: encoding of the messages: `cdr`, `ros1`, or something this package cannot decode.
        schema: definition text; empty where the file carries none.
        schema_encoding: `ros2msg`, `ros2idl`, `ros1msg`, something this package cannot read, or empty.
        type_hash: `RIHS01_...`; empty where the file carries none.
        qos: quality of service as recorded; None where the file does not say.
    """

    topic: str
    type: str
    encoding: str
    schema: str
    schema_encoding: str
    type_hash: str
    qos: OfferedQos | None


class StoredMessage(NamedTuple):
    """A message in its storage's own encoding."""

    log_time_ns: int
    publish_time_ns: int
    channel: Channel
    data: bytes


TRANSIENT_LOCAL = ("transient_local", 1)
BEST_EFFORT = ("best_effort", 2)
DEEPEST = 10_000
"""Messages; more than any publisher keeps, and few enough for a player to keep."""
LARGEST_PROFILE = 1 << 16
"""Characters; longer texts are no QoS profiles, and YAML is slow."""

FOREVER = {"sec": 9223372036, "nsec": 854775807}
"""rmw's infinite duration, which stands for "not set"."""


def profiles_of(qos: OfferedQos) -> list[dict[str, object]]:
    """The list that goes into metadata.yaml."""
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
    """The text that goes into a channel's metadata."""
    return str(yaml.safe_dump(profiles_of(qos), sort_keys=False)).strip()


def qos_from(profiles: object) -> OfferedQos | None:
    """The QoS a topic was offered with: latched and reliable when any of its publishers was.

    Args:
        profiles: a list of profiles or YAML text of one.

    Returns:
        None where nothing can be read from `profiles`: QoS only guides a player, so bad QoS must not cost any messages.
    """
    if isinstance(profiles, str):
        profiles = _parsed(profiles)
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
