"""Parses the records of MCAP (https://mcap.dev/spec): messages, schemas and channels, and the index at the end of the file."""

import struct
import zlib
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from io import BytesIO
from typing import Any

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel as ChannelRecord
from mcap.records import ChunkIndex, McapRecord, Metadata, MetadataIndex, Schema, Statistics
from mcap.stream_reader import StreamReader
from mcap.well_known import SchemaEncoding
from rosbags.typesys.msg import normalize_msgtype

from contact_curation.storage.bags.file import BagFile, BagLimits, DamagedBagError
from contact_curation.storage.bags.formats.chunks import Declarations, ParsedChunk
from contact_curation.storage.bags.records import Channel, StoredMessage, qos_from

MCAP_MAGIC = b"\x89MCAP0\r\n"
RECORD_HEAD = struct.Struct("<BQ")
"""Head of a record: opcode and length of the body."""
MESSAGE_HEAD = struct.Struct("<HIQQ")
"""Head of a message: channel id, sequence, log time, publish time."""
NO_SCHEMA = 0
PARSE_ERRORS = (McapError, struct.error, UnicodeDecodeError, OverflowError)
"""Errors of mcap's record classes for bytes that are no such record."""


class McapDeclarations(Declarations):
    """Schemas and channels of an MCAP file, declared by records anywhere in it."""

    def __init__(self) -> None:
        super().__init__()
        self._schemas: dict[int, Schema] = {}

    def declare(self, opcode: int, body: bytes) -> None:
        """Adds the schema or channel of a record.

        Raises:
            DamagedBagError: `body` is no Schema or Channel record.
        """
        if opcode == Opcode.SCHEMA:
            self.declare_schema(parsed(Schema, body))
        else:
            self.declare_channel(parsed(ChannelRecord, body))

    def declare_schema(self, schema: Schema) -> None:
        self._schemas.setdefault(schema.id, schema)

    def declare_channel(self, record: ChannelRecord) -> None:
        """Adds a channel; the first declaration of an id counts, because ids must not change their meaning within a file."""
        if record.id not in self.channels:
            self.channels[record.id] = _channel(record, self._schemas.get(record.schema_id))

    def knows_schema(self, record: ChannelRecord) -> bool:
        """Whether the schema of a channel was declared already, or it has none."""
        return record.schema_id == NO_SCHEMA or record.schema_id in self._schemas


def parsed(record: Any, body: bytes) -> Any:
    """Parses `body` as one of mcap's record classes, without reading beyond its end.

    Raises:
        DamagedBagError: `body` is no such record.
    """
    try:
        return record.read(ReadDataStream(BytesIO(body)))
    except PARSE_ERRORS as error:
        raise DamagedBagError(f"a {record.__name__} record is malformed: {error!r}") from error


def parse_chunk(data: bytes, topics: Collection[str] | None, declarations: McapDeclarations) -> ParsedChunk:
    """Reads the messages of `topics` (None: all) in an unpacked chunk, and declares its channels.

    Raises:
        DamagedBagError: a record is longer than the rest of the chunk, or malformed.
    """
    messages: list[StoredMessage] = []
    undeclared, position, size = 0, 0, len(data)
    wanted = declarations.wanted(topics)
    head, message_head = RECORD_HEAD.unpack_from, MESSAGE_HEAD.unpack_from  # this loop runs once per message
    head_size, message_head_size, message_opcode = RECORD_HEAD.size, MESSAGE_HEAD.size, int(Opcode.MESSAGE)
    while position < size:
        try:
            opcode, length = head(data, position)
            start = position + head_size
            end = start + length
            is_message = opcode == message_opcode
            if end > size or (is_message and length < message_head_size):
                raise DamagedBagError(f"it declares {length} bytes where {size - start} are left")
            if is_message:
                number, _, log_time, publish_time = message_head(data, start)
                channel = wanted.get(number)
                if channel is not None:
                    messages.append(StoredMessage(log_time, publish_time, channel, data[start + message_head_size : end]))
                else:
                    undeclared += number not in wanted
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                declarations.declare(opcode, data[start:end])
                declarations.add_wanted(topics, wanted)
        except (DamagedBagError, struct.error) as error:
            return ParsedChunk(messages, undeclared, f"its record at byte {position} is damaged: {error}")
        position = end
    return ParsedChunk(messages, undeclared)


def _channel(record: ChannelRecord, schema: Schema | None) -> Channel:
    name = schema.name if schema else ""
    encoding = schema.encoding if schema else SchemaEncoding.SelfDescribing
    two_parts = name.count("/") == 1  # as in ROS 1, and from some recorders of ROS 2
    return Channel(
        topic=record.topic,
        type=normalize_msgtype(name) if encoding == SchemaEncoding.ROS1 or two_parts else name,
        encoding=record.message_encoding,
        schema=schema.data.decode(errors="replace") if schema else "",
        schema_encoding=encoding,
        type_hash=record.metadata.get("topic_type_hash", ""),
        qos=qos_from(record.metadata.get("offered_qos_profiles", "")),
    )


FOOTER = struct.Struct("<BQQQI8s")
"""Footer: opcode, length, start of the summary, start of its offsets, CRC, magic."""
FOOTER_LENGTH = 20
FOOTER_OPCODE = 2
CRC_SIZE = 4


@dataclass(frozen=True)
class McapSummary:
    """The content of the index.

    Attributes:
        chunk_offsets: offsets of the chunk records.
        counts: messages per channel id; None if the index does not contain them.
        total: number of messages in the file; None if the index does not contain it.
        chunks: position and channels of each chunk.
        notes: position of each metadata record, by its name.
        counted: numbers of channels and chunks in the statistics; None if there are none.
        start: position of the index.
    """

    chunk_offsets: tuple[int, ...]
    counts: Mapping[int, int] | None
    total: int | None
    chunks: tuple[ChunkIndex, ...] = ()
    notes: tuple[MetadataIndex, ...] = ()
    counted: tuple[int, int] | None = None
    start: int = 0


def read_summary(file: BagFile, declarations: McapDeclarations, limits: BagLimits) -> McapSummary | None:
    """Reads the index and declares its channels and schemas.

    Returns:
        The index; None if the file was written without one, or is cut.

    Raises:
        DamagedBagError: there is an index, and it is damaged.
    """
    start, crc = _summary_start(file)
    if start == 0:
        return None
    if not len(MCAP_MAGIC) <= start < file.size or file.size - start > limits.chunk_bytes:
        raise DamagedBagError(f"it is said to begin at byte {start}")
    data = file.read(start, file.size - start)
    if crc and zlib.crc32(data[: -len(MCAP_MAGIC) - CRC_SIZE]) != crc:
        raise DamagedBagError("its checksum does not match")
    return replace(_summary(list(_records(data)), declarations), start=start)


def read_notes(file: BagFile, limits: BagLimits) -> dict[str, dict[str, str]]:
    """The metadata records that the index names, by their names; none without an intact index."""
    try:
        summary = read_summary(file, McapDeclarations(), limits)
        places = [] if summary is None else [(one.offset, min(one.length, limits.message_bytes)) for one in summary.notes]
        records = [parsed(Metadata, file.read(offset, length)[RECORD_HEAD.size :]) for offset, length in places]
        return {record.name: record.metadata for record in records}
    except DamagedBagError:
        return {}


def _summary_start(file: BagFile) -> tuple[int, int]:
    """Offset and CRC of the summary, from the footer; zeros if there is none."""
    if file.size < FOOTER.size:
        return 0, 0
    opcode, length, start, _, crc, magic = FOOTER.unpack(file.read(file.size - FOOTER.size, FOOTER.size))
    if (opcode, length, magic) != (FOOTER_OPCODE, FOOTER_LENGTH, MCAP_MAGIC):
        return 0, 0
    return start, crc


def _records(data: bytes) -> Iterator[McapRecord]:
    """The records of a summary, including footer and magic; chunks, which do not belong there, stay packed."""
    try:
        yield from StreamReader(BytesIO(data), skip_magic=True, emit_chunks=True).records
    except PARSE_ERRORS as error:
        raise DamagedBagError(f"one of its records is malformed: {error!r}") from error


def _summary(records: list[McapRecord], declarations: McapDeclarations) -> McapSummary:
    counts, total, counted = None, None, None
    chunks = tuple(record for record in records if isinstance(record, ChunkIndex))
    notes = tuple(record for record in records if isinstance(record, MetadataIndex))
    for record in records:
        if isinstance(record, Schema):
            declarations.declare_schema(record)
        elif isinstance(record, ChannelRecord) and declarations.knows_schema(record):
            declarations.declare_channel(record)
        elif isinstance(record, Statistics):
            counts, total = record.channel_message_counts, record.message_count
            counted = record.channel_count, record.chunk_count
    offsets = tuple(sorted(chunk.chunk_start_offset for chunk in chunks))
    return McapSummary(offsets, counts or None, total, chunks, notes, counted)
