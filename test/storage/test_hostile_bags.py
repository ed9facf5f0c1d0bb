"""No size in a file is believed before it is held against what is there; no damage ends in anything but our error."""

import bz2
import os
import shutil
import sqlite3
import struct
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from pathlib import Path
from time import process_time

import lz4.frame  # type: ignore[import-untyped]
import numpy as np
import pytest
import zstandard
from mcap.writer import CompressionType
from rosbags.rosbag2 import StoragePlugin

from contact_curation.errors import UnreadableInputError
from contact_curation.storage.bags.file import BagFile, BagLimits, DamagedBagError
from contact_curation.storage.bags.reader import BagReader
from test.storage.written_bags import (
    NOETIC,
    recording,
    rollback_journal,
    write_mcap,
    write_ours,
    write_ros1,
    write_rosbag2,
)

MAGIC = b"\x89MCAP0\r\n"
GIBIBYTE = 1 << 30
SPARE_BYTES = 100 << 20
"""What reading a tiny hostile file may take beyond what the imported libraries have."""

LIMITED_READER = """
import resource, sys
from pathlib import Path
from contact_curation.errors import UnreadableInputError
from contact_curation.storage.bags.reader import BagReader
from test.storage.written_bags import NOTE, note, write_ours
write_ours(Path(sys.argv[1]) / "warm.mcap", [])
list(BagReader(Path(sys.argv[1]) / "warm.mcap").messages())
in_use = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (in_use + int(sys.argv[2]),) * 2)
for path in sorted(Path(sys.argv[1]).glob("hostile*")):
    try:
        with BagReader(path) as reader:
            count = sum(1 for _ in reader.messages())
            list(reader.raw_messages())
            print(path.name, "read", count, "|".join(reader.losses), flush=True)
    except UnreadableInputError as error:
        print(path.name, "refused", error, flush=True)
"""


def record(opcode: int, body: bytes, length: int | None = None) -> bytes:
    return struct.pack("<BQ", opcode, len(body) if length is None else length) + body


def text(value: str, length: int | None = None) -> bytes:
    return struct.pack("<I", len(value) if length is None else length) + value.encode()


HEADER = record(1, text("ros2") + text("x"))
END = record(15, bytes(4)) + record(2, bytes(20)) + MAGIC


def chunk(compression: str, stored: bytes, unpacked: int, stored_length: int | None = None) -> bytes:
    length = len(stored) if stored_length is None else stored_length
    return record(6, struct.pack("<QQQI", 1, 2, unpacked, 0) + text(compression) + struct.pack("<Q", length) + stored)


def message(cdr: bytes, schema: str) -> bytes:
    """Schema, channel and one message, as the records of a chunk."""
    described = record(3, struct.pack("<H", 1) + text("a/msg/A") + text("ros2msg") + text(schema))
    channel = record(4, struct.pack("<HH", 1, 1) + text("/a") + text("cdr") + bytes(4))
    return described + channel + record(5, struct.pack("<HIQQ", 1, 0, 1, 1) + b"\x00\x01\x00\x00" + cdr)


def in_chunk(records: bytes) -> bytes:
    return HEADER + chunk("", records, len(records)) + END


def zstd_frame_of_declared_size(size: int) -> bytes:
    """A frame whose head declares `size` bytes and that holds a few."""
    return b"\x28\xb5\x2f\xfd\xe0" + struct.pack("<Q", size) + b"\x19\x00\x00abc"


MANY = 2**32 - 1


def hostile_mcap() -> dict[str, bytes]:
    """What follows the magic of MCAP files."""
    return {
        "header length": record(1, b"", 2**63) + END,
        "chunk record length": HEADER + record(6, bytes(40), 2**62),
        "chunk stored length": HEADER + chunk("zstd", b"abc", 100, 2**62) + END,
        "chunk unpacked length": HEADER + chunk("zstd", zstandard.compress(b"abc"), 2**62) + END,
        "chunk unpacked length below the limit": HEADER + chunk("lz4", lz4.frame.compress(b"abc"), 250 << 20) + END,
        "zstd declared length": HEADER + chunk("zstd", zstd_frame_of_declared_size(2**60), 100) + END,
        "zstd declared length below the limit": HEADER + chunk("zstd", zstd_frame_of_declared_size(250 << 20), 250 << 20) + END,
        "zstd bomb": HEADER + chunk("zstd", zstandard.compress(bytes(GIBIBYTE // 4), 3), GIBIBYTE) + END,
        "lz4 bomb": HEADER + chunk("lz4", lz4.frame.compress(bytes(GIBIBYTE // 4)), 1000) + END,
        "compression name": HEADER + record(6, struct.pack("<QQQII", 1, 2, 3, 0, MANY) + bytes(20)) + END,
        "schema name": HEADER + record(3, struct.pack("<H", 1) + text("a", MANY)) + END,
        "channel metadata": HEADER
        + record(4, struct.pack("<HH", 1, 0) + text("/a") + text("cdr") + struct.pack("<I", MANY))
        + END,
        "message index": HEADER + chunk("", b"", 0) + record(7, struct.pack("<HI", 1, MANY)) + END,
        "summary start": HEADER + record(15, bytes(4)) + record(2, struct.pack("<QQI", 9, 0, 0)) + MAGIC,
        "summary start beyond": HEADER + record(15, bytes(4)) + record(2, struct.pack("<QQI", 2**63, 0, 0)) + MAGIC,
        "statistics": HEADER
        + record(11, bytes(38) + struct.pack("<I", MANY))
        + record(2, struct.pack("<QQI", 22, 0, 0))
        + MAGIC,
        "message record": in_chunk(record(5, bytes(22), 2**62)),
        "string": in_chunk(message(struct.pack("<I", MANY), "string a\n")),
        "sequence of numbers": in_chunk(message(struct.pack("<I", MANY), "float64[] a\n")),
        "sequence of strings": in_chunk(message(struct.pack("<I", MANY), "string[] a\n")),
        "sequence of messages": in_chunk(message(struct.pack("<I", MANY), f"B[] a\n{'=' * 80}\nMSG: a/B\nfloat64 x\n")),
        "fixed array": in_chunk(message(b"", "float64[4000000000] a\n")),
        "fixed array of messages": in_chunk(message(b"", f"B[4000000000] a\n{'=' * 80}\nMSG: a/B\nfloat64 x\n")),
        "fixed array of strings": in_chunk(message(b"", "string[4000000000] a\n")),
        "compressed message": in_chunk(
            message(b"", "float64[] a\n").replace(b"\x00\x01\x00\x00", zstd_frame_of_declared_size(2**60)[:4])
        ),
    }


ROS1 = b"#ROSBAG V2.0\n"


def ros1_record(fields: dict[bytes, bytes], size: int, data: bytes = b"") -> bytes:
    head = b"".join(struct.pack("<I", len(name) + 1 + len(value)) + name + b"=" + value for name, value in fields.items())
    return struct.pack("<I", len(head)) + head + struct.pack("<I", size) + data


def ros1_chunk(compression: bytes, data: bytes, unpacked: int) -> bytes:
    fields = {b"op": b"\x05", b"compression": compression, b"size": struct.pack("<I", unpacked)}
    return ros1_record(fields, len(data), data)


def hostile_ros1() -> dict[str, bytes]:
    """What follows the magic of ROS 1 bags."""
    bomb = bz2.compress(bytes(GIBIBYTE // 4))
    return {
        "record head": struct.pack("<I", MANY),
        "head field": struct.pack("<II", 8, MANY) + b"op=\x05",
        "record data": ros1_record({b"op": b"\x07", b"conn": bytes(4)}, MANY),
        "chunk": ros1_record({b"op": b"\x05", b"compression": b"none", b"size": struct.pack("<I", MANY)}, MANY),
        "index": ros1_chunk(b"none", b"", 0) + ros1_record({b"op": b"\x04", b"conn": bytes(4)}, MANY),
        "bz2 bomb": ros1_chunk(b"bz2", bomb, MANY),
        "bz2 bomb that lies": ros1_chunk(b"bz2", bomb, 1000),
        "lz4 bomb": ros1_chunk(b"lz4", lz4.frame.compress(bytes(GIBIBYTE // 4)), MANY),
    }


@pytest.mark.slow
@pytest.mark.parametrize(("start", "made"), [(MAGIC, hostile_mcap), (ROS1, hostile_ros1)], ids=["mcap", "ros1"])
def test_huge_declared_sizes_in_small_files_take_no_memory(
    tmp_path: Path, start: bytes, made: Callable[[], dict[str, bytes]]
) -> None:
    hostile = made()
    for name, content in hostile.items():
        (tmp_path / f"hostile {name}").write_bytes(start + content)
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    command = [sys.executable, "-c", LIMITED_READER, str(tmp_path), str(SPARE_BYTES)]
    ended = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=120, check=False)
    assert ended.returncode == 0, ended.stderr
    lines = ended.stdout.splitlines()
    assert len(lines) == len(hostile)
    harmless = {"summary start", "message index", "statistics"}
    for line in lines:
        name, _, outcome = line.removeprefix("hostile ").partition(" read 0 ")
        assert outcome or name in harmless, line


def test_the_limit_of_that_test_is_felt(tmp_path: Path) -> None:
    """An allocation of what such files declare does fail under the same limit."""
    code = LIMITED_READER.replace("for path in", "bytearray(200 << 20)\nfor path in")
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    command = [sys.executable, "-c", code, str(tmp_path), str(SPARE_BYTES)]
    ended = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=120, check=False)
    assert "MemoryError" in ended.stderr


CHANNELS = [record(4, struct.pack("<HH", number, 0) + text("/a") + text("cdr") + bytes(4)) for number in range(1 << 16)]
LOOSE = [record(5, struct.pack("<HIQQ", number, 0, number, number)) for number in range(1 << 15)]


@pytest.mark.parametrize(
    "records",
    [
        in_chunk(b"".join(CHANNELS)),
        HEADER + chunk("", b"", 0) + b"".join(record(7, struct.pack("<HI", number, 0)) for number in range(1 << 16)) + END,
        HEADER + b"".join(LOOSE) + END,
    ],
    ids=["channels in a chunk", "indices of a chunk", "messages without a chunk"],
)
def test_the_time_of_reading_grows_with_the_channels_and_not_with_their_square(tmp_path: Path, records: bytes) -> None:
    (tmp_path / "bag.mcap").write_bytes(MAGIC + records)
    began = process_time()
    with BagReader(tmp_path / "bag.mcap") as reader:
        list(reader.raw_messages())
    assert process_time() - began < 5.0


def test_a_file_gives_no_more_bytes_than_it_has(tmp_path: Path) -> None:
    (tmp_path / "small").write_bytes(b"abcdef")
    file = BagFile(tmp_path / "small")
    assert file.read(4, 2) == b"ef"
    for offset, length in ((4, 3), (0, 2**62), (2**62, 1), (7, 0)):
        with pytest.raises(DamagedBagError, match=f"{length} bytes are declared at byte {offset}"):
            file.read(offset, length)
    file.close()


SMALL = recording(12)
SMALL_FORMATS: dict[str, Callable[[Path], Path]] = {
    "mcap": lambda at: write_ours(at / "bag.mcap", SMALL),
    "mcap, not compressed": lambda at: write_mcap(at / "bag.mcap", SMALL, compression=CompressionType.NONE, enable_crcs=False),
    "mcap without chunks": lambda at: write_mcap(at / "bag.mcap", SMALL, use_chunking=False),
    "sqlite3": lambda at: write_rosbag2(at / "bag", SMALL, StoragePlugin.SQLITE3) / "bag.db3",
    "ros1": lambda at: write_ros1(at / "a.bag", recording(12, NOETIC)),
    "ros1, lz4": lambda at: write_ros1(at / "a.bag", recording(12, NOETIC), "lz4"),
}


def damaged(data: bytes, draw: np.random.Generator) -> bytes:
    """The bytes with some of them set at random, a part overwritten, cut off or put in twice."""
    changed = bytearray(data)
    kind = draw.integers(4)
    at, length = int(draw.integers(len(data))), int(draw.integers(1, 40))
    if kind == 0:
        for place in draw.integers(len(data), size=length):
            changed[place] = int(draw.integers(256))
    elif kind == 1:
        changed[at : at + length] = draw.bytes(length)
    elif kind == 2:
        changed[at : at + length] = b"\xff" * length
    else:
        changed[at:at] = changed[at // 2 : at // 2 + length]
    return bytes(changed[: int(draw.integers(1, len(data)))] if draw.integers(5) == 0 else changed)


def read_all_ways(path: Path) -> None:
    """Reads a bag; the only error it may raise is ours."""
    limits = BagLimits(chunk_bytes=1 << 22, message_bytes=1 << 20)
    with suppress(UnreadableInputError), BagReader(path, limits) as reader:
        _ = reader.topics
        decoded = sum(1 for _ in reader.messages())
        raw = sum(1 for _ in reader.raw_messages())
        assert decoded <= raw
        assert all("\n" not in line for line in reader.losses)


def damage_often(path: Path, rounds: int) -> None:
    whole = path.read_bytes()
    draw = np.random.default_rng(len(whole))
    for _ in range(rounds):
        path.write_bytes(damaged(whole, draw))
        read_all_ways(path)


@pytest.mark.parametrize("kind", SMALL_FORMATS)
def test_no_damage_ends_in_another_error_than_ours(tmp_path: Path, kind: str) -> None:
    damage_often(SMALL_FORMATS[kind](tmp_path), 40)


@pytest.mark.slow
@pytest.mark.parametrize("kind", SMALL_FORMATS)
def test_no_damage_of_many_ends_in_another_error_than_ours(tmp_path: Path, kind: str) -> None:
    damage_often(SMALL_FORMATS[kind](tmp_path), 400)


# Databases


def test_a_journal_deletes_no_file_that_it_names(tmp_path: Path) -> None:
    path, theirs = SMALL_FORMATS["sqlite3"](tmp_path), tmp_path / "thesis.txt"
    theirs.write_text("three years")
    journal = path.with_name("bag.db3-journal")
    journal.write_bytes(rollback_journal(path, theirs))
    with BagReader(path) as reader:
        assert len(list(reader.messages())) == len(SMALL)
    assert theirs.read_text() == "three years"
    assert journal.exists()


def test_a_transaction_that_was_not_committed_is_rolled_back(tmp_path: Path) -> None:
    path = SMALL_FORMATS["sqlite3"](tmp_path)
    with closing(sqlite3.connect(path, isolation_level=None)) as live:
        live.execute("PRAGMA cache_spill = 1")
        live.execute("PRAGMA cache_size = 1")
        live.execute("BEGIN")
        live.execute("UPDATE messages SET data = zeroblob(5000)")
        killed = tmp_path / "killed"
        shutil.copytree(path.parent, killed)
    assert (killed / "bag.db3-journal").stat().st_size > 0
    assert (killed / "bag.db3").read_bytes() != path.read_bytes()
    with BagReader(path) as whole, BagReader(killed / "bag.db3") as rolled_back:
        assert [m.data for m in rolled_back.raw_messages()] == [m.data for m in whole.raw_messages()]


def test_a_device_beside_a_database_is_not_copied(tmp_path: Path) -> None:
    path = SMALL_FORMATS["sqlite3"](tmp_path)
    path.with_name("bag.db3-journal").write_bytes(bytes(600))
    path.with_name("bag.db3-wal").symlink_to("/dev/zero")
    with BagReader(path) as reader:
        assert len(list(reader.messages())) == len(SMALL)


ENDLESS = "WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c) SELECT x"


@pytest.mark.parametrize(
    ("table", "statements"),
    [
        (
            "message_definitions",
            (
                "DROP TABLE IF EXISTS message_definitions; CREATE VIEW message_definitions AS "
                f"{ENDLESS} AS topic_type, '' AS encoded_message_definition, '' AS encoding FROM c"
            ),
        ),
        ("topics", "DROP TABLE topics; CREATE VIRTUAL TABLE topics USING fts5(id, name, type, serialization_format)"),
        (
            "messages",
            (
                "DROP TABLE messages; CREATE TABLE messages (id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, "
                "data BLOB AS (zeroblob(1000000000)))"
            ),
        ),
    ],
)
def test_a_database_that_computes_its_rows_is_refused(tmp_path: Path, table: str, statements: str) -> None:
    path = SMALL_FORMATS["sqlite3"](tmp_path)
    with closing(sqlite3.connect(path)) as database:
        database.executescript(statements)
    with pytest.raises(UnreadableInputError, match=f"its {table} are computed|no tables topics"):
        BagReader(path)


# Not a bag at all


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("empty.mcap", b"", "is empty"),
        (
            "text.mcap",
            b"just some text\n",
            "begins with b'just some text.*; poses in a file of text become",
        ),
        ("text.bag", b"#ROSBAG V1.1\n", "ROS 1 bag \\(version 2.0\\)"),
        ("half.mcap", MAGIC[:5], r"begins with .*\(version 2\.0\)$"),
        ("empty.db3", b"SQLite format 3\0", "rosbag2 database"),
    ],
)
def test_files_that_are_no_bags_are_refused_in_one_line(tmp_path: Path, name: str, content: bytes, expected: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(UnreadableInputError, match=expected) as caught:
        BagReader(tmp_path / name)
    assert str(tmp_path / name) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_folders_without_storage_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UnreadableInputError, match="without storage files"):
        BagReader(tmp_path)
    (tmp_path / "metadata.yaml").write_text("rosbag2_bagfile_information: {}")
    with pytest.raises(UnreadableInputError, match="without storage files"):
        BagReader(tmp_path)


def test_a_folder_with_files_of_two_formats_is_refused(tmp_path: Path) -> None:
    write_ours(tmp_path / "a.mcap", SMALL)
    (tmp_path / "a.db3").write_bytes(b"SQLite format 3\0")
    with pytest.raises(UnreadableInputError, match="name one of them"):
        BagReader(tmp_path)


def test_what_is_not_there_or_not_a_file_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.mcap")
    for name, expected in (("nothing.mcap", "No such file"), ("pipe.mcap", "is not a file")):
        with pytest.raises(UnreadableInputError, match=expected):
            BagReader(tmp_path / name)


@pytest.fixture
def without_rights() -> Iterator[None]:
    """Runs the test as a user who may not read everything: root may, so it becomes nobody meanwhile."""
    user = os.geteuid()
    if user == 0:
        os.seteuid(65534)
    yield
    os.seteuid(user)


def test_what_may_not_be_read_is_refused(tmp_path: Path, request: pytest.FixtureRequest) -> None:
    (tmp_path / "locked").mkdir()
    paths = [write_ours(tmp_path / "bag.mcap", SMALL), tmp_path / "locked"]
    for path in (*paths, tmp_path):
        path.chmod(0)
    tmp_path.chmod(0o500)
    request.getfixturevalue("without_rights")
    for path in paths:
        with pytest.raises(UnreadableInputError, match="Permission denied"):
            BagReader(path)
