"""Damaged bags are read as far as they go, and what was lost is said (FIELD 3)."""

import os
import shutil
import sqlite3
import struct
from contextlib import closing, suppress
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType
from rosbags.rosbag2 import StoragePlugin

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.errors import UnreadableInputError
from contact_curation.storage.bags.formats.ros1 import CHUNK, ROS1_MAGIC, Record, read_record
from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.inputs.bag_tosses import bag_tosses
from contact_curation.storage.inputs.records import InputsConfig
from test.storage.written_bags import (
    CUBE,
    NOETIC,
    NOTE,
    STEP_NS,
    Sent,
    assert_same,
    flipped,
    read,
    recording,
    same,
    write_mcap,
    write_ros1,
    write_rosbag2,
)

SENT = recording(700)
SENT_ROS1 = recording(700, NOETIC)
SQLITE = StoragePlugin.SQLITE3


def chunk_offsets(path: Path) -> list[tuple[int, int]]:
    """Offset and length of the chunk records of an undamaged MCAP file."""
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    return [(index.chunk_start_offset, index.chunk_length) for index in summary.chunk_indexes]


def assert_subsequence(found: list[Sent], expected: list[Sent]) -> None:
    """Everything found was written, in that order; nothing was altered or made up."""
    rest = iter(expected)
    for one in found:
        assert any(one[:2] == other[:2] and same(one.message, other.message) for other in rest), one[:2]


# Recording killed: truncated or unindexed MCAP


@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.ZSTD, CompressionType.LZ4])
@pytest.mark.parametrize("share", [0.2, 0.5, 0.9, 0.95])
def test_a_truncated_mcap_gives_all_that_comes_before_the_cut(
    tmp_path: Path, compression: CompressionType, share: float
) -> None:
    path = write_mcap(tmp_path / "bag.mcap", SENT, compression=compression)
    whole_chunks = sum(offset + length < path.stat().st_size * share for offset, length in chunk_offsets(path))
    os.truncate(path, int(path.stat().st_size * share))
    found, losses = read(path)
    assert_same(found, SENT[: len(found)])
    assert len(found) >= 110 * whole_chunks
    assert any("cut short at byte" in line for line in losses)


def test_where_a_recording_is_cut_and_how_much_came_before_is_said(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "bag.mcap", SENT)
    offset, _ = chunk_offsets(path)[2]
    os.truncate(path, offset + 5)
    found, losses = read(path)
    why = f"9 bytes are declared at byte {offset}, where the file holds 5 more"
    before = f"before it are 2 chunks with {len(found)} messages"
    assert losses == (f"bag.mcap: cut short at byte {offset} of {offset + 5}: {why}; {before}",)


def test_of_a_chunk_that_is_cut_the_beginning_is_read(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "bag.mcap", SENT, compression=CompressionType.NONE)
    offset, length = chunk_offsets(path)[1]
    os.truncate(path, offset + length // 2)
    found, losses = read(path)
    before = [one for one in SENT if one.log_time_ns <= found[-1].log_time_ns]
    assert_same(found, before)
    assert len(found) > 1.4 * len(SENT) * 100_000 / sum(len(one.cdr) + 31 for one in SENT)
    assert len(losses) == 2
    assert "messages from there on are lost" in losses[1]


def test_every_cut_gives_a_beginning_of_the_recording(tmp_path: Path) -> None:
    sent = recording(60)
    whole = write_mcap(tmp_path / "whole.mcap", sent, chunk_size=10_000).read_bytes()
    path = tmp_path / "bag.mcap"
    most = 0
    for size in range(0, len(whole), len(whole) // 60):
        path.write_bytes(whole[:size])
        if size < 8:
            continue
        found, losses = read(path)
        assert_same(found, sent[: len(found)])
        assert len(found) >= most
        assert losses or len(found) == len(sent)  # a cut behind the last message loses nothing
        most = len(found)
    assert most == len(sent)


def test_topics_and_counts_of_a_truncated_mcap_are_those_that_are_left(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "bag.mcap", SENT)
    os.truncate(path, path.stat().st_size // 2)
    with BagReader(path) as reader:
        topics = {topic.name: topic.count for topic in reader.topics}
        found = list(reader.messages())
    assert topics == {name: sum(m.topic == name for m in found) for name in (NOTE, CUBE)}


def test_a_cut_within_the_index_of_a_chunk_costs_none_of_its_messages(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "bag.mcap", SENT)
    offset, length = chunk_offsets(path)[1]
    (index_size,) = struct.unpack_from("<Q", path.read_bytes(), offset + length + 1)
    os.truncate(path, offset + length + 9 + index_size)  # behind the index of the first of two channels
    with BagReader(path) as reader:
        topics = {topic.name: topic.count for topic in reader.topics}
        found = [Sent(m.topic, m.log_time_ns, m.message) for m in reader.messages()]
    assert_same(found, SENT[: len(found)])
    assert topics == {name: sum(one.topic == name for one in found) for name in (NOTE, CUBE)}


def test_an_mcap_file_filled_up_with_zeros_is_read_up_to_them(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "bag.mcap", SENT)
    size = path.stat().st_size
    os.truncate(path, size // 2)
    os.truncate(path, size)
    found, losses = read(path)
    assert_same(found, SENT[: len(found)])
    assert len(found) > 200
    assert any("cut short" in line for line in losses)


def test_a_truncated_bag_without_chunks_is_read_to_its_last_whole_message(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "bag.mcap", SENT, use_chunking=False)
    os.truncate(path, path.stat().st_size // 2)
    found, losses = read(path)
    assert_same(found, SENT[: len(found)])
    assert len(found) > 300
    assert "cut short" in losses[0]


# Corrupt chunk


@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.ZSTD, CompressionType.LZ4])
def test_a_corrupt_chunk_is_left_out_and_said_with_what_it_held(tmp_path: Path, compression: CompressionType) -> None:
    path = write_mcap(tmp_path / "bag.mcap", SENT, compression=compression)
    offset, length = chunk_offsets(path)[1]
    flipped(path, offset + length - 200)
    found, losses = read(path)
    assert_subsequence(found, SENT)
    lost = len(SENT) - len(found)
    assert 100 < lost < 200
    assert len(losses) == 1
    assert f"{lost - 1} of {CUBE}" in losses[0] or f"{lost - 2} of {CUBE}" in losses[0]
    assert "its messages are lost" in losses[0]


def test_a_corrupt_chunk_is_said_once_however_often_it_is_read(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "bag.mcap", SENT)
    flipped(path, chunk_offsets(path)[1][0] + 200)
    with BagReader(path) as reader:
        for _ in range(3):
            list(reader.messages())
        assert len(reader.losses) == 1


def test_a_chunk_without_checksum_is_read_up_to_its_damage(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "bag.mcap", SENT, compression=CompressionType.NONE, enable_crcs=False)
    data = path.read_bytes()
    offset, length = chunk_offsets(path)[1]
    middle = data.index(struct.pack("<BQ", 5, len(SENT[-1].cdr) + 22), offset + length // 2)
    path.write_bytes(data[: middle + 1] + b"\xff" * 8 + data[middle + 9 :])
    found, losses = read(path)
    assert_subsequence(found, SENT)
    assert 50 < len(SENT) - len(found) < 100
    assert "its messages from there on are lost" in losses[0]


def test_behind_a_damaged_chunk_head_reading_goes_on_where_the_index_says(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "bag.mcap", SENT)
    (first, _), (second, _), *_ = chunk_offsets(path)
    flipped(path, first, 60)
    found, losses = read(path)
    assert_same(found, SENT[-len(found) :])
    assert 500 < len(found) < 600
    assert f"read on at byte {second}, where the index names a chunk" in losses[0]
    assert losses[1] == f"bag.mcap: its index counts 707 messages, its chunks hold {len(found)}"


def test_a_damaged_record_length_alone_costs_nothing(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "bag.mcap", SENT)
    flipped(path, chunk_offsets(path)[1][0] + 1, 8)
    found, losses = read(path)
    assert_same(found, SENT)
    assert len(losses) == 1


def test_a_damaged_length_that_jumps_over_chunks_costs_only_what_it_must(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "bag.mcap", SENT)
    offsets = chunk_offsets(path)
    data = bytearray(path.read_bytes())
    first, third = offsets[0][0], offsets[3][0]
    data[first + 1 : first + 9] = struct.pack("<Q", third - first - 9)
    path.write_bytes(data)
    found, losses = read(path)
    assert_same(found, SENT)
    assert any("read on at byte" in line for line in losses)


def test_a_damaged_index_is_said_and_the_chunks_are_read_without_it(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "bag.mcap", SENT)
    flipped(path, path.stat().st_size - 200)
    found, losses = read(path)
    assert_same(found, SENT)
    assert losses == ("bag.mcap: the index at its end is damaged and was not used: its checksum does not match",)


def test_a_bag_of_which_no_chunk_can_be_read_says_so_and_not_only_that_it_has_no_topics(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "a.mcap", SENT, index_types=IndexType.NONE, use_statistics=False, repeat_channels=False)
    path.write_bytes(path.read_bytes().replace(b"\x04\0\0\0zstd", b"\x04\0\0\0zip2"))
    says = r"compression 'zip2' is not one of .*; and \d+ more; .*found no topics"
    with BagReader(path) as reader, pytest.raises(UnreadableInputError, match=says):
        bag_tosses(reader, CONTACTNETS_CUBE, InputsConfig())


# sqlite3


def test_a_truncated_database_gives_a_beginning_of_the_recording(tmp_path: Path) -> None:
    folder = write_rosbag2(tmp_path / "bag", SENT, SQLITE)
    path = folder / "bag.db3"
    os.truncate(path, path.stat().st_size * 3 // 4 // 4096 * 4096)
    with BagReader(path) as reader:
        found = [Sent(m.topic, m.log_time_ns, m.message) for m in reader.messages()]
        assert_same(found, SENT[: len(found)])
        assert len(found) > 300
        assert "cut short" in reader.losses[0]
        assert f"damaged behind {len(found)} messages, the rest is lost" in reader.losses[-1]


def test_messages_in_the_log_of_a_killed_recording_are_read_and_nothing_is_changed(tmp_path: Path) -> None:
    folder = write_rosbag2(tmp_path / "bag", SENT[:400], SQLITE)
    live = sqlite3.connect(folder / "bag.db3", isolation_level=None)
    live.execute("PRAGMA journal_mode = WAL")
    for one in SENT[400:]:
        live.execute(
            "INSERT INTO messages (topic_id, timestamp, data) VALUES ((SELECT id FROM topics WHERE name = ?), ?, ?)",
            (one.topic, one.log_time_ns, one.cdr),
        )
    killed = tmp_path / "killed"
    shutil.copytree(folder, killed)
    live.close()
    (killed / "metadata.yaml").unlink()
    before = {path: path.read_bytes() for path in killed.iterdir()}
    found, losses = read(killed)
    assert_same(found, SENT)
    assert losses == ()
    assert {path: path.read_bytes() for path in killed.iterdir()} == before


def changed_database(folder: Path, statement: str) -> Path:
    """A recording in which a statement of SQL changed something."""
    path = write_rosbag2(folder / "bag", SENT, SQLITE) / "bag.db3"
    with closing(sqlite3.connect(path)) as database:
        database.execute(statement)
        database.commit()
    return path


def test_rows_that_are_no_messages_are_left_out_and_said(tmp_path: Path) -> None:
    path = changed_database(tmp_path, "UPDATE messages SET data = 'text' WHERE id = 5")
    found, losses = read(path)
    assert_same(found, SENT[:4] + SENT[5:])
    assert losses == ("bag.db3: 1 rows are no messages (a time or bytes are missing) and were left out",)


def test_messages_of_a_topic_that_the_database_does_not_declare_are_said(tmp_path: Path) -> None:
    path = changed_database(tmp_path, "UPDATE messages SET topic_id = 77 WHERE id = 5")
    with BagReader(path) as reader:
        assert sum(topic.count or 0 for topic in reader.topics) == len(SENT) - 1
        assert reader.losses == ("bag.db3: 1 messages are of no declared topic and were left out",)


def test_a_database_that_is_no_bag_is_refused(tmp_path: Path) -> None:
    database = sqlite3.connect(tmp_path / "other.db3")
    database.execute("CREATE TABLE things (x)")
    database.commit()
    database.close()
    with pytest.raises(UnreadableInputError, match="no tables topics and messages"):
        BagReader(tmp_path / "other.db3")


# ROS 1


def ros1_chunks(path: Path) -> list[Record]:
    """The chunk records of an undamaged ROS 1 bag."""
    data, offset, chunks = path.read_bytes(), len(ROS1_MAGIC), []
    while offset < len(data):
        record = read_record(lambda at, length: data[at : at + length], offset)
        offset = record.data_at + record.size
        if record.operation == CHUNK:
            chunks.append(record)
    return chunks


@pytest.mark.parametrize("compression", ["none", "bz2", "lz4"])
@pytest.mark.parametrize("share", [0.3, 0.6, 0.9])
def test_a_truncated_ros1_bag_gives_all_that_comes_before_the_cut(tmp_path: Path, compression: str, share: float) -> None:
    path = write_ros1(tmp_path / "a.bag", SENT_ROS1, compression)
    size = int(path.stat().st_size * share)
    whole_chunks = sum(chunk.data_at + chunk.size <= size for chunk in ros1_chunks(path))
    os.truncate(path, size)
    found, losses = read(path)
    assert_same(found, SENT_ROS1[: len(found)])
    assert len(found) >= 100 * whole_chunks
    assert len(found) > 0
    assert "cut short at byte" in losses[0]


def test_a_ros1_recording_that_was_killed_is_read_with_its_unfinished_chunk(tmp_path: Path) -> None:
    """Until they are complete, the bag's index has no place, and the newest chunk no length."""
    path = write_ros1(tmp_path / "a.bag", SENT_ROS1)
    *_, before, last = ros1_chunks(path)
    data = bytearray(path.read_bytes()[: last.data_at + last.size // 2])
    index_at = data.index(b"index_pos=") + len(b"index_pos=")
    size_at = data.index(b"size=", before.data_at + before.size) + len(b"size=")
    data[index_at : index_at + 8] = bytes(8)
    data[size_at : size_at + 4] = bytes(4)
    data[last.data_at - 4 : last.data_at] = bytes(4)
    path.write_bytes(data)
    found, losses = read(path)
    assert_same(found, SENT_ROS1[: len(found)])
    assert found[-1].log_time_ns > SENT_ROS1[-30].log_time_ns - 100 * STEP_NS
    assert len(found) > 100 * (len(ros1_chunks(write_ros1(tmp_path / "b.bag", SENT_ROS1))) - 1)
    assert "the recording was not finished, nor was its last chunk" in losses[0]


def test_a_ros1_bag_without_its_index_is_read_whole_and_said_to_be_unfinished(tmp_path: Path) -> None:
    path = write_ros1(tmp_path / "a.bag", SENT_ROS1)
    data = bytearray(path.read_bytes())
    index_at = data.index(b"index_pos=") + len(b"index_pos=")
    (index,) = struct.unpack_from("<Q", data, index_at)
    data[index_at : index_at + 8] = bytes(8)
    path.write_bytes(data[:index])
    found, losses = read(path)
    assert_same(found, SENT_ROS1)
    assert "the recording was not finished" in losses[0]


def test_a_corrupt_chunk_of_a_ros1_bag_is_left_out_and_said(tmp_path: Path) -> None:
    path = write_ros1(tmp_path / "a.bag", SENT_ROS1, "bz2")
    chunk = ros1_chunks(path)[1]
    flipped(path, chunk.data_at + chunk.size // 2, 4)
    found, losses = read(path)
    assert_subsequence(found, SENT_ROS1)
    assert 100 < len(SENT_ROS1) - len(found) < 200
    assert "its messages are lost" in losses[0]


def test_an_encrypted_ros1_bag_is_refused(tmp_path: Path) -> None:
    path = write_ros1(tmp_path / "a.bag", SENT_ROS1[:3])
    path.write_bytes(path.read_bytes().replace(b"conn_count=\x02\0\0\0", b"encryptor=aes=="))
    with pytest.raises(UnreadableInputError, match="is encrypted"):
        BagReader(path)


@pytest.mark.slow
def test_a_row_that_claims_more_than_memory_is_damage_like_any_other(tmp_path: Path) -> None:
    (whole,) = write_rosbag2(tmp_path / "whole", recording(20), SQLITE).glob("*.db3")
    content = whole.read_bytes()
    claimed = [damaged for place in range(0, len(content) - 8, 3) if _is_too_large(damaged := _overwritten(content, place))]
    assert claimed
    for damaged in claimed:
        file = tmp_path / "damaged.db3"
        file.write_bytes(damaged)
        with suppress(UnreadableInputError), BagReader(file) as reader:
            list(reader.messages())
            assert reader.losses


def _overwritten(content: bytes, place: int) -> bytes:
    return content[:place] + 7 * b"\xff" + b"\x7f" + content[place + 8 :]


def _is_too_large(content: bytes) -> bool:
    """Whether SQLite asks for more memory than there is, for a length that it reads."""
    with closing(sqlite3.connect(":memory:")) as database:
        try:
            database.deserialize(content)
            for query in ("SELECT name FROM topics", "SELECT data FROM messages ORDER BY timestamp, id"):
                list(database.execute(query))
        except MemoryError:
            return True
        except (sqlite3.Error, UnicodeDecodeError):
            pass
    return False
