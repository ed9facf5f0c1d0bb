"""What goes into and comes out of bags, whatever their file format."""

from dataclasses import dataclass
from typing import Any, NamedTuple


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
        name: with its leading slash.
        type: ROS 2 type name, e.g. `nav_msgs/msg/Odometry`.
        count: number of messages the bag holds; None when only reading the whole bag would tell.
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
        encoding: of the messages: `cdr`, `ros1`, or something this package cannot decode.
        schema: definition text; empty where the file carries none.
        schema_encoding: `ros2msg`, `ros2idl`, `ros1msg`, something this package cannot read, or empty.
        type_hash: `RIHS01_...`; empty where the file carries none.
        qos: as recorded; None where the file does not say.
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
