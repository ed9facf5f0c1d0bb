"""Reads MCAP files, whole or damaged (https://mcap.dev/spec).

A reader that relies on the index at the end of the file loses everything if the recorder was killed. Here the records are
followed from the front, reading only their heads. This finds the chunks that exist, and where the file is cut. The index is
used only for the channels, so that no chunk must be unpacked for them, and for finding the next chunk after damage.
"""

import struct
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import NamedTuple

from mcap.opcode import Opcode

from contact_curation.storage.bags.file import BagFile, BagLimits, DamagedBagError, Losses
from contact_curation.storage.bags.formats.chunks import Chunk, ChunkedStorage, ParsedChunk, chunk_data, say_damaged
from contact_curation.storage.bags.formats.mcap_records import (
    MCAP_MAGIC,
    MESSAGE_HEAD,
    RECORD_HEAD,
    McapDeclarations,
    McapSummary,
    parse_chunk,
    read_summary,
)

CHUNK_HEAD = struct.Struct("<QQQII")
"""Head of a chunk: first and last log time, unpacked size, CRC, length of the compression's name."""
INDEX_HEAD = struct.Struct("<HI")
"""Head of an index record: channel id, size of the entries after it."""
INDEX_ENTRY = 16
SIZE = struct.Struct("<Q")
LONGEST_COMPRESSION_NAME = 32
LOOSE_RUN_BYTES = 1 << 20
"""Messages outside of chunks are read in runs of about this many bytes."""
ENDS = (Opcode.DATA_END, Opcode.FOOTER)
DECLARATIONS = (Opcode.SCHEMA, Opcode.CHANNEL)


class Stop(NamedTuple):
    """Where following the records ended, and why; `why` is empty at the proper end of the data."""

    offset: int
    why: str


def chunk_at(file: BagFile, offset: int) -> Chunk:
    """Reads the head of the chunk record at `offset`; the chunk itself may be cut off.

    Raises:
        DamagedBagError: the head is damaged or cut off.
    """
    start = offset + RECORD_HEAD.size
    first, last, unpacked, crc, name_length = CHUNK_HEAD.unpack(file.read(start, CHUNK_HEAD.size))
    if name_length > LONGEST_COMPRESSION_NAME:
        raise DamagedBagError(f"a chunk whose compression has a name of {name_length} bytes")
    name_at = start + CHUNK_HEAD.size
    compression = file.read(name_at, name_length).decode(errors="replace")
    (stored,) = SIZE.unpack(file.read(name_at + name_length, SIZE.size))
    data_at = name_at + name_length + SIZE.size
    held = min(stored, file.size - data_at)
    return Chunk(data_at, held, compression, unpacked, crc, first, last, None, whole=held == stored)


class McapWalk:
    """Collects the chunks of a file; runs of messages outside chunks count as chunks, too.

    Attributes:
        chunks: chunks in the order in which they were found.
        heads: offsets of the chunk records that were found.
    """

    def __init__(self, file: BagFile, declarations: McapDeclarations) -> None:
        self._file = file
        self._declarations = declarations
        self.chunks: list[Chunk] = []
        self.heads: set[int] = set()
        self._loose: Chunk | None = None

    def follow(self, offset: int) -> Stop:
        """Follows the records from `offset` on, to the end of the data, to a chunk that is known already, or to damage."""
        why = ""
        try:
            while offset not in self.heads:
                if offset == self._file.size:
                    raise DamagedBagError("the end mark is missing")
                opcode, length = RECORD_HEAD.unpack(self._file.read(offset, RECORD_HEAD.size))
                if opcode in ENDS:
                    break
                self._take(opcode, offset, length)
                offset += RECORD_HEAD.size + length
        except DamagedBagError as error:
            why = str(error)
            self._doubt_last_index()
        self._end_loose_run()
        return Stop(offset, why)

    def _take(self, opcode: int, offset: int, length: int) -> None:
        start = offset + RECORD_HEAD.size
        if opcode == 0:
            raise DamagedBagError("no record begins there")
        if opcode == Opcode.CHUNK:
            self._take_chunk(offset)
        if length > self._file.size - start:
            raise DamagedBagError(f"a record of {length} bytes, of which the file holds {self._file.size - start}")
        if opcode == Opcode.MESSAGE:
            self._take_message(start, length)
            return
        self._end_loose_run()
        if opcode == Opcode.MESSAGE_INDEX and self.chunks:
            self._take_index(start)
        elif opcode in DECLARATIONS:
            self._declarations.declare(opcode, self._file.read(start, length))

    def _take_chunk(self, offset: int) -> None:
        self._end_loose_run()
        chunk = chunk_at(self._file, offset)
        self.heads.add(offset)
        self.chunks.append(chunk)

    def _take_index(self, start: int) -> None:
        """Reads from an index record the messages per channel of the chunk before it."""
        channel, size = INDEX_HEAD.unpack(self._file.read(start, INDEX_HEAD.size))
        counts = self.chunks[-1].counts
        if counts is None:
            counts = {}
            self.chunks[-1] = replace(self.chunks[-1], counts=counts)
        counts[channel] = size // INDEX_ENTRY

    def _take_message(self, start: int, length: int) -> None:
        """Adds a message outside chunks to the present run, or starts a new run with it."""
        channel, _, log_time, _ = MESSAGE_HEAD.unpack(self._file.read(start, MESSAGE_HEAD.size))
        begin, end = start - RECORD_HEAD.size, start + length
        run = self._loose
        if run is not None and end - run.offset <= LOOSE_RUN_BYTES:
            size, first, last = end - run.offset, min(run.start_ns, log_time), max(run.end_ns, log_time)
            counts = {} if run.counts is None else run.counts
            counts[channel] = counts.get(channel, 0) + 1
            self._loose = replace(run, stored=size, unpacked=size, start_ns=first, end_ns=last, counts=counts)
            return
        self._end_loose_run()
        self._loose = Chunk(begin, end - begin, "", end - begin, 0, log_time, log_time, {channel: 1})

    def _end_loose_run(self) -> None:
        if self._loose is not None:
            self.chunks.append(self._loose)
        self._loose = None

    def _doubt_last_index(self) -> None:
        """Drops the index of the last chunk before a cut, because it may be incomplete."""
        if self.chunks and self._loose is None:
            self.chunks[-1] = replace(self.chunks[-1], counts=None)


def open_mcap(file: BagFile, limits: BagLimits, losses: Losses) -> ChunkedStorage:
    """Opens an MCAP file as far as it can be read; what is lost is added to `losses`."""
    name = file.path.name
    declarations = McapDeclarations()
    summary = _summary_if_sound(file, declarations, limits, losses)
    walk = McapWalk(file, declarations)
    stop = walk.follow(len(MCAP_MAGIC))
    if summary is not None:
        stop = _gone_on(walk, stop, summary, name, losses)
    known = summary is not None and summary.counted is not None and summary.counted[0] <= len(declarations.channels)
    count = not known or any(chunk.counts is not None for chunk in walk.chunks)
    chunks = [_surveyed(file, chunk, declarations, limits, count, losses) for chunk in walk.chunks]
    _compare(chunks, stop, summary, file, losses)

    def parse(data: bytes, topics: Collection[str] | None) -> ParsedChunk:
        return parse_chunk(data, topics, declarations)

    counts = summary.counts if summary else None
    return ChunkedStorage(file, chunks, declarations, parse, counts, limits, losses)


def _summary_if_sound(file: BagFile, declarations: McapDeclarations, limits: BagLimits, losses: Losses) -> McapSummary | None:
    try:
        return read_summary(file, declarations, limits)
    except DamagedBagError as error:
        name = file.path.name
        losses.say((name, "index"), f"{name}: the index at its end is damaged and was not used: {error}")
        return None


def _gone_on(walk: McapWalk, stop: Stop, summary: McapSummary, name: str, losses: Losses) -> Stop:
    """Continues after damage, from each chunk that the index names and that was not found yet."""
    for offset in summary.chunk_offsets:
        if offset in walk.heads:
            continue
        before, stop = stop, walk.follow(offset)
        if offset in walk.heads:
            why = (
                f"byte {before.offset} is damaged ({before.why})" if before.why else f"records before byte {offset} are damaged"
            )
            losses.say((name, "gap", offset), f"{name}: {why}; read on at byte {offset}, where the index names a chunk")
    return stop


def _surveyed(
    file: BagFile, chunk: Chunk, declarations: McapDeclarations, limits: BagLimits, count: bool, losses: Losses
) -> Chunk:
    """The chunk with its channels and, if `count`, its numbers of messages; it is unpacked for them if necessary."""
    uncounted = chunk.counts is None and count
    if not uncounted and all(number in declarations.channels for number in chunk.counts or {}):
        return chunk
    try:
        found = parse_chunk(chunk_data(file, chunk, limits), None if uncounted else (), declarations)
    except DamagedBagError as error:
        say_damaged(losses, file.path.name, chunk, str(error))
        return chunk
    if not uncounted:
        return chunk
    numbers = {channel: number for number, channel in declarations.channels.items()}
    return replace(chunk, counts=Counter(numbers[message.channel] for message in found.messages))


def _compare(chunks: Sequence[Chunk], stop: Stop, summary: McapSummary | None, file: BagFile, losses: Losses) -> None:
    """Reports where the file is cut, and a number of messages that differs from the index."""
    name = file.path.name
    held = sum(sum((chunk.counts or {}).values()) for chunk in chunks)
    if stop.why:
        before = f"before it are {len(chunks)} chunks with {held} messages"
        losses.say((name, "cut"), f"{name}: cut short at byte {stop.offset} of {file.size}: {stop.why}; {before}")
    counted = all(chunk.counts is not None for chunk in chunks)
    if summary is not None and summary.total is not None and counted and held != summary.total:
        losses.say((name, "total"), f"{name}: its index counts {summary.total} messages, its chunks hold {held}")
