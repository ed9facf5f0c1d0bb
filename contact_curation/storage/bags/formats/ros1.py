"""Reads ROS 1 bags, version 2.0, whole or damaged (http://wiki.ros.org/Bags/Format/2.0). TagSLAM's recordings have this format.

A record consists of a head with named fields, and data. As for MCAP, the records are followed from the front. The index entries
after each chunk describe its content; if they are missing, because the recorder was killed, the chunk is unpacked once for it.
The recorder writes the length of a chunk, and the position of the bag's index, only at their end; until then both are zero.
"""

import struct
from collections import Counter
from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from rosbags.typesys.msg import normalize_msgtype

from contact_curation.errors import UnreadableInputError
from contact_curation.storage.bags.file import BagFile, BagLimits, DamagedBagError, Losses
from contact_curation.storage.bags.formats.chunks import (
    Chunk,
    ChunkedStorage,
    Declarations,
    ParsedChunk,
    chunk_data,
    say_damaged,
)
from contact_curation.storage.bags.records import Channel, OfferedQos, StoredMessage

ROS1_MAGIC = b"#ROSBAG V2.0\n"
LENGTH = struct.Struct("<I")
STAMP = struct.Struct("<II")
"""A time: seconds and nanoseconds."""
NANOSECONDS = 1_000_000_000
LARGEST_HEAD = 1 << 20
MESSAGE, BAG_HEADER, INDEX, CHUNK, CHUNK_INFO, CONNECTION = 2, 3, 4, 5, 6, 7
"""Values of the field `op`."""
RENAMED_TYPES = {"tf/msg/tfMessage": "tf2_msgs/msg/TFMessage"}
"""ROS 2 names of types that ROS 2 has renamed."""


class Record(NamedTuple):
    """The fields of a record, and the position of its data; the next record is at `data_at + size`."""

    fields: Mapping[bytes, bytes]
    data_at: int
    size: int

    @property
    def operation(self) -> int:
        return self.number(b"op", "<B")

    def number(self, name: bytes, form: str = "<I") -> int:
        """The field `name` as a number.

        Raises:
            DamagedBagError: the field is missing or has another size.
        """
        try:
            return int(struct.unpack(form, self.fields[name])[0])
        except (KeyError, struct.error) as error:
            raise DamagedBagError(f"a record's field {name.decode()} is missing or malformed") from error

    def text(self, name: bytes) -> str:
        return self.fields.get(name, b"").decode(errors="replace")


def read_record(read: Callable[[int, int], bytes], offset: int) -> Record:
    """Reads the record at `offset`; `read(offset, length)` returns bytes or raises DamagedBagError.

    Raises:
        DamagedBagError: no record begins there.
    """
    (length,) = LENGTH.unpack(read(offset, LENGTH.size))
    if length > LARGEST_HEAD:
        raise DamagedBagError(f"a record with a head of {length} bytes")
    fields = _fields(read(offset + LENGTH.size, length))
    size_at = offset + LENGTH.size + length
    (size,) = LENGTH.unpack(read(size_at, LENGTH.size))
    return Record(fields, size_at + LENGTH.size, size)


def declare_connection(record: Record, data: bytes, declarations: Declarations) -> None:
    """Declares the channel of a connection record, whose data are fields again; the first declaration of an id counts.

    Raises:
        DamagedBagError: the record is malformed.
    """
    number = record.number(b"conn")
    if number in declarations.channels:
        return
    described = Record(_fields(data), 0, 0)
    type_name = normalize_msgtype(described.text(b"type"))
    declarations.channels[number] = Channel(
        topic=_normalized(record.text(b"topic")),
        type=RENAMED_TYPES.get(type_name, type_name),
        encoding="ros1",
        schema=described.text(b"message_definition"),
        schema_encoding="ros1msg",
        type_hash="",
        qos=OfferedQos(latched=described.fields.get(b"latching") == b"1"),
    )


def parse_chunk(data: bytes, topics: Collection[str] | None, declarations: Declarations) -> ParsedChunk:
    """The messages of `topics` (None: all) in an unpacked chunk; declares the connections in it."""
    messages: list[StoredMessage] = []
    undeclared, position = 0, 0
    wanted = declarations.wanted(topics)
    read = _reader(data)
    while position < len(data):
        try:
            record = read_record(read, position)
            body = read(record.data_at, record.size)
            if record.operation == CONNECTION:
                declare_connection(record, body, declarations)
                declarations.add_wanted(topics, wanted)
            elif record.operation == MESSAGE:
                number, time_ns = record.number(b"conn"), _time_ns(record)
                channel = wanted.get(number)
                if channel is not None:
                    messages.append(StoredMessage(time_ns, time_ns, channel, body))
                undeclared += number not in wanted
        except DamagedBagError as error:
            return ParsedChunk(messages, undeclared, f"its record at byte {position} is damaged: {error}")
        position = record.data_at + record.size
    return ParsedChunk(messages, undeclared)


def _reader(data: bytes) -> Callable[[int, int], bytes]:
    def read(offset: int, length: int) -> bytes:
        if offset + length > len(data):
            raise DamagedBagError(f"it declares {length} bytes where {len(data) - offset} are left")
        return data[offset : offset + length]

    return read


def _fields(head: bytes) -> dict[bytes, bytes]:
    fields: dict[bytes, bytes] = {}
    position = 0
    while position < len(head):
        if position + LENGTH.size > len(head):
            raise DamagedBagError("a record's head is malformed")
        (length,) = LENGTH.unpack_from(head, position)
        position += LENGTH.size
        name, separator, value = head[position : position + length].partition(b"=")
        position += length
        if not separator or position > len(head):
            raise DamagedBagError("a record's head is malformed")
        fields[name] = value
    return fields


def _time_ns(record: Record) -> int:
    try:
        seconds, nanoseconds = STAMP.unpack(record.fields[b"time"])
    except (KeyError, struct.error) as error:
        raise DamagedBagError("a message without a time") from error
    return int(seconds * NANOSECONDS + nanoseconds)


def _normalized(topic: str) -> str:
    """Normalises the name of a topic: ROS 1 accepts names without their leading slash, and with double slashes."""
    return "/" + "/".join(part for part in topic.split("/") if part)


UNTIL_THE_END = 1 << 32
"""Declared unpacked size that stands for a chunk whose length was never written, which is the rest of the file."""
ENTRY = np.dtype([("seconds", "<u4"), ("nanoseconds", "<u4"), ("offset", "<u4")])
"""An index entry: a message's time and its position in the chunk."""


def open_ros1(file: BagFile, limits: BagLimits, losses: Losses) -> ChunkedStorage:
    """Opens a ROS 1 bag as far as it can be read; what is lost is added to `losses`.

    Raises:
        UnreadableInputError: the bag is encrypted.
    """
    declarations = Declarations()
    walk = _Ros1Walk(file, declarations)
    why = walk.follow()
    chunks = [_surveyed(file, chunk, declarations, limits, losses) for chunk in walk.chunks]
    if why:
        held = sum(sum((chunk.counts or {}).values()) for chunk in chunks)
        before = f"before it are {len(chunks)} chunks with {held} messages"
        line = f"{file.path.name}: cut short at byte {walk.offset} of {file.size}: {why}; {before}"
        losses.say((file.path.name, "cut"), line)

    def parse(data: bytes, topics: Collection[str] | None) -> ParsedChunk:
        return parse_chunk(data, topics, declarations)

    return ChunkedStorage(file, chunks, declarations, parse, None, limits, losses)


class _Ros1Walk:
    """Follows the records of a bag; `offset` is the present position."""

    def __init__(self, file: BagFile, declarations: Declarations) -> None:
        self._file = file
        self._declarations = declarations
        self.offset = len(ROS1_MAGIC)
        self.chunks: list[Chunk] = []
        self._finished = True

    def follow(self) -> str:
        """Follows the records to the end; returns why this failed, or an empty text."""
        try:
            while self.offset < self._file.size:
                record = read_record(self._file.read, self.offset)
                self._take(record)
                self.offset = record.data_at + record.size
        except DamagedBagError as error:
            if self.chunks:  # its index may be incomplete
                self.chunks[-1] = replace(self.chunks[-1], counts=None)
            return str(error)
        return "" if self._finished else "the recording was not finished"

    def _take(self, record: Record) -> None:
        operation = record.operation
        held = min(record.size, self._file.size - record.data_at)
        if operation == BAG_HEADER:
            self._take_header(record)
        elif operation == CHUNK:
            self._take_chunk(record, held)
        if held < record.size:
            raise DamagedBagError(f"a record of {record.size} bytes, of which the file holds {held}")
        if operation == INDEX and self.chunks:
            self._take_index(record)
        elif operation == CONNECTION:
            declare_connection(record, self._file.read(record.data_at, record.size), self._declarations)

    def _take_header(self, record: Record) -> None:
        if record.text(b"encryptor"):
            raise UnreadableInputError(self._file.path, "is encrypted: decrypt it first (`rosbag decrypt`)")
        self._finished = record.number(b"index_pos", "<Q") != 0

    def _take_chunk(self, record: Record, held: int) -> None:
        """Adds a chunk, which may be cut off."""
        unpacked, whole = record.number(b"size"), held == record.size
        unfinished = record.size == 0 and not self._finished
        if unfinished:
            held, unpacked, whole = self._file.size - record.data_at, UNTIL_THE_END, False
        self.chunks.append(Chunk(record.data_at, held, record.text(b"compression"), unpacked, 0, 0, 0, None, whole))
        if unfinished:
            raise DamagedBagError("the recording was not finished, nor was its last chunk")

    def _take_index(self, record: Record) -> None:
        """Reads times and number of one connection's messages in the previous chunk."""
        data = self._file.read(record.data_at, record.size)
        entries = np.frombuffer(data[: len(data) // ENTRY.itemsize * ENTRY.itemsize], ENTRY)
        if not entries.size:
            return
        times = entries["seconds"].astype(np.int64) * NANOSECONDS + entries["nanoseconds"]
        chunk = self.chunks[-1]
        first, last = int(times.min()), int(times.max())
        if chunk.counts is not None:
            first, last = min(first, chunk.start_ns), max(last, chunk.end_ns)
        counts = {} if chunk.counts is None else chunk.counts
        counts[record.number(b"conn")] = int(entries.size)
        self.chunks[-1] = replace(chunk, start_ns=first, end_ns=last, counts=counts)


def _surveyed(file: BagFile, chunk: Chunk, declarations: Declarations, limits: BagLimits, losses: Losses) -> Chunk:
    """The chunk with its content; it is unpacked once if it has no index, or connections that are declared nowhere else."""
    uncounted = chunk.counts is None
    if not uncounted and all(number in declarations.channels for number in chunk.counts or {}):
        return chunk
    try:
        found = parse_chunk(chunk_data(file, chunk, limits), None if uncounted else (), declarations).messages
    except DamagedBagError as error:
        say_damaged(losses, file.path.name, chunk, str(error))
        return chunk
    if not (uncounted and found):
        return chunk
    times = [message.log_time_ns for message in found]
    numbers = {channel: number for number, channel in declarations.channels.items()}
    counts = Counter(numbers[message.channel] for message in found)
    return replace(chunk, start_ns=min(times), end_ns=max(times), counts=counts)
