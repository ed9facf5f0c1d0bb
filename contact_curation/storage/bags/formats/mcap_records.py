"""The records of MCAP: those that make up a chunk, and what they declare."""

import struct
from collections.abc import Collection
from io import BytesIO
from typing import Any

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel as ChannelRecord
from mcap.records import Schema
from mcap.well_known import SchemaEncoding
from rosbags.typesys.msg import normalize_msgtype

from contact_curation.storage.bags.chunks import Declarations, ParsedChunk
from contact_curation.storage.bags.errors import DamagedBagError
from contact_curation.storage.bags.qos import qos_from
from contact_curation.storage.bags.records import Channel, StoredMessage

MCAP_MAGIC = b"\x89MCAP0\r\n"
RECORD_HEAD = struct.Struct("<BQ")
"""Opcode and length of what follows."""
MESSAGE_HEAD = struct.Struct("<HIQQ")
"""Channel id, sequence, log time, publish time."""
NO_SCHEMA = 0
PARSE_ERRORS = (McapError, struct.error, UnicodeDecodeError, OverflowError)
"""What mcap's record classes raise on bytes that are no such record."""


class McapDeclarations(Declarations):
    """Schemas and channels of an MCAP file, declared by records anywhere in it."""

    def __init__(self) -> None:
        super().__init__()
        self._schemas: dict[int, Schema] = {}

    def declare(self, opcode: int, body: bytes) -> None:
        """Takes in a Schema or Channel record.

        Raises:
            DamagedBagError: `body` is no such record.
        """
        if opcode == Opcode.SCHEMA:
            self.declare_schema(parsed(Schema, body))
        else:
            self.declare_channel(parsed(ChannelRecord, body))

    def declare_schema(self, schema: Schema) -> None:
        self._schemas.setdefault(schema.id, schema)

    def declare_channel(self, record: ChannelRecord) -> None:
        """Takes in a channel; its first declaration counts, for an id must not change its meaning within a file."""
        if record.id not in self.channels:
            self.channels[record.id] = _channel(record, self._schemas.get(record.schema_id))

    def knows_schema(self, record: ChannelRecord) -> bool:
        """Whether the schema of a channel was declared already, or it has none."""
        return record.schema_id == NO_SCHEMA or record.schema_id in self._schemas


def parsed(record: Any, body: bytes) -> Any:
    """`body` as one of mcap's record classes; reads no more than `body` holds.

    Raises:
        DamagedBagError: it is no such record.
    """
    try:
        return record.read(ReadDataStream(BytesIO(body)))
    except PARSE_ERRORS as error:
        raise DamagedBagError(f"a {record.__name__} record is malformed: {error!r}") from error


def parse_chunk(data: bytes, topics: Collection[str] | None, declarations: McapDeclarations) -> ParsedChunk:
    """The messages of `topics` (None: all) in an unpacked chunk; declares the channels that it declares."""
    messages: list[StoredMessage] = []
    undeclared, position, size = 0, 0, len(data)
    wanted = declarations.wanted(topics)
    head, message_head = RECORD_HEAD.unpack_from, MESSAGE_HEAD.unpack_from  # this loop runs once per message
    while position < size:
        try:
            opcode, length = head(data, position)
            start = position + RECORD_HEAD.size
            end = start + length
            if end > size or (opcode == Opcode.MESSAGE and length < MESSAGE_HEAD.size):
                raise DamagedBagError(f"it declares {length} bytes where {size - start} are left")
            if opcode == Opcode.MESSAGE:
                number, _, log_time, publish_time = message_head(data, start)
                channel = wanted.get(number)
                if channel is not None:
                    messages.append(StoredMessage(log_time, publish_time, channel, data[start + MESSAGE_HEAD.size : end]))
                else:
                    undeclared += number not in wanted
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                declarations.declare(opcode, data[start:end])
                wanted = declarations.wanted(topics)
        except (DamagedBagError, struct.error) as error:
            return ParsedChunk(messages, undeclared, f"its record at byte {position} is damaged: {error}")
        position = end
    return ParsedChunk(messages, undeclared)


def _channel(record: ChannelRecord, schema: Schema | None) -> Channel:
    name = schema.name if schema else ""
    encoding = schema.encoding if schema else SchemaEncoding.SelfDescribing
    return Channel(
        topic=record.topic,
        type=normalize_msgtype(name) if encoding == SchemaEncoding.ROS1 else name,
        encoding=record.message_encoding,
        schema=schema.data.decode(errors="replace") if schema else "",
        schema_encoding=encoding,
        type_hash=record.metadata.get("topic_type_hash", ""),
        qos=qos_from(record.metadata.get("offered_qos_profiles", "")),
    )
