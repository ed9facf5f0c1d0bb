"""The records of ROS 1 bags, version 2.0 (http://wiki.ros.org/Bags/Format/2.0): a head of named fields, then data."""

import struct
from collections.abc import Callable, Collection, Mapping
from typing import NamedTuple

from rosbags.typesys.msg import normalize_msgtype

from contact_curation.storage.bags.chunks import Declarations, ParsedChunk
from contact_curation.storage.bags.errors import DamagedBagError
from contact_curation.storage.bags.records import Channel, OfferedQos, StoredMessage

ROS1_MAGIC = b"#ROSBAG V2.0\n"
LENGTH = struct.Struct("<I")
STAMP = struct.Struct("<II")
"""Seconds and nanoseconds."""
NANOSECONDS = 1_000_000_000
LARGEST_HEAD = 1 << 20
MESSAGE, BAG_HEADER, INDEX, CHUNK, CHUNK_INFO, CONNECTION = 2, 3, 4, 5, 6, 7
"""Values of the field `op`."""
RENAMED_TYPES = {"tf/msg/tfMessage": "tf2_msgs/msg/TFMessage"}
"""Types whose ROS 2 name is another one."""


class Record(NamedTuple):
    """Where a record's data lie, and its fields; the next record is at `data_at + size`."""

    fields: Mapping[bytes, bytes]
    data_at: int
    size: int

    @property
    def operation(self) -> int:
        return self.number(b"op", "<B")

    def number(self, name: bytes, form: str = "<I") -> int:
        """The field `name` as a number.

        Raises:
            DamagedBagError: it is missing or of another size.
        """
        try:
            return int(struct.unpack(form, self.fields[name])[0])
        except (KeyError, struct.error) as error:
            raise DamagedBagError(f"a record's field {name.decode()} is missing or malformed") from error

    def text(self, name: bytes) -> str:
        return self.fields.get(name, b"").decode(errors="replace")


def read_record(read: Callable[[int, int], bytes], offset: int) -> Record:
    """The record at `offset`; `read(offset, length)` gives bytes or raises DamagedBagError.

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
    """Takes in a connection record, whose data are fields again; its first declaration counts.

    Raises:
        DamagedBagError: it is malformed.
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
                wanted = declarations.wanted(topics)
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
    """ROS 1 lets topics come without their slash, and with doubled ones."""
    return "/" + "/".join(part for part in topic.split("/") if part)
