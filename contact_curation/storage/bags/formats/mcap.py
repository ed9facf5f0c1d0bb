"""MCAP in, whole or damaged (https://mcap.dev/spec).

A reader that trusts the index at the end of the file loses everything when a recording is killed. Here the records of the
file are followed from the front, reading only their heads: that gives the chunks that are really there, and where the file is
cut. The index is used for what it adds: the channels without unpacking any chunk, and where to go on behind damage.
"""

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import replace

from contact_curation.storage.bags.chunks import Chunk, ChunkedStorage, ParsedChunk, chunk_data
from contact_curation.storage.bags.errors import DamagedBagError, Losses
from contact_curation.storage.bags.file import BagFile
from contact_curation.storage.bags.formats.mcap_records import MCAP_MAGIC, McapDeclarations, parse_chunk
from contact_curation.storage.bags.formats.mcap_summary import McapSummary, read_summary
from contact_curation.storage.bags.formats.mcap_walk import McapWalk, Stop
from contact_curation.storage.bags.limits import BagLimits


def open_mcap(file: BagFile, limits: BagLimits, losses: Losses) -> ChunkedStorage:
    """What can be read of the MCAP file `file`; what cannot is said to `losses`."""
    name = file.path.name
    declarations = McapDeclarations()
    summary = _summary_if_sound(file, declarations, limits, losses)
    walk = McapWalk(file, declarations)
    stop = walk.follow(len(MCAP_MAGIC))
    if summary is not None:
        stop = _gone_on(walk, stop, summary, name, losses)
    count = summary is None or any(chunk.counts is not None for chunk in walk.chunks)
    chunks = [_surveyed(file, chunk, declarations, limits, count) for chunk in walk.chunks]
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
    """Follows the records again from every chunk that the index names and damage kept from being met."""
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


def _surveyed(file: BagFile, chunk: Chunk, declarations: McapDeclarations, limits: BagLimits, count: bool) -> Chunk:
    """The chunk, unpacked once if only that tells its channels and, when those count, how many messages it has."""
    uncounted = chunk.counts is None and count
    if not uncounted and all(number in declarations.channels for number in chunk.counts or {}):
        return chunk
    try:
        found = parse_chunk(chunk_data(file, chunk, limits), None if uncounted else (), declarations)
    except DamagedBagError:
        return chunk  # said when its messages are asked for
    if not uncounted:
        return chunk
    numbers = {channel: number for number, channel in declarations.channels.items()}
    return replace(chunk, counts=Counter(numbers[message.channel] for message in found.messages))


def _compare(chunks: Sequence[Chunk], stop: Stop, summary: McapSummary | None, file: BagFile, losses: Losses) -> None:
    """Says where the file is cut, and when it holds another number of messages than its index says."""
    name = file.path.name
    held = sum(sum((chunk.counts or {}).values()) for chunk in chunks)
    if stop.why:
        before = f"before it are {len(chunks)} chunks with {held} messages"
        losses.say((name, "cut"), f"{name}: cut short at byte {stop.offset} of {file.size}: {stop.why}; {before}")
    counted = all(chunk.counts is not None for chunk in chunks)
    if summary is not None and summary.total is not None and counted and held != summary.total:
        losses.say((name, "total"), f"{name}: its index counts {summary.total} messages, its chunks hold {held}")
