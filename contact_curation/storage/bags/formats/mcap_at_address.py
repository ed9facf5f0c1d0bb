"""Reads MCAP files on a server: the index at the end, then only the chunks with requested topics.

On a disk the records are followed from the front (`formats.mcap`); over a network this would transfer the whole file. Here a
complete index is trusted, and a chunk that differs from it is lost like a damaged one. A file without a complete index is
refused here; the caller then reads a copy of the whole file.
"""

from collections.abc import Collection, Iterator

from mcap.opcode import Opcode
from mcap.records import ChunkIndex

from contact_curation.storage.addresses import Address
from contact_curation.storage.bags.file import BagFile, BagLimits, DamagedBagError, Losses
from contact_curation.storage.bags.formats.chunks import Chunk, ChunkedStorage, ParsedChunk
from contact_curation.storage.bags.formats.mcap import chunk_at
from contact_curation.storage.bags.formats.mcap_records import (
    RECORD_HEAD,
    McapDeclarations,
    McapSummary,
    parse_chunk,
    read_summary,
)
from contact_curation.storage.bags.records import StoredMessage

DATA_END_BYTES = RECORD_HEAD.size + 4
"""Size of the record between the messages and the index."""


def open_mcap_at_address(file: BagFile, limits: BagLimits, losses: Losses) -> ChunkedStorage | None:
    """Opens an MCAP file on a server; None if it is no MCAP file, or its index is not complete."""
    declarations = McapDeclarations()
    try:
        summary = read_summary(file, declarations, limits)
    except DamagedBagError:
        return None
    if summary is None or summary.counted != (len(declarations.channels), len(summary.chunks)):
        return None
    named = {channel for index in summary.chunks for channel in index.message_index_offsets}
    if not summary.chunks or not named <= set(declarations.channels) or _has_messages_between(file, summary):
        return None
    return _IndexedMcap(file, summary, declarations, limits, losses)


def _has_messages_between(file: BagFile, summary: McapSummary) -> bool:
    """Whether messages are between the chunks of the index or behind them, or this cannot be read.

    Before the first chunk this would take one more request; messages there are missed when all have been counted.
    """
    ends = {
        one.chunk_start_offset: one.chunk_start_offset + one.chunk_length + one.message_index_length for one in summary.chunks
    }
    offset = min(ends)
    try:
        while offset < summary.start - DATA_END_BYTES:
            if offset in ends:
                offset = ends.pop(offset)
                continue
            opcode, length = RECORD_HEAD.unpack(file.read(offset, RECORD_HEAD.size))
            if opcode in (Opcode.MESSAGE, Opcode.CHUNK):
                return True
            offset += RECORD_HEAD.size + length
    except DamagedBagError:
        return True
    return False


class _IndexedMcap(ChunkedStorage):
    """Messages of a file; chunks without requested channels are not read. Here a `Chunk` includes the head of its record."""

    def __init__(
        self, file: BagFile, summary: McapSummary, declarations: McapDeclarations, limits: BagLimits, losses: Losses
    ) -> None:
        def parse(data: bytes, topics: Collection[str] | None) -> ParsedChunk:
            return parse_chunk(data, topics, declarations)

        chunks = [_record_of(index) for index in summary.chunks]
        super().__init__(file, chunks, declarations, parse, summary.counts, limits, losses)
        self._damaged = False
        self._channels = {index.chunk_start_offset: frozenset(index.message_index_offsets) for index in summary.chunks}

    def runs(self, topics: Collection[str] | None) -> Iterator[list[StoredMessage]]:
        """Messages of `topics` (None: all) in order of log time; their chunks are read with few requests."""
        held = [chunk for chunk in self._chunks if self._holds(chunk, topics)]
        if isinstance(self._file.path, Address):
            self._file.path.plan((chunk.offset, chunk.offset + chunk.stored) for chunk in held)
        read, self._damaged = 0, False
        for run in super().runs(topics):
            read += len(run)
            yield run
        counts, wanted = self._declared_counts or {}, self._declarations.wanted(topics)
        counted = sum(counts.get(number, 0) for number, channel in wanted.items() if channel is not None)
        if read < counted and not self._damaged:
            line = f"{self.name}: its index counts {counted} messages, its chunks hold {read}"
            self._losses.say((self.name, "total"), line)

    def _load(self, chunk: Chunk, topics: Collection[str] | None) -> list[StoredMessage]:
        if not self._holds(chunk, topics):
            return []
        try:
            return super()._load(chunk_at(self._file, chunk.offset), topics)
        except DamagedBagError as error:
            self._say_damaged(chunk, str(error), "its messages are lost")
            return []

    def _say_damaged(self, chunk: Chunk, why: str, what: str) -> None:
        self._damaged = True
        super()._say_damaged(chunk, why, what)

    def _holds(self, chunk: Chunk, topics: Collection[str] | None) -> bool:
        """Whether a chunk may contain requested messages; without channels in the index it may."""
        channels, wanted = self._channels[chunk.offset], self._declarations.wanted(topics)
        return not channels or any(wanted.get(number) for number in channels)


def _record_of(index: ChunkIndex) -> Chunk:
    """The record of a chunk, as the index describes it."""
    offset, stored = index.chunk_start_offset, index.chunk_length
    unpacked, first, last = index.uncompressed_size, index.message_start_time, index.message_end_time
    return Chunk(offset, stored, index.compression, unpacked, 0, first, last, None)
