"""Bags that the tests write themselves, in every format, through rosbags and mcap as well as through this package."""

import os
import struct
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mcap.writer import CompressionType, Writer
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_typestore

from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.bags.writer import BagWriter

JAZZY = get_typestore(Stores.ROS2_JAZZY)
NOETIC = get_typestore(Stores.ROS1_NOETIC)
ODOMETRY = "nav_msgs/msg/Odometry"
STRING = "std_msgs/msg/String"
CUBE = "/tagslam/odom/body_cube"
NOTE = "/note"
STEP_NS = 6_756_757
CHUNK_BYTES = 100_000
START_NS = 1_700_000_000_000_000_000


class Sent(NamedTuple):
    """One message to write: what a reader must give back."""

    topic: str
    log_time_ns: int
    message: Any

    @property
    def cdr(self) -> bytes:
        return bytes(JAZZY.serialize_cdr(self.message, self.message.__msgtype__, little_endian=True))


def odometry(number: int, store: Any = JAZZY) -> Any:
    """Odometry `number`, as TagSLAM gives it; of ROS 1 when `store` is NOETIC."""
    t = store.types
    draw = np.random.default_rng(number)
    stamp = t["builtin_interfaces/msg/Time"](*divmod(START_NS + number * STEP_NS, 10**9))
    sequence = (number,) if store is NOETIC else ()
    x, y, z, *q = draw.normal(size=7).tolist()
    vector = t["geometry_msgs/msg/Vector3"]
    pose = t["geometry_msgs/msg/Pose"](t["geometry_msgs/msg/Point"](x, y, z), t["geometry_msgs/msg/Quaternion"](*q))
    twist = t["geometry_msgs/msg/Twist"](vector(0.0, 0.0, 0.0), vector(0.0, 0.0, 0.0))
    return t[ODOMETRY](
        t["std_msgs/msg/Header"](*sequence, stamp, "map"),
        "body_cube",
        t["geometry_msgs/msg/PoseWithCovariance"](pose, draw.uniform(size=36)),
        t["geometry_msgs/msg/TwistWithCovariance"](twist, np.zeros(36)),
    )


def note(text: str, store: Any = JAZZY) -> Any:
    return store.types[STRING](text)


def recording(count: int, store: Any = JAZZY) -> list[Sent]:
    """`count` odometry messages with a note after every hundredth, in order of log time."""
    sent = []
    for number in range(count):
        time_ns = START_NS + number * STEP_NS
        sent.append(Sent(CUBE, time_ns, odometry(number, store)))
        if number % 100 == 0:
            sent.append(Sent(NOTE, time_ns + 1, note(f"at {number}", store)))
    return sent


def write_ours(path: Path, sent: Iterable[Sent]) -> Path:
    with BagWriter(path) as writer:
        for one in sent:
            writer.write(one.topic, one.message, one.log_time_ns, latched=one.topic == NOTE)
    return path


def write_mcap(
    path: Path, sent: Iterable[Sent], schemas: dict[str, tuple[str, str]] | None = None, encoding: str = "cdr", **options: Any
) -> Path:
    """MCAP by mcap's own writer.

    Args:
        path: of the file.
        sent: messages.
        schemas: definition text and its encoding by type, where it is not to be the right one.
        encoding: of the messages, as declared.
        options: of mcap's writer.
    """
    with path.open("wb") as file:
        writer = Writer(file, **{"chunk_size": CHUNK_BYTES, "compression": CompressionType.ZSTD, **options})
        writer.start("ros2", "test")
        channels: dict[str, int] = {}
        for one in sent:
            kind = one.message.__msgtype__
            if one.topic not in channels:
                text, form = (schemas or {}).get(kind) or (JAZZY.generate_msgdef(kind, ros_version=2)[0], "ros2msg")
                schema = writer.register_schema(kind, form, text.encode())
                channels[one.topic] = writer.register_channel(one.topic, encoding, schema)
            writer.add_message(channels[one.topic], one.log_time_ns, one.cdr, one.log_time_ns)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def write_rosbag2(
    folder: Path,
    sent: Iterable[Sent],
    plugin: StoragePlugin,
    compression: CompressionMode | None = None,
    latched: Sequence[str] = (),
) -> Path:
    """A rosbag2 folder by rosbags."""
    writer = Ros2Writer(folder, version=9, storage_plugin=plugin)
    if compression is not None:
        writer.set_compression(compression, CompressionFormat.ZSTD)
    with writer:
        connections: dict[str, Any] = {}
        for one in sent:
            if one.topic not in connections:
                qos = [transient_local()] if one.topic in latched else []
                kind = one.message.__msgtype__
                connections[one.topic] = writer.add_connection(one.topic, kind, typestore=JAZZY, offered_qos_profiles=qos)
            writer.write(connections[one.topic], one.log_time_ns, one.cdr)
    return folder


def transient_local() -> Qos:
    never = QosTime(2147483647, 4294967295)
    return Qos(
        QosHistory.KEEP_LAST,
        1,
        QosReliability.RELIABLE,
        QosDurability.TRANSIENT_LOCAL,
        never,
        never,
        QosLiveliness.AUTOMATIC,
        never,
        False,
    )


def write_ros1(path: Path, sent: Iterable[Sent], compression: str = "none", latched: Sequence[str] = ()) -> Path:
    """A ROS 1 bag by rosbags; the messages are NOETIC's."""
    writer = Ros1Writer(path)
    writer.chunk_threshold = CHUNK_BYTES
    if compression != "none":
        writer.set_compression(Ros1Writer.CompressionFormat[compression.upper()])
    with writer:
        connections: dict[str, Any] = {}
        for one in sent:
            kind = one.message.__msgtype__
            if one.topic not in connections:
                latching = int(one.topic in latched)
                connections[one.topic] = writer.add_connection(one.topic, kind, typestore=NOETIC, latching=latching)
            writer.write(connections[one.topic], one.log_time_ns, NOETIC.serialize_ros1(one.message, kind))
    return path


def flipped(path: Path, offset: int, count: int = 1) -> None:
    """Inverts `count` bytes of a file."""
    data = bytearray(path.read_bytes())
    for place in range(offset, offset + count):
        data[place] ^= 0xFF
    path.write_bytes(data)


def read(path: Path, topics: Sequence[str] | None = None) -> tuple[list[Sent], tuple[str, ...]]:
    """All decoded messages of a bag, and the losses."""
    with BagReader(path) as reader:
        found = [Sent(message.topic, message.log_time_ns, message.message) for message in reader.messages(topics)]
        return found, reader.losses


def same(one: Any, other: Any) -> bool:
    """Whether two message objects of any type store hold the same values, bit for bit."""
    if isinstance(other, np.ndarray):
        return bool(one.dtype == other.dtype and one.tobytes() == other.tobytes())
    if isinstance(other, list):
        return len(one) == len(other) and all(same(a, b) for a, b in zip(one, other))
    if hasattr(other, "__dataclass_fields__"):
        return one.__msgtype__ == other.__msgtype__ and all(
            same(getattr(one, name), getattr(other, name)) for name in other.__dataclass_fields__ if not name.startswith("__")
        )
    return bool(one == other)


def assert_same(found: Sequence[Sent], expected: Sequence[Sent]) -> None:
    assert [(one.topic, one.log_time_ns) for one in found] == [(one.topic, one.log_time_ns) for one in expected]
    for one, other in zip(found, expected):
        assert same(one.message, other.message), (one, other)


def rollback_journal(database: Path, super_journal: Path) -> bytes:
    """A journal without pages whose end says that `super_journal` holds the names of the journals of one transaction."""
    magic, name = bytes.fromhex("d9d505f920a163d7"), os.fsencode(super_journal)
    head = magic + struct.pack(">5I", 0, 0, database.stat().st_size // 4096, 512, 4096)
    return head.ljust(512, b"\0") + struct.pack(">I", 0x40001) + name + struct.pack(">2I", len(name), sum(name)) + magic
