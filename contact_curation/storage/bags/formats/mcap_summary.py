"""The index at the end of an MCAP file, when it is there and undamaged."""

import struct
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from io import BytesIO

from mcap.records import Channel as ChannelRecord
from mcap.records import ChunkIndex, McapRecord, Schema, Statistics
from mcap.stream_reader import StreamReader

from contact_curation.storage.bags.errors import DamagedBagError
from contact_curation.storage.bags.file import BagFile
from contact_curation.storage.bags.formats.mcap_records import MCAP_MAGIC, PARSE_ERRORS, McapDeclarations
from contact_curation.storage.bags.limits import BagLimits

FOOTER = struct.Struct("<BQQQI8s")
"""Opcode, length, start of the summary, start of its offsets, CRC, magic."""
FOOTER_LENGTH = 20
FOOTER_OPCODE = 2
CRC_SIZE = 4


@dataclass(frozen=True)
class McapSummary:
    """What the index says.

    Attributes:
        chunk_offsets: of the chunk records.
        counts: messages per channel id; None when it does not say.
        total: messages in the file; None when it does not say.
    """

    chunk_offsets: tuple[int, ...]
    counts: Mapping[int, int] | None
    total: int | None


def read_summary(file: BagFile, declarations: McapDeclarations, limits: BagLimits) -> McapSummary | None:
    """Reads the index and declares the channels that it names together with their schemas.

    Returns:
        None when the file has no index: it was written without, or it is cut.

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
    return _summary(list(_records(data)), declarations)


def _summary_start(file: BagFile) -> tuple[int, int]:
    """Offset and CRC of the summary, from the footer; zeros when there is none."""
    if file.size < FOOTER.size:
        return 0, 0
    opcode, length, start, _, crc, magic = FOOTER.unpack(file.read(file.size - FOOTER.size, FOOTER.size))
    if (opcode, length, magic) != (FOOTER_OPCODE, FOOTER_LENGTH, MCAP_MAGIC):
        return 0, 0
    return start, crc


def _records(data: bytes) -> Iterator[McapRecord]:
    """The records of a summary, footer and magic included."""
    try:
        yield from StreamReader(BytesIO(data), skip_magic=True).records
    except PARSE_ERRORS as error:
        raise DamagedBagError(f"one of its records is malformed: {error!r}") from error


def _summary(records: list[McapRecord], declarations: McapDeclarations) -> McapSummary:
    offsets, counts, total = [], None, None
    for record in records:
        if isinstance(record, Schema):
            declarations.declare_schema(record)
        elif isinstance(record, ChannelRecord) and declarations.knows_schema(record):
            declarations.declare_channel(record)
        elif isinstance(record, ChunkIndex):
            offsets.append(record.chunk_start_offset)
        elif isinstance(record, Statistics):
            counts, total = record.channel_message_counts, record.message_count
    return McapSummary(tuple(sorted(offsets)), counts or None, total)
