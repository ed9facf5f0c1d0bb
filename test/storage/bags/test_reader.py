"""Whole bags of every format give the same messages, in order of log time, as the field's own tools do."""

import hashlib
import os
import sqlite3
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import CompressionType, IndexType, Writer
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionMode, StoragePlugin
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from contact_curation.errors import MissingTopicError
from contact_curation.storage.bags.file import BagLimits
from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.bags.records import OfferedQos, TopicInfo, profiles_of, qos_from
from test.storage.written_bags import (
    CUBE,
    JAZZY,
    NOETIC,
    NOTE,
    ODOMETRY,
    START_NS,
    STRING,
    Sent,
    assert_same,
    note,
    odometry,
    read,
    recording,
    same,
    write_mcap,
    write_ours,
    write_ros1,
    write_rosbag2,
)

SENT = recording(700)
SENT_ROS1 = recording(700, NOETIC)
MCAP, SQLITE = StoragePlugin.MCAP, StoragePlugin.SQLITE3


def storage_file(folder: Path) -> Path:
    """The one storage file of a rosbag2 folder."""
    (path,) = (entry for entry in folder.iterdir() if entry.name != "metadata.yaml")
    return path


ROS2_FORMATS: dict[str, Callable[[Path], Path]] = {
    "ours": lambda at: write_ours(at / "bag.mcap", SENT),
    "our folder": lambda at: write_ours(at / "bag", SENT),
    "mcap, lz4": lambda at: write_mcap(at / "bag.mcap", SENT, compression=CompressionType.LZ4),
    "mcap, not compressed": lambda at: write_mcap(at / "bag.mcap", SENT, compression=CompressionType.NONE),
    "mcap without chunks": lambda at: write_mcap(at / "bag.mcap", SENT, use_chunking=False),
    "mcap without index": lambda at: write_mcap(
        at / "bag.mcap",
        SENT,
        index_types=IndexType.NONE,
        repeat_channels=False,
        repeat_schemas=False,
        use_statistics=False,
        use_summary_offsets=False,
    ),
    "mcap without message index": lambda at: write_mcap(at / "bag.mcap", SENT, index_types=IndexType.CHUNK),
    "mcap without channels in its index": lambda at: write_mcap(
        at / "bag.mcap", SENT, index_types=IndexType.CHUNK, repeat_channels=False
    ),
    "mcap with schemas alone in its index": lambda at: write_mcap(
        at / "bag.mcap", SENT, index_types=IndexType.NONE, repeat_channels=False, use_statistics=False
    ),
    "mcap without schemas in its index": lambda at: write_mcap(at / "bag.mcap", SENT, repeat_schemas=False),
    "mcap without checksums": lambda at: write_mcap(at / "bag.mcap", SENT, enable_crcs=False),
    "mcap without a proper name": lambda at: write_mcap(at / "recording", SENT),
    "mcap by rosbags": lambda at: write_rosbag2(at / "bag", SENT, MCAP),
    "mcap by rosbags, its file": lambda at: storage_file(write_rosbag2(at / "bag", SENT, MCAP)),
    "mcap by rosbags, compressed chunks": lambda at: write_rosbag2(at / "bag", SENT, MCAP, CompressionMode.STORAGE),
    "mcap by rosbags, compressed file": lambda at: write_rosbag2(at / "bag", SENT, MCAP, CompressionMode.FILE),
    "mcap by rosbags, compressed messages": lambda at: write_rosbag2(at / "bag", SENT, MCAP, CompressionMode.MESSAGE),
    "sqlite3": lambda at: write_rosbag2(at / "bag", SENT, SQLITE),
    "sqlite3, its file": lambda at: storage_file(write_rosbag2(at / "bag", SENT, SQLITE)),
    "sqlite3, compressed file": lambda at: write_rosbag2(at / "bag", SENT, SQLITE, CompressionMode.FILE),
    "sqlite3, compressed file alone": lambda at: storage_file(write_rosbag2(at / "bag", SENT, SQLITE, CompressionMode.FILE)),
    "sqlite3, compressed messages": lambda at: write_rosbag2(at / "bag", SENT, SQLITE, CompressionMode.MESSAGE),
}


@pytest.mark.parametrize("kind", ROS2_FORMATS)
def test_every_ros2_format_gives_the_messages_that_were_written(tmp_path: Path, kind: str) -> None:
    found, losses = read(ROS2_FORMATS[kind](tmp_path))
    assert_same(found, SENT)
    assert losses == ()


@pytest.mark.parametrize("compression", ["none", "bz2", "lz4"])
def test_ros1_bags_give_the_messages_that_were_written(tmp_path: Path, compression: str) -> None:
    found, losses = read(write_ros1(tmp_path / "a.bag", SENT_ROS1, compression))
    assert_same(found, SENT_ROS1)
    assert losses == ()


@pytest.mark.parametrize("kind", ["ours", "our folder", "mcap without chunks", "mcap by rosbags", "sqlite3"])
def test_rosbags_reads_the_same_from_whole_bags(tmp_path: Path, kind: str) -> None:
    path = ROS2_FORMATS[kind](tmp_path)
    with AnyReader([path]) as reader, BagReader(path) as ours:
        theirs = [(c.topic, c.msgtype, time_ns, bytes(data)) for c, time_ns, data in reader.messages()]
        assert [(m.topic, m.type, m.log_time_ns, m.data) for m in ours.raw_messages()] == theirs


def test_topics_come_with_their_types_and_counts(tmp_path: Path) -> None:
    expected = (TopicInfo(NOTE, STRING, 7), TopicInfo(CUBE, ODOMETRY, 700))
    for number, (kind, write) in enumerate(ROS2_FORMATS.items()):
        folder = tmp_path / str(number)
        folder.mkdir()
        with BagReader(write(folder)) as reader:
            assert reader.topics == expected, kind
    with BagReader(write_ros1(tmp_path / "a.bag", SENT_ROS1)) as reader:
        assert reader.topics == expected


@pytest.mark.parametrize("kind", ["ours", "mcap without chunks", "mcap without index", "sqlite3"])
def test_only_the_topics_asked_for_are_read(tmp_path: Path, kind: str) -> None:
    path = ROS2_FORMATS[kind](tmp_path)
    assert_same(read(path, [NOTE])[0], [one for one in SENT if one.topic == NOTE])
    assert read(path, [])[0] == []


def test_asking_for_a_topic_that_is_not_there_names_those_that_are(tmp_path: Path) -> None:
    with BagReader(write_ours(tmp_path / "bag.mcap", SENT)) as reader:
        with pytest.raises(MissingTopicError, match=rf"found {NOTE}, {CUBE}; expected /tagslam/odom/body_surface"):
            reader.messages([CUBE, "/tagslam/odom/body_surface"])
        with pytest.raises(MissingTopicError):
            reader.raw_messages(["/nothing"])
        with pytest.raises(MissingTopicError):
            reader.qos("/nothing")


def test_messages_can_be_read_again_and_side_by_side(tmp_path: Path) -> None:
    with BagReader(write_ours(tmp_path / "bag.mcap", SENT)) as reader:
        first, second = reader.messages(), reader.messages([CUBE])
        pairs = list(zip(first, second, strict=False))
        assert len(pairs) == 700
        assert len(list(reader.messages())) == len(SENT)


SHUFFLED = [SENT[index] for index in np.random.default_rng(0).permutation(len(SENT))]


@pytest.mark.parametrize("chunks", [{"chunk_size": 20_000}, {"use_chunking": False}])
def test_messages_come_in_order_of_log_time_whatever_their_order_in_the_file(tmp_path: Path, chunks: dict[str, Any]) -> None:
    assert_same(read(write_mcap(tmp_path / "bag.mcap", SHUFFLED, **chunks))[0], SENT)
    assert_same(read(write_rosbag2(tmp_path / "bag", SHUFFLED, SQLITE))[0], SENT)


def test_ros1_messages_come_in_order_of_log_time(tmp_path: Path) -> None:
    shuffled = [SENT_ROS1[index] for index in np.random.default_rng(0).permutation(len(SENT_ROS1))]
    assert_same(read(write_ros1(tmp_path / "a.bag", shuffled))[0], SENT_ROS1)


def test_messages_of_one_log_time_keep_the_order_of_the_file(tmp_path: Path) -> None:
    same_time = [Sent(NOTE, 5, note(str(number))) for number in range(300)]
    for path in (
        write_mcap(tmp_path / "bag.mcap", same_time, chunk_size=500),
        write_mcap(tmp_path / "loose.mcap", same_time, use_chunking=False),
        write_rosbag2(tmp_path / "bag", same_time, SQLITE),
    ):
        assert_same(read(path)[0], same_time)


def test_messages_held_back_for_their_order_are_bounded_and_said(tmp_path: Path) -> None:
    first = write_mcap(tmp_path / "bag.mcap", SHUFFLED, chunk_size=20_000)
    with BagReader(first, BagLimits(reorder_bytes=100_000)) as reader:
        assert sorted(m.log_time_ns for m in reader.messages()) == [one.log_time_ns for one in SENT]
        assert reader.losses == (
            "bag.mcap: log times of chunks overlap by more than 100000 bytes: messages may come out of order",
        )


@pytest.mark.parametrize("ending", [".mcap", ".db3"])
@pytest.mark.parametrize("parts", [[SENT[:200], SENT[200:450], SENT[450:]], [SENT[::3], SENT[1::3], SENT[2::3]]])
def test_split_bags_are_read_as_one(tmp_path: Path, ending: str, parts: list[list[Sent]]) -> None:
    folder = tmp_path / "bag"
    folder.mkdir()
    for number, part in zip((9, 10, 11), parts):
        written = write_rosbag2(tmp_path / f"part{number}", part, MCAP if ending == ".mcap" else SQLITE)
        storage_file(written).rename(folder / f"bag_{number}{ending}")
    with BagReader(folder) as reader:
        found = [Sent(m.topic, m.log_time_ns, m.message) for m in reader.messages()]
        assert reader.topics[1].count == 700
        listing = "".join(
            f"{hashlib.sha256((folder / f'bag_{n}{ending}').read_bytes()).hexdigest()}  bag_{n}{ending}\n" for n in (9, 10, 11)
        )
        assert reader.sha256 == hashlib.sha256(listing.encode()).hexdigest()
    assert_same(found, SENT)


def test_the_sha256_is_that_of_the_storage_file(tmp_path: Path) -> None:
    folder = write_ours(tmp_path / "bag", SENT)
    expected = hashlib.sha256((folder / "bag_0.mcap").read_bytes()).hexdigest()
    for path in (folder, folder / "bag_0.mcap"):
        with BagReader(path) as reader:
            assert reader.sha256 == expected


@pytest.mark.parametrize("kind", ["ours", "folder", "sqlite3", "ros1"])
def test_latched_topics_are_known(tmp_path: Path, kind: str) -> None:
    path = {
        "ours": lambda: write_ours(tmp_path / "bag.mcap", SENT[:2]),
        "folder": lambda: write_rosbag2(tmp_path / "bag", SENT[:2], MCAP, latched=[NOTE]),
        "sqlite3": lambda: write_rosbag2(tmp_path / "bag", SENT[:2], SQLITE, latched=[NOTE]),
        "ros1": lambda: write_ros1(tmp_path / "a.bag", SENT_ROS1[:2], latched=[NOTE]),
    }[kind]()
    with BagReader(path) as reader:
        assert reader.qos(NOTE).latched
        assert not reader.qos(CUBE).latched


def test_qos_is_read_in_the_form_of_every_release() -> None:
    qos = OfferedQos(latched=True, reliable=False, depth=7)
    assert qos_from(profiles_of(qos)) == qos
    assert qos_from("- {history: 1, depth: 7, reliability: 2, durability: 1}") == qos
    assert qos_from("- {durability: 2, reliability: 1}\n- {durability: 1, reliability: 2}") == OfferedQos(latched=True)


NO_PROFILES = (
    *("", "[]", "{}", "- 1", "\x00", "[[[[", "a: [", "- {durability: 1}\n" * 10_000, "&a [*a]"),
    *("- {depth: 2020-13-45}", "- {depth: !!bool x}"),
)


@pytest.mark.parametrize("text", NO_PROFILES)
def test_qos_that_cannot_be_read_is_none(text: str) -> None:
    assert qos_from(text) is None


@pytest.mark.parametrize(("depth", "read"), [("7", 7), ("-5", 10), ("true", 10), ("0x7fffffffffffffffff", 10_000)])
def test_a_depth_is_one_that_a_publisher_may_have(depth: str, read: int) -> None:
    assert qos_from(f"- {{depth: {depth}}}") == OfferedQos(depth=read)


def test_ros1_messages_have_ros2s_names_and_their_sequence_number(tmp_path: Path) -> None:
    types = NOETIC.types
    header = types["std_msgs/msg/Header"](3, types["builtin_interfaces/msg/Time"](1, 2), "camera")
    region = types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
    k = np.arange(9.0)
    info = types["sensor_msgs/msg/CameraInfo"](
        header, 4, 5, "plumb_bob", np.arange(5.0), k, k + 1, np.arange(12.0), 0, 0, region
    )
    path = write_ros1(tmp_path / "a.bag", [Sent("camera_info", 7, info)])
    with BagReader(path) as reader:
        (found,) = reader.messages()
        (raw,) = reader.raw_messages()
    assert (found.topic, found.type) == ("/camera_info", "sensor_msgs/msg/CameraInfo")
    assert (found.message.header.seq, found.message.header.stamp.nanosec) == (3, 2)
    np.testing.assert_array_equal(found.message.k, k)
    as_ros2 = JAZZY.deserialize_cdr(raw.data, raw.type)
    np.testing.assert_array_equal(as_ros2.p, np.arange(12.0))  # type: ignore[attr-defined]
    assert not hasattr(as_ros2.header, "seq")  # type: ignore[attr-defined]
    assert raw.type_hash == JAZZY.hash_rihs01(raw.type)
    assert raw.schema_encoding == "ros2msg"


def test_ros1s_own_tf_type_is_renamed(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS1_NOETIC)
    definition = "geometry_msgs/TransformStamped[] transforms\n"
    store.register(get_types_from_msg(definition, "tf/msg/tfMessage"))
    with Ros1Writer(tmp_path / "a.bag") as writer:
        connection = writer.add_connection("/tf", "tf/msg/tfMessage", typestore=store)
        writer.write(connection, 7, store.serialize_ros1(store.types["tf/msg/tfMessage"]([]), "tf/msg/tfMessage"))
    with BagReader(tmp_path / "a.bag") as reader:
        assert reader.topics == (TopicInfo("/tf", "tf2_msgs/msg/TFMessage", 1),)
        assert [(m.type, m.message.transforms) for m in reader.messages()] == [("tf2_msgs/msg/TFMessage", [])]
        assert [m.type for m in reader.raw_messages()] == ["tf2_msgs/msg/TFMessage"]


def test_ros1_bags_become_ros2_bags_through_raw_messages(tmp_path: Path) -> None:
    with BagReader(write_ros1(tmp_path / "a.bag", SENT_ROS1)) as reader:
        raw = list(reader.raw_messages())
    found = [Sent(m.topic, m.log_time_ns, JAZZY.deserialize_cdr(m.data, m.type)) for m in raw]
    assert_same(found, SENT)


def test_old_databases_without_definitions_are_read_with_jazzys(tmp_path: Path) -> None:
    path = storage_file(write_rosbag2(tmp_path / "bag", SENT, SQLITE))
    database = sqlite3.connect(path)
    for statement in (
        "DROP TABLE message_definitions",
        "DROP TABLE schema",
        "DROP TABLE metadata",
        "ALTER TABLE topics DROP COLUMN type_description_hash",
        "ALTER TABLE topics DROP COLUMN offered_qos_profiles",
    ):
        database.execute(statement)
    database.close()
    found, losses = read(path)
    assert_same(found, SENT)
    assert losses == ()


IDL = """{line}IDL: example_msgs/msg/Pair
module example_msgs {{
  module msg {{
    struct Pair {{
      double first;
      example_msgs::msg::Inner inner;
    }};
  }};
}};

{line}IDL: example_msgs/msg/Inner
module example_msgs {{
  module msg {{
    struct Inner {{
      int32 second;
    }};
  }};
}};
""".format(line="=" * 80 + "\n")


def test_definitions_in_idl_are_understood(tmp_path: Path) -> None:
    class Pair:
        __msgtype__ = "example_msgs/msg/Pair"

    class SentIdl(Sent):
        @property
        def cdr(self) -> bytes:
            return b"\x00\x01\x00\x00" + np.float64(1.5).tobytes() + np.int32(-3).tobytes()

    path = write_mcap(tmp_path / "bag.mcap", [SentIdl("/pair", 1, Pair())], {Pair.__msgtype__: (IDL, "ros2idl")})
    ((found,), losses) = read(path)
    assert (found.message.first, found.message.inner.second) == (1.5, -3)
    assert losses == ()


def test_messages_of_ros1_inside_mcap_are_understood(tmp_path: Path) -> None:
    class SentRos1(Sent):
        @property
        def cdr(self) -> bytes:
            return bytes(NOETIC.serialize_ros1(self.message, ODOMETRY))

    definition = NOETIC.generate_msgdef(ODOMETRY, ros_version=1)[0]
    sent = [SentRos1(CUBE, START_NS, odometry(1, NOETIC))]
    path = write_mcap(tmp_path / "bag.mcap", sent, {ODOMETRY: (definition, "ros1msg")}, encoding="ros1")
    ((found,), losses) = read(path)
    assert same(found.message, sent[0].message)
    assert losses == ()


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["mcap", "sqlite3", "ros1"])
def test_memory_stays_flat_while_reading(tmp_path: Path, kind: str) -> None:
    def peak(count: int) -> int:
        sent = recording(count, NOETIC if kind == "ros1" else JAZZY)
        path = {
            "mcap": lambda: write_mcap(tmp_path / f"{count}.mcap", sent),
            "sqlite3": lambda: write_rosbag2(tmp_path / f"{count}", sent, SQLITE),
            "ros1": lambda: write_ros1(tmp_path / f"{count}.bag", sent),
        }[kind]()
        with BagReader(path) as reader:
            for _ in reader.messages():  # decoders are made
                break
            tracemalloc.start()
            assert sum(1 for _ in reader.messages()) == len(sent)
            most = tracemalloc.get_traced_memory()[1]
            tracemalloc.stop()
        return most

    peak(200)  # whatever is kept from the first use
    assert peak(4000) < 1.5 * peak(1000) + 100_000


def test_an_input_is_left_exactly_as_it_was(tmp_path: Path) -> None:
    folder = write_rosbag2(tmp_path / "bag", SENT, SQLITE)
    before = {path: (path.read_bytes(), path.stat().st_mtime_ns) for path in folder.iterdir()}
    read(folder)
    assert {path: (path.read_bytes(), path.stat().st_mtime_ns) for path in folder.iterdir()} == before


@pytest.mark.parametrize("spoil", [b"", b"garbage" * 100], ids=["empty", "garbage"])
def test_one_split_that_cannot_be_read_costs_only_itself(tmp_path: Path, spoil: bytes) -> None:
    sent = recording(39)
    folder = tmp_path / "split"
    folder.mkdir()
    for part in range(2):
        write_ours(folder / f"split_{part}.mcap", sent[20 * part : 20 * (part + 1)])
    (folder / "split_2.mcap").write_bytes(spoil)
    found, losses = read(folder)
    assert_same(found, sent)
    assert "split_2.mcap" in " ".join(losses)
    assert "left out, the other files of the bag are read" in " ".join(losses)


def test_a_type_that_was_recorded_without_msg_is_the_same_type(tmp_path: Path) -> None:
    sent = [one for one in recording(5) if one.topic == CUBE]
    path = tmp_path / "a.mcap"
    text = JAZZY.generate_msgdef(ODOMETRY, ros_version=2)[0]
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2", "test")
        schema = writer.register_schema("nav_msgs/Odometry", "ros2msg", text.encode())
        channel = writer.register_channel(CUBE, "cdr", schema)
        for one in sent:
            writer.add_message(channel, one.log_time_ns, one.cdr, one.log_time_ns)
        writer.finish()  # type: ignore[no-untyped-call]
    with BagReader(path) as reader:
        assert [topic.type for topic in reader.topics] == [ODOMETRY]
    assert_same(read(path)[0], sent)


def test_files_of_a_folder_that_record_a_topic_at_the_same_time_are_told_of(tmp_path: Path) -> None:
    for number, part in enumerate((SENT[::2], SENT[1::2])):
        write_ours(tmp_path / f"session_{number}.mcap", part)
    with BagReader(tmp_path) as reader:
        assert any("at the same time: they are read as parts of one recording" in line for line in reader.losses)
    (tmp_path / "session_1.mcap").unlink()
    with BagReader(tmp_path) as reader:
        assert reader.losses == ()


def test_a_folder_may_have_files_whose_names_are_no_text(tmp_path: Path) -> None:
    write_ours(tmp_path / "part_0.mcap", SENT[:100])
    write_ours(tmp_path / "part_1.mcap", SENT[100:]).rename(os.fsdecode(os.fsencode(tmp_path) + b"/part_\xe9.mcap"))
    with BagReader(tmp_path) as reader:
        assert len(reader.sha256) == 64
