"""Poses that are decoded together are those that are decoded one by one: every bag here, and bags that were tampered with."""

import shutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer
from rosbags.rosbag2 import CompressionMode, StoragePlugin

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.geometry.scalars import ScalarPose
from contact_curation.motion.pose_stream import FramePose
from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.inputs import pose_runs
from contact_curation.storage.inputs.bag_tosses import read_bag_tosses
from contact_curation.storage.inputs.pose_messages import ODOMETRY, POSE, POSE_ARRAY, POSE_WITH_COVARIANCE, TF
from contact_curation.storage.inputs.pose_runs import HASHES, MeasuredMessage, measured_runs
from contact_curation.storage.inputs.pose_source import PoseSource, PoseTopicConfig, TypedTopic, find_pose_source
from contact_curation.storage.inputs.records import InputsConfig, Problem
from test.motion.streams import board_in_map, in_map, stream
from test.storage.pose_recordings import LOG_OFFSET_NS, recorded, transforms
from test.storage.written_bags import JAZZY, NOETIC, Sent, flipped, write_mcap, write_ours, write_ros1, write_rosbag2

GOLDEN = Path(__file__).resolve().parents[3] / "bags" / "golden.mcap"
BODY = "/tagslam/odom/body_cube"
POSES = in_map(stream())[:120]
BOARD = board_in_map()
TYPES = (ODOMETRY, POSE, POSE_WITH_COVARIANCE, TF)

Outcome = tuple[list[MeasuredMessage], tuple[str, ...]]
Payload = tuple[str, str, int, bytes]
"""Topic, type, log time and bytes of a message."""


def measured_messages(reader: BagReader, source: PoseSource, long_way: Callable[..., Any]) -> list[MeasuredMessage]:
    """The poses in a bag, each message by itself."""
    return [message for one in measured_runs(reader, source, long_way) for message in one.messages()]


def read(path: Path, *, together: bool, topic: str = "") -> Outcome:
    """The poses in a bag, and the losses."""
    with pytest.MonkeyPatch.context() as patch, BagReader(path) as reader:
        if not together:
            patch.setattr(pose_runs, "WALKS", {})
        topics = [TypedTopic(one.name, one.type) for one in reader.topics]
        source = find_pose_source(path, topics, "cube", PoseTopicConfig(topic=topic, array_index=1))

        def long_way(one: object) -> tuple[object, ...]:
            return source.measured(one.topic, one.message)  # type: ignore[attr-defined]

        return measured_messages(reader, source, long_way), reader.losses


def assert_same(path: Path, topic: str = "") -> Outcome:
    """Both ways give the same, bit for bit (`repr` tells -0.0 from 0.0, and finds NaN equal to itself)."""
    found, expected = read(path, together=True, topic=topic), read(path, together=False, topic=topic)
    assert repr(found) == repr(expected)
    return found


def counted_ways(path: Path) -> tuple[int, int]:
    """How many messages there are, and how many of them went the long way."""
    went = []
    with BagReader(path) as reader:
        source = find_pose_source(path, [TypedTopic(one.name, one.type) for one in reader.topics], "cube", PoseTopicConfig())

        def long_way(one: object) -> tuple[()]:
            went.append(one)
            return ()

        return len(measured_messages(reader, source, long_way)), len(went)


def payloads(sent: Sequence[Sent]) -> list[Payload]:
    return [(one.topic, one.message.__msgtype__, one.log_time_ns, one.cdr) for one in sent]


def write(path: Path, messages: Sequence[Payload], schemas: dict[str, str] | None = None) -> Path:
    """An MCAP file of messages as they are, whole or not."""
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=1 << 15, compression=CompressionType.ZSTD)
        writer.start("ros2", "test")
        channels: dict[tuple[str, str], int] = {}
        for topic, kind, time_ns, data in messages:
            if (topic, kind) not in channels:
                text = (schemas or {}).get(kind) or JAZZY.generate_msgdef(kind, ros_version=2)[0]
                channels[topic, kind] = writer.register_channel(
                    topic, "cdr", writer.register_schema(kind, "ros2msg", text.encode())
                )
            writer.add_message(channels[topic, kind], time_ns, data, time_ns)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def tagslam(kind: str = ODOMETRY, store: object = JAZZY) -> list[Sent]:
    board = Sent("/tf_static", LOG_OFFSET_NS, transforms([BOARD], store))
    return [board, *recorded("/tf" if kind == TF else BODY, kind, POSES, store)]


@pytest.mark.parametrize("kind", TYPES)
def test_the_layouts_are_of_the_definitions_of_ros(kind: str) -> None:
    assert HASHES[kind] == JAZZY.hash_rihs01(kind)


def test_the_golden_bag_is_decoded_together_but_for_the_first_message_of_each_topic() -> None:
    found, losses = assert_same(GOLDEN)
    assert not losses
    assert counted_ways(GOLDEN) == (len(found), 2)


def in_mcap(path: Path, kind: str) -> Path:
    return write_ours(path / "a.mcap", tagslam(kind))


def in_mcap_of_another_writer(path: Path, kind: str) -> Path:
    return write_mcap(path / "b.mcap", tagslam(kind))


def in_sqlite(path: Path, kind: str) -> Path:
    return write_rosbag2(path / "c", tagslam(kind), StoragePlugin.SQLITE3)


def in_packed_messages(path: Path, kind: str) -> Path:
    return write_rosbag2(path / "d", tagslam(kind), StoragePlugin.SQLITE3, CompressionMode.MESSAGE)


def in_ros1(path: Path, kind: str) -> Path:
    return write_ros1(path / "e.bag", tagslam(kind, NOETIC))


@pytest.mark.parametrize("made", [in_mcap, in_mcap_of_another_writer, in_sqlite, in_packed_messages, in_ros1])
@pytest.mark.parametrize("kind", [*TYPES, POSE_ARRAY])
def test_every_kind_of_bag_and_message_gives_the_same_poses(
    tmp_path: Path, kind: str, made: Callable[[Path, str], Path]
) -> None:
    path = made(tmp_path, kind)
    found, _ = assert_same(path)
    assert sum(isinstance(one, FramePose) for message in found for one in message.measured) >= len(POSES)
    one_by_one = kind == POSE_ARRAY or made in (in_packed_messages, in_ros1)
    assert counted_ways(path) == (len(found), len(found) if one_by_one else 2)


def test_files_that_were_recorded_side_by_side_give_the_same_poses(tmp_path: Path) -> None:
    folder = tmp_path / "bag"
    folder.mkdir()
    for part in (0, 1):
        write(folder / f"bag_{part}.mcap", payloads(tagslam())[part::2])
    found, _ = assert_same(folder)
    assert [one.log_time_ns for one in found] == sorted(one.log_time_ns for one in tagslam())


def altered(index: int, **changes: object) -> list[FramePose]:
    return [replace(one, **changes) if place == index else one for place, one in enumerate(POSES)]  # type: ignore[arg-type]


def renamed(one: FramePose, parent: str, child: str = "body_cube") -> FramePose:
    return replace(one, parent=parent, child=child)


NO_POSES = [
    ScalarPose((float("nan"), 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)),
    ScalarPose((0.0, float("inf"), 0.0), (1.0, 0.0, 0.0, 0.0)),
    ScalarPose((0.0, 0.0, 2e6), (1.0, 0.0, 0.0, 0.0)),
    ScalarPose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)),
    ScalarPose((0.0, 0.0, 0.0), (1e200, 0.0, 0.0, 0.0)),
    ScalarPose((-0.0, 0.0, 0.0), (-1.0, 0.0, -0.0, 0.0)),
]


@pytest.mark.parametrize("kind", TYPES)
def test_what_is_no_pose_is_left_out_for_the_same_reason(tmp_path: Path, kind: str) -> None:
    poses = list(POSES)
    for place, pose in enumerate(NO_POSES, start=20):
        poses[place] = replace(poses[place], pose=pose)
    assert_same(write_ours(tmp_path / "a.mcap", recorded("/tf" if kind == TF else BODY, kind, poses)))


@pytest.mark.parametrize("kind", TYPES)
def test_frames_that_change_their_names_in_mid_stream_keep_them(tmp_path: Path, kind: str) -> None:
    names = [("map", "cube"), ("/map", "/body_cube"), ("mäp", "body_cube"), ("odom", "surface"), ("", ""), ("mop", "cubes")]
    poses = [renamed(one, *names[place // 7 % len(names)]) for place, one in enumerate(POSES)]
    found, _ = assert_same(write_ours(tmp_path / "a.mcap", recorded("/tf" if kind == TF else BODY, kind, poses)))
    parents = {one.parent for message in found for one in message.measured if isinstance(one, FramePose)}
    assert {"map", "mäp", "odom", "mop"} <= parents


def test_transforms_of_several_frames_in_one_message_come_in_their_order(tmp_path: Path) -> None:
    def several(one: FramePose) -> Sent:
        parts = [replace(BOARD, stamp_ns=one.stamp_ns, static=False), renamed(one, "map", "camera"), one]
        return Sent("/tf", LOG_OFFSET_NS + one.stamp_ns, transforms(parts))

    one_by_one = [Sent("/tf", LOG_OFFSET_NS + one.stamp_ns + 1, transforms([one])) for one in POSES[60:]]
    empty = Sent("/tf", LOG_OFFSET_NS + 1, transforms([]))
    assert_same(write_ours(tmp_path / "a.mcap", [*map(several, POSES), *one_by_one, empty]))
    body_elsewhere = recorded(BODY, ODOMETRY, POSES)
    assert_same(write_ours(tmp_path / "b.mcap", [*map(several, POSES), *body_elsewhere]))


def big_endian(one: Sent) -> bytes:
    return bytes(JAZZY.serialize_cdr(one.message, one.message.__msgtype__, little_endian=False))


def mutated(sent: Sequence[Sent], rng: np.random.Generator) -> Iterator[Payload]:
    """Messages of which some have flipped bytes, an end too early or too late, or another encapsulation."""
    for one, (topic, kind, time_ns, data) in zip(sent, payloads(sent), strict=True):
        changed = bytearray(data)
        match rng.integers(12):
            case 0:
                changed[rng.integers(len(data))] ^= 1 << rng.integers(8)
            case 1:
                changed[rng.integers(min(len(data), 64))] = rng.integers(256)
            case 2:
                del changed[rng.integers(len(data)) :]
            case 3:
                changed += bytes(rng.integers(6))
            case 4:
                changed[:] = big_endian(one)
            case 5:
                changed[1:4] = rng.integers(4, size=3, dtype=np.uint8).tobytes()
            case 6:
                del changed[-rng.integers(1, 4) :]
        yield topic, kind, time_ns, bytes(changed)


@pytest.mark.parametrize("kind", TYPES)
def test_bytes_that_were_tampered_with_give_the_same_poses_and_losses(tmp_path: Path, kind: str) -> None:
    rng = np.random.default_rng(7)
    sent = [one for one in tagslam(kind) for _ in range(3)]
    found, losses = assert_same(write(tmp_path / "a.mcap", list(mutated(sent, rng))))
    assert len(found) > len(sent) // 2
    assert any("could not be decoded" in line for line in losses)


def test_chunks_that_were_tampered_with_give_the_same_poses_and_losses(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", payloads(tagslam()))
    losses: list[str] = []
    for offset in range(path.stat().st_size // 5, path.stat().st_size, path.stat().st_size // 5):
        copy = Path(shutil.copy(path, tmp_path / f"{offset}.mcap"))
        flipped(copy, offset)
        losses += assert_same(copy)[1]
    assert losses


def test_a_type_that_the_bag_defines_otherwise_goes_the_long_way(tmp_path: Path) -> None:
    text = JAZZY.generate_msgdef(POSE, ros_version=2)[0]
    path = write(tmp_path / "a.mcap", payloads(recorded(BODY, POSE, POSES)), {POSE: text.replace("float64 x", "int64 x")})
    found, _ = assert_same(path)
    assert counted_ways(path) == (len(found), len(found))


def test_a_topic_of_two_types_is_read_by_the_one_that_was_chosen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    odometry = payloads(recorded(BODY, ODOMETRY, POSES))
    poses = [(BODY, POSE, time_ns, data) for _, _, time_ns, data in payloads(recorded(BODY, POSE, POSES))]
    path = write(tmp_path / "a.mcap", sorted([*odometry, *poses], key=lambda one: one[2]))
    lines = []
    for walks in (pose_runs.WALKS, {}):
        monkeypatch.setattr(pose_runs, "WALKS", walks)
        found = read_bag_tosses(path, CONTACTNETS_CUBE, InputsConfig(PoseTopicConfig(topic=BODY)))
        lines.append([str(one) for one in found if isinstance(one, Problem)])
    assert "found fields that are not its own" in "".join(lines[0])
    assert lines[0] == lines[1]


def test_padding_may_differ_between_messages(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    poses = [renamed(one, "m") for one in POSES]  # "m" and its end take 2 of 4 bytes
    messages = []
    for topic, kind, time_ns, data in payloads(recorded(BODY, ODOMETRY, poses)):
        at = data.index(b"m\x00") + 2
        messages.append((topic, kind, time_ns, data[:at] + rng.bytes(2) + data[at + 2 :]))
    path = write(tmp_path / "a.mcap", messages)
    assert_same(path)
    assert counted_ways(path) == (len(POSES), 1)
