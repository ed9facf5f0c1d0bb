"""ROS 1 bags in, whole or damaged: TagSLAM records them still.

As for MCAP, the records are followed from the front. The index entries behind each chunk say what it holds; where they are
missing (recording killed) the chunk is unpacked once to see. The recorder writes the length of a chunk, and the place of the
bag's index, only when they are complete: until then both are zero.
"""

from collections import Counter
from collections.abc import Collection
from dataclasses import replace

import numpy as np

from contact_curation.errors import UnreadableInputError
from contact_curation.storage.bags.chunks import Chunk, ChunkedStorage, Declarations, ParsedChunk, chunk_data
from contact_curation.storage.bags.errors import DamagedBagError, Losses
from contact_curation.storage.bags.file import BagFile
from contact_curation.storage.bags.formats.ros1_records import (
    BAG_HEADER,
    CHUNK,
    CONNECTION,
    INDEX,
    NANOSECONDS,
    ROS1_MAGIC,
    Record,
    declare_connection,
    parse_chunk,
    read_record,
)
from contact_curation.storage.bags.limits import BagLimits

UNTIL_THE_END = 1 << 32
"""Unpacked size of a chunk whose length was never written: whatever is there."""
ENTRY = np.dtype([("seconds", "<u4"), ("nanoseconds", "<u4"), ("offset", "<u4")])
"""One index entry: a message's time and where it lies in its chunk."""


def open_ros1(file: BagFile, limits: BagLimits, losses: Losses) -> ChunkedStorage:
    """What can be read of the ROS 1 bag `file`; what cannot is said to `losses`.

    Raises:
        UnreadableInputError: the bag is encrypted.
    """
    declarations = Declarations()
    walk = _Ros1Walk(file, declarations)
    why = walk.follow()
    chunks = [_surveyed(file, chunk, declarations, limits) for chunk in walk.chunks]
    if why:
        held = sum(sum((chunk.counts or {}).values()) for chunk in chunks)
        before = f"before it are {len(chunks)} chunks with {held} messages"
        line = f"{file.path.name}: cut short at byte {walk.offset} of {file.size}: {why}; {before}"
        losses.say((file.path.name, "cut"), line)

    def parse(data: bytes, topics: Collection[str] | None) -> ParsedChunk:
        return parse_chunk(data, topics, declarations)

    return ChunkedStorage(file, chunks, declarations, parse, None, limits, losses)


class _Ros1Walk:
    """Follows the records of a bag; `offset` is where it has got to."""

    def __init__(self, file: BagFile, declarations: Declarations) -> None:
        self._file = file
        self._declarations = declarations
        self.offset = len(ROS1_MAGIC)
        self.chunks: list[Chunk] = []
        self._finished = True

    def follow(self) -> str:
        """Goes to the end; returns why it could not, or nothing."""
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
            raise UnreadableInputError(self._file.path, "is encrypted")
        self._finished = record.number(b"index_pos", "<Q") != 0

    def _take_chunk(self, record: Record, held: int) -> None:
        """A chunk, or what the file holds of it."""
        unpacked, whole = record.number(b"size"), held == record.size
        unfinished = record.size == 0 and not self._finished
        if unfinished:
            held, unpacked, whole = self._file.size - record.data_at, UNTIL_THE_END, False
        self.chunks.append(Chunk(record.data_at, held, record.text(b"compression"), unpacked, 0, 0, 0, None, whole))
        if unfinished:
            raise DamagedBagError("the recording was not finished, nor was its last chunk")

    def _take_index(self, record: Record) -> None:
        """Times and number of the messages that one connection has in the chunk before."""
        data = self._file.read(record.data_at, record.size)
        entries = np.frombuffer(data[: len(data) // ENTRY.itemsize * ENTRY.itemsize], ENTRY)
        if not entries.size:
            return
        times = entries["seconds"].astype(np.int64) * NANOSECONDS + entries["nanoseconds"]
        chunk = self.chunks[-1]
        first, last = int(times.min()), int(times.max())
        if chunk.counts is not None:
            first, last = min(first, chunk.start_ns), max(last, chunk.end_ns)
        counts = {**(chunk.counts or {}), record.number(b"conn"): int(entries.size)}
        self.chunks[-1] = replace(chunk, start_ns=first, end_ns=last, counts=counts)


def _surveyed(file: BagFile, chunk: Chunk, declarations: Declarations, limits: BagLimits) -> Chunk:
    """The chunk, unpacked once if there is no index behind it or it has connections declared nowhere else."""
    uncounted = chunk.counts is None
    if not uncounted and all(number in declarations.channels for number in chunk.counts or {}):
        return chunk
    try:
        found = parse_chunk(chunk_data(file, chunk, limits), None if uncounted else (), declarations).messages
    except DamagedBagError:
        return chunk  # said when its messages are asked for
    if not (uncounted and found):
        return chunk
    times = [message.log_time_ns for message in found]
    numbers = {channel: number for number, channel in declarations.channels.items()}
    counts = Counter(numbers[message.channel] for message in found)
    return replace(chunk, start_ns=min(times), end_ns=max(times), counts=counts)
