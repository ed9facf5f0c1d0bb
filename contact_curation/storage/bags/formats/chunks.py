"""Reads bags made of chunks (MCAP, ROS 1): one chunk in memory at a time, messages in order of log time, damage skipped."""

import zlib
from bisect import bisect_left
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from operator import attrgetter

from contact_curation.storage.bags.file import BagFile, BagLimits, DamagedBagError, Losses, unpack, unpack_some
from contact_curation.storage.bags.records import Channel, StoredMessage


@dataclass(frozen=True)
class Chunk:
    """The position of a chunk in a file, and what the file says about it.

    Attributes:
        offset: offset of its stored bytes in the file.
        stored: number of stored bytes.
        compression: name of the compression, empty for none.
        unpacked: declared number of bytes after unpacking.
        crc: CRC-32 of the unpacked bytes; 0 if there is none.
        start_ns: earliest log time in it [ns].
        end_ns: latest log time in it [ns].
        counts: messages per channel id, from the index after it; None if there is no index.
        whole: False if the file ends within it.
    """

    offset: int
    stored: int
    compression: str
    unpacked: int
    crc: int
    start_ns: int
    end_ns: int
    counts: dict[int, int] | None
    whole: bool = True


@dataclass(frozen=True)
class ParsedChunk:
    """Records of a chunk.

    Attributes:
        messages: messages of the requested channels, in the order of the file.
        undeclared: number of messages whose channel is declared nowhere.
        damage: why the rest could not be parsed; empty if everything was.
    """

    messages: list[StoredMessage]
    undeclared: int = 0
    damage: str = ""


class Declarations:
    """The channels declared so far, by id; chunks may declare more while they are parsed."""

    def __init__(self) -> None:
        self.channels: dict[int, Channel] = {}

    def wanted(self, topics: Collection[str] | None) -> dict[int, Channel | None]:
        """The channels by id; None for channels whose topic is not in `topics` (None for all topics)."""
        wanted: dict[int, Channel | None] = {}
        self.add_wanted(topics, wanted)
        return wanted

    def add_wanted(self, topics: Collection[str] | None, wanted: dict[int, Channel | None]) -> None:
        """Adds to what `wanted` returned the channels that were declared since."""
        for number, channel in islice(reversed(self.channels.items()), len(self.channels) - len(wanted)):
            wanted[number] = channel if topics is None or channel.topic in topics else None


ParseChunk = Callable[[bytes, Collection[str] | None], ParsedChunk]


class ChunkedStorage:
    """Messages of one file of chunks.

    Args:
        file: the open file.
        chunks: its chunks in any order.
        declarations: the channels that are known without unpacking chunks.
        parse: parses an unpacked chunk and declares its channels.
        counts: messages per channel id, used if the chunks do not say.
        limits: bounds of sizes.
        losses: receives reports of damage.
    """

    def __init__(
        self,
        file: BagFile,
        chunks: Sequence[Chunk],
        declarations: Declarations,
        parse: ParseChunk,
        counts: Mapping[int, int] | None,
        limits: BagLimits,
        losses: Losses,
    ) -> None:
        self._file = file
        self._chunks = sorted(chunks, key=lambda chunk: (chunk.start_ns, chunk.offset))
        self._declarations = declarations
        self._parse = parse
        self._declared_counts = counts
        self._limits = limits
        self._losses = losses

    @property
    def name(self) -> str:
        return self._file.path.name

    @property
    def channels(self) -> tuple[Channel, ...]:
        return tuple(self._declarations.channels.values())

    @property
    def extent_ns(self) -> tuple[int, int]:
        """First and last log time [ns]."""
        return min((c.start_ns for c in self._chunks), default=0), max((c.end_ns for c in self._chunks), default=0)

    def counts(self) -> Mapping[Channel, int] | None:
        """Messages per channel; None if they are only known after reading everything."""
        known = [chunk.counts for chunk in self._chunks if chunk.counts is not None]
        by_id: Mapping[int, int] | None = self._declared_counts
        if len(known) == len(self._chunks):
            by_id = sum((Counter(counts) for counts in known), Counter())
        if by_id is None:
            return None
        return {channel: by_id.get(number, 0) for number, channel in self._declarations.channels.items()}

    def runs(self, topics: Collection[str] | None) -> Iterator[list[StoredMessage]]:
        """Messages of `topics` (None: all) in order of log time, then in the order of the file; a list per chunk."""
        held: list[StoredMessage] = []
        for index, chunk in enumerate(self._chunks):
            held += self._load(chunk, topics)
            held.sort(key=_log_time)
            following = self._chunks[index + 1].start_ns if index + 1 < len(self._chunks) else None
            ready = len(held) if following is None else bisect_left(held, following, key=_log_time)
            ready = max(ready, self._overflow(held))
            run, held = held[:ready], held[ready:]
            yield run

    def close(self) -> None:
        self._file.close()

    def _load(self, chunk: Chunk, topics: Collection[str] | None) -> list[StoredMessage]:
        """The messages of a chunk, up to its first damage."""
        try:
            parsed = self._parse(chunk_data(self._file, chunk, self._limits), topics)
        except DamagedBagError as error:
            self._say_damaged(chunk, str(error), "its messages are lost")
            return []
        if parsed.damage:
            self._say_damaged(chunk, parsed.damage, "its messages from there on are lost")
        if parsed.undeclared:
            line = f"{parsed.undeclared} messages are of no declared channel and were left out"
            self._losses.say((self.name, chunk.offset, "undeclared"), f"{self.name}: chunk at byte {chunk.offset}: {line}")
        return parsed.messages

    def _say_damaged(self, chunk: Chunk, why: str, what: str) -> None:
        held = ""
        if chunk.counts is not None:
            per_topic = Counter({self._topic(number): count for number, count in chunk.counts.items()})
            held = f" ({', '.join(f'{count} of {topic}' for topic, count in sorted(per_topic.items()))})"
        say_damaged(self._losses, self.name, chunk, why, f"{what}{held}")

    def _topic(self, number: int) -> str:
        channel = self._declarations.channels.get(number)
        return channel.topic if channel else f"undeclared channel {number}"

    def _overflow(self, held: list[StoredMessage]) -> int:
        """How many messages to yield to stay within the memory bound, although a later chunk may contain earlier ones."""
        if sum(map(len, map(_data, held))) <= self._limits.reorder_bytes:
            return 0
        line = f"log times of chunks overlap by more than {self._limits.reorder_bytes} bytes: messages may come out of order"
        self._losses.say((self.name, "order"), f"{self.name}: {line}")
        return len(held) // 2


def say_damaged(losses: Losses, name: str, chunk: Chunk, why: str, what: str = "its messages are lost") -> None:
    """Reports a chunk of the file `name` that cannot be read; the last report of a chunk counts."""
    where = f"chunk at byte {chunk.offset}, log times {chunk.start_ns} to {chunk.end_ns} ns"
    losses.say((name, chunk.offset), f"{name}: {where}: {why}; {what}")


def chunk_data(file: BagFile, chunk: Chunk, limits: BagLimits) -> bytes:
    """The unpacked bytes of a chunk; if the file ends within it, those that exist.

    Raises:
        DamagedBagError: a size exceeds the limits, or the checksum does not match.
    """
    if chunk.stored > limits.chunk_bytes:
        raise DamagedBagError(f"{chunk.stored} bytes are declared where at most {limits.chunk_bytes} are accepted")
    stored = file.read(chunk.offset, chunk.stored)
    if not chunk.whole:
        return unpack_some(chunk.compression, stored, min(chunk.unpacked, limits.chunk_bytes))
    data = unpack(chunk.compression, stored, chunk.unpacked, limits.chunk_bytes)
    if chunk.crc and zlib.crc32(data) != chunk.crc:
        raise DamagedBagError("the checksum does not match")
    return data


_log_time, _data = attrgetter("log_time_ns"), attrgetter("data")  # of each message: lambdas would take three times as long
