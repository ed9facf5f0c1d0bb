"""Bags that are written can be read by the field's own tools, and are there whole or not at all."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from mcap.reader import NonSeekingReader, make_reader
from rosbags.highlevel import AnyReader
from rosbags.interfaces import ConnectionExtRosbag2, QosDurability

from contact_curation.errors import InvalidValueError
from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.bags.records import OfferedQos
from contact_curation.storage.bags.writer import BagWriter
from test.storage.written_bags import (
    CUBE,
    JAZZY,
    NOTE,
    ODOMETRY,
    START_NS,
    STRING,
    Sent,
    assert_same,
    note,
    read,
    recording,
    write_ours,
)

SENT = recording(2000)
KILLED_WRITER = """
import sys
from pathlib import Path
from contact_curation.storage.bags.writer import BagWriter
from test.storage.written_bags import recording
writer = BagWriter(Path(sys.argv[1]))
for one in recording(6000):
    writer.write(one.topic, one.message, one.log_time_ns)
print("written", flush=True)
sys.stdin.read()
"""


def by_rosbags(path: Path) -> list[Sent]:
    with AnyReader([path]) as reader:
        return [Sent(c.topic, time_ns, reader.deserialize(data, c.msgtype)) for c, time_ns, data in reader.messages()]


@pytest.mark.parametrize("name", ["bag.mcap", "bag"])
def test_rosbags_reads_what_was_written_as_file_and_as_folder(tmp_path: Path, name: str) -> None:
    assert_same(by_rosbags(write_ours(tmp_path / name, SENT)), SENT)


@pytest.mark.parametrize("reader", [make_reader, NonSeekingReader])
def test_mcap_reads_what_was_written_with_its_checksums(tmp_path: Path, reader: "type[NonSeekingReader]") -> None:
    path = write_ours(tmp_path / "bag.mcap", SENT)
    with path.open("rb") as file:
        found = [
            (channel.topic, message.log_time, message.data)
            for _, channel, message in reader(file, validate_crcs=True).iter_messages()
        ]
    assert found == [(one.topic, one.log_time_ns, one.cdr) for one in SENT]


def test_chunks_carry_checksums_and_are_compressed(tmp_path: Path) -> None:
    path = write_ours(tmp_path / "bag.mcap", SENT)
    with path.open("rb") as file:
        reader = make_reader(file)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
    assert summary is not None
    assert len(summary.chunk_indexes) > 1
    assert {index.compression for index in summary.chunk_indexes} == {"zstd"}
    assert path.stat().st_size < sum(len(one.cdr) for one in SENT)


@pytest.mark.parametrize("name", ["bag.mcap", "bag"])
def test_latched_topics_and_type_hashes_are_known_to_rosbags(tmp_path: Path, name: str) -> None:
    with AnyReader([write_ours(tmp_path / name, SENT)]) as reader:
        offered = {c.topic: c.ext for c in reader.connections if isinstance(c.ext, ConnectionExtRosbag2)}
    durability = {topic: ext.offered_qos_profiles[0].durability for topic, ext in offered.items()}
    assert durability == {CUBE: QosDurability.VOLATILE, NOTE: QosDurability.TRANSIENT_LOCAL}
    with (tmp_path / "bag.mcap" if name == "bag.mcap" else tmp_path / "bag" / "bag_0.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    hashes = {channel.topic: channel.metadata["topic_type_hash"] for channel in summary.channels.values()}
    assert hashes == {CUBE: JAZZY.hash_rihs01(ODOMETRY), NOTE: JAZZY.hash_rihs01(STRING)}


def test_metadata_is_plain_yaml_of_jazzys_version(tmp_path: Path) -> None:
    text = (write_ours(tmp_path / "bag", SENT) / "metadata.yaml").read_text()
    information = yaml.safe_load(text)["rosbag2_bagfile_information"]
    assert (information["version"], information["message_count"]) == (9, len(SENT))
    assert information["duration"]["nanoseconds"] == SENT[-1].log_time_ns - START_NS
    assert "&" not in text


def test_the_same_messages_give_the_same_bytes(tmp_path: Path) -> None:
    paths = [write_ours(tmp_path / f"{name}.mcap", SENT) for name in "ab"]
    assert paths[0].read_bytes() == paths[1].read_bytes()


@pytest.mark.parametrize("name", ["bag.mcap", "bag"])
def test_a_bag_without_messages_can_be_read(tmp_path: Path, name: str) -> None:
    assert read(write_ours(tmp_path / name, [])) == ([], ())


def test_raw_messages_pass_through_byte_for_byte(tmp_path: Path) -> None:
    write_ours(tmp_path / "bag.mcap", SENT)
    with BagReader(tmp_path / "bag.mcap") as reader, BagWriter(tmp_path / "copy.mcap") as writer:
        for m in reader.raw_messages():
            qos = reader.qos(m.topic)
            writer.write_raw(m.topic, m.type, m.schema, m.data, m.log_time_ns, qos=qos, type_hash=m.type_hash)
    assert (tmp_path / "copy.mcap").read_bytes() == (tmp_path / "bag.mcap").read_bytes()


def test_publish_times_and_offered_qos_are_kept(tmp_path: Path) -> None:
    qos = OfferedQos(latched=True, reliable=False, depth=3)
    with BagWriter(tmp_path / "bag.mcap") as writer:
        schema = JAZZY.generate_msgdef(STRING, ros_version=2)[0]
        writer.write_raw(NOTE, STRING, schema, Sent(NOTE, 0, note("x")).cdr, 20, qos=qos, publish_time_ns=10)
    with BagReader(tmp_path / "bag.mcap") as reader:
        assert reader.qos(NOTE) == qos
        assert [(m.log_time_ns, m.publish_time_ns) for m in reader.raw_messages()] == [(20, 10)]


@pytest.mark.parametrize("name", ["bag.mcap", "bag"])
def test_an_error_while_writing_leaves_nothing_behind(tmp_path: Path, name: str) -> None:
    def interrupted() -> None:
        with BagWriter(tmp_path / name) as writer:
            writer.write(NOTE, note("x"), 0)
            writer.write(NOTE, note("y"), -1)

    with pytest.raises(InvalidValueError, match="log time"):
        interrupted()
    assert list(tmp_path.iterdir()) == []


def test_a_bag_being_read_is_not_overwritten(tmp_path: Path) -> None:
    path = write_ours(tmp_path / "bag.mcap", SENT[:10])
    with BagReader(path) as reader:
        with pytest.raises(InvalidValueError, match="nobody is reading"):
            BagWriter(path)
        assert len(list(reader.messages())) == 10
    write_ours(path, SENT[:3])
    assert len(read(path)[0]) == 3
    assert list(tmp_path.iterdir()) == [path]


def test_a_bag_that_is_opened_for_reading_meanwhile_is_not_overwritten(tmp_path: Path) -> None:
    path = write_ours(tmp_path / "bag.mcap", SENT[:10])
    writer = BagWriter(path)
    writer.write(NOTE, note("x"), 0)
    with BagReader(path), pytest.raises(InvalidValueError, match="nobody is reading"):
        writer.close()
    assert len(read(path)[0]) == 10
    writer.discard()


def test_two_writers_do_not_share_a_path(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag.mcap") as writer:
        writer.write(NOTE, note("x"), 0)
        with pytest.raises(InvalidValueError, match="nobody else is writing"):
            BagWriter(tmp_path / "bag.mcap")
    assert len(read(tmp_path / "bag.mcap")[0]) == 1


@pytest.mark.parametrize(
    ("name", "expected"), [("taken", "not taken"), ("taken.mcap", "not taken"), ("nowhere/bag.mcap", "No such")]
)
def test_paths_that_cannot_be_written_are_refused(tmp_path: Path, name: str, expected: str) -> None:
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken.mcap").mkdir()
    with pytest.raises(InvalidValueError, match=expected):
        BagWriter(tmp_path / name)


def test_what_a_killed_writer_wrote_can_be_read(tmp_path: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])}
    command = [sys.executable, "-c", KILLED_WRITER, str(tmp_path / "bag.mcap")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment) as writer:
        assert writer.stdout is not None
        assert writer.stdout.readline() == b"written\n"
        writer.send_signal(signal.SIGKILL)
    (partial,) = tmp_path.iterdir()
    found, losses = read(partial)
    assert len(found) > 3000
    assert_same(found, recording(6000)[: len(found)])
    assert "cut short" in losses[0]


@pytest.mark.parametrize("name", ["out.mcap", "out"])
def test_a_link_in_place_of_the_hidden_file_is_refused_and_its_target_stays(tmp_path: Path, name: str) -> None:
    other = tmp_path / "other"
    if name == "out":
        other.mkdir()
    else:
        other.write_bytes(b"years of work")
    (tmp_path / f".{name}.partial").symlink_to(other)
    with pytest.raises(InvalidValueError, match=r"expected a path that can be written \("):
        BagWriter(tmp_path / name)
    assert list(other.iterdir()) == [] if other.is_dir() else other.read_bytes() == b"years of work"
