"""Reads bags of any format; damaged ones as far as possible, with a report of what was lost.

A message passes these steps: bytes of a file (`bags.file`), records (`bags.formats`, chosen by the first bytes, not by the
name), merging in order of log time (here), decoding to an object (`bags.decoding`), and the pose (`inputs.pose_messages`).
"""

import hashlib
import heapq
from codecs import BOM_UTF8
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack
from functools import cached_property
from itertools import chain, pairwise
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self

from contact_curation.errors import MissingTopicError, UnreadableInputError
from contact_curation.files import temporary_folder
from contact_curation.storage.addresses import Address
from contact_curation.storage.bags.decoding import MessageConverter, Reading
from contact_curation.storage.bags.file import ZSTD_MAGIC, BagFile, BagLimits, DamagedBagError, Losses, file_sha256, unpack_file
from contact_curation.storage.bags.folder import compare, storage_files
from contact_curation.storage.bags.formats.mcap import open_mcap
from contact_curation.storage.bags.formats.mcap_at_address import open_mcap_at_address
from contact_curation.storage.bags.formats.mcap_records import MCAP_MAGIC, read_notes
from contact_curation.storage.bags.formats.ros1 import ROS1_MAGIC, open_ros1
from contact_curation.storage.bags.formats.sqlite import SQLITE_MAGIC, SqliteStorage, stored_parts
from contact_curation.storage.bags.records import BagMessage, Channel, OfferedQos, RawMessage, StoredMessage, TopicInfo

AS_PARTS = "they are read as parts of one recording"

OVERLAP = 0.1
"""Share of the shorter file's time: parts of a recording overlap by less."""

OF_ALL = frozenset({"/tf", "/tf_static", "/rosout", "/clock", "/parameter_events", "/diagnostics"})
"""Topics that several recorders of one session may have recorded each."""

LONGEST_MAGIC = max(len(magic) for magic in (MCAP_MAGIC, ROS1_MAGIC, SQLITE_MAGIC, ZSTD_MAGIC))
KINDS = "an MCAP file, a rosbag2 database (.db3) or a ROS 1 bag (version 2.0)"


class BagStorage(Protocol):
    """Interface of a storage file for the reader."""

    @property
    def name(self) -> str:
        """Name of the file."""

    @property
    def channels(self) -> tuple[Channel, ...]:
        """The channels that have been declared so far."""

    @property
    def extent_ns(self) -> tuple[int, int]:
        """First and last log time, as declared [ns]."""

    def counts(self) -> Mapping[Channel, int] | None:
        """Messages per channel; None if they are only known after reading everything."""

    def runs(self, topics: Collection[str] | None) -> Iterator[list[StoredMessage]]:
        """Messages of `topics` (None: all) in order of log time, in lists."""

    def close(self) -> None:
        """Closes the file."""


def open_storage(path: Path, limits: BagLimits, losses: Losses, stack: ExitStack) -> BagStorage:
    """Opens a storage file; `stack` closes it.

    A file on a server is copied to a temporary file first, unless it is MCAP with a complete index.

    Raises:
        UnreadableInputError: the file cannot be opened, or has none of the supported formats.
    """
    file = BagFile(path)
    stack.callback(file.close)
    if isinstance(path, Address):
        indexed = open_mcap_at_address(file, limits, losses)
        return indexed or open_storage(_copied(path, limits, stack), limits, losses, stack)
    head = file.read(0, min(LONGEST_MAGIC, file.size))
    if head.startswith(ZSTD_MAGIC):
        return open_storage(_unpacked(path, limits, losses, stack), limits, losses, stack)
    storage = _opened(file, head, limits, losses)
    stack.callback(storage.close)
    return storage


def merged(storages: Sequence[BagStorage], topics: Collection[str] | None) -> Iterator[StoredMessage]:
    """Messages of several files in order of log time; only files whose times overlap are read at the same time."""
    return chain.from_iterable(merged_runs(storages, topics))


def merged_runs(storages: Sequence[BagStorage], topics: Collection[str] | None) -> Iterator[list[StoredMessage]]:
    """The same in lists, of one message each where several files are read at the same time."""
    for together in _overlapping(storages):
        if len(together) == 1:
            yield from together[0].runs(topics)
        else:
            by_file = (chain.from_iterable(storage.runs(topics)) for storage in together)
            yield from ([message] for message in heapq.merge(*by_file, key=_log_time))


def _overlapping(storages: Sequence[BagStorage]) -> list[list[BagStorage]]:
    """Groups of files with overlapping times, in order of time."""
    runs: list[list[BagStorage]] = []
    end = -1
    for storage in sorted(storages, key=lambda storage: storage.extent_ns[0]):
        first, last = storage.extent_ns
        if not runs or first > end:
            runs.append([])
        runs[-1].append(storage)
        end = max(end, last)
    return runs


def _log_time(message: StoredMessage) -> int:
    return message.log_time_ns


def _opened(file: BagFile, head: bytes, limits: BagLimits, losses: Losses) -> BagStorage:
    if head.startswith(MCAP_MAGIC):
        return open_mcap(file, limits, losses)
    if head.startswith(SQLITE_MAGIC):
        return SqliteStorage(file, losses)
    if head.startswith(ROS1_MAGIC):
        return open_ros1(file, limits, losses)
    if not head:
        raise UnreadableInputError(file.path, f"is empty; expected {KINDS}")
    table = "; poses in a file of text become a bag by `import poses`" if _is_text(head) else ""
    raise UnreadableInputError(file.path, f"begins with {head!r}; expected {KINDS}{table}")


def _is_text(head: bytes) -> bool:
    return all(byte in b"\t\r\n" or 0x20 <= byte < 0x7F for byte in head.removeprefix(BOM_UTF8))


def _unpacked(path: Path, limits: BagLimits, losses: Losses, stack: ExitStack) -> Path:
    """A temporary copy of a file that rosbag2 compressed as a whole."""
    target = stack.enter_context(temporary_folder("bag")) / path.stem
    try:
        unpack_file(path, target, limits.unpacked_file_bytes)
    except DamagedBagError as error:
        losses.say((path.name, "compressed"), f"{path.name}: {error}")
    return target


def _copied(address: Address, limits: BagLimits, stack: ExitStack) -> Path:
    if address.stat().st_size > limits.unpacked_file_bytes:
        raise UnreadableInputError(address, f"holds more than {limits.unpacked_file_bytes} bytes, expected at most that")
    target = stack.enter_context(temporary_folder("bag")) / address.name
    address.download(target)
    return target


def recorded_notes(path: Path) -> dict[str, dict[str, str]]:
    """The notes of an MCAP file by their names; none for other files, or without an intact index."""
    file = BagFile(path)
    try:
        return read_notes(file, BagLimits())
    finally:
        file.close()


class BagReader:
    """Reads one bag; use it as a context manager.

    Accepts an MCAP file, a rosbag2 folder (MCAP or sqlite3, one or several files, with or without metadata.yaml), one of its
    storage files, or a ROS 1 bag. The bag is never written to. One chunk or one row is in memory at a time.

    Args:
        path: file or folder.
        limits: bounds on memory and disk space.

    Raises:
        UnreadableInputError: `path` is not a bag, or may not be read. A damaged bag is read as far as possible.
    """

    def __init__(self, path: Path, limits: BagLimits | None = None) -> None:
        self.path = path
        limits = limits or BagLimits()
        self._losses = Losses()
        self._converter = MessageConverter(limits, self._losses)
        with ExitStack() as stack:
            self._folder = storage_files(self.path, self._losses)
            self._storages = self._opened_files(limits, stack)
            self._stack = stack.pop_all()
        if self._folder.metadata is not None:
            compare(self._folder.metadata, self._counts(), self._channels, self._losses)

    def _opened_files(self, limits: BagLimits, stack: ExitStack) -> list[BagStorage]:
        """Opens the storage files. Of several files those that cannot be read are reported and left out.

        Raises:
            UnreadableInputError: none of them can be read.
        """
        storages: list[BagStorage] = []
        errors: list[UnreadableInputError] = []
        for file in self._folder.files:
            try:
                storages.append(open_storage(file, limits, self._losses, stack))
            except UnreadableInputError as error:
                errors.append(error)
        if not storages:
            raise errors[0]
        for unread in errors:
            self._losses.say((unread.path.name, "file"), f"{unread}: left out, the other files of the bag are read")
        self._say_overlaps(storages)
        return storages

    def _say_overlaps(self, storages: Sequence[BagStorage]) -> None:
        """Reports files that record the same topics at the same time, as parts of one recording do not."""
        for one, other in pairwise(sorted(storages, key=lambda storage: storage.extent_ns[0])):
            (first, end), (begin, last) = one.extent_ns, other.extent_ns
            shared = {each.topic for each in one.channels} & {each.topic for each in other.channels}
            if shared - OF_ALL and min(end, last) - begin > OVERLAP * min(end - first, last - begin):
                both = f"{one.name} and {other.name} have {min(shared - OF_ALL)} at the same time"
                self._losses.say(
                    (one.name, other.name, "overlap"),
                    f"{both}: {AS_PARTS}; if they are two, give them one by one",
                )

    @cached_property
    def topics(self) -> tuple[TopicInfo, ...]:
        """The topics, sorted by name; a topic with several types has one entry per type."""
        counts = self._counts()
        totals: dict[tuple[str, str], int] = {}
        for channel in self._channels:
            key = (channel.topic, channel.type)
            totals[key] = totals.get(key, 0) + (0 if counts is None else counts[channel])
        return tuple(TopicInfo(*key, None if counts is None else total) for key, total in sorted(totals.items()))

    def messages(self, topics: Collection[str] | None = None) -> Iterator[BagMessage]:
        """Decoded messages in order of log time; messages that cannot be decoded are left out and reported in `losses`.

        Args:
            topics: topics to read; None for all.

        Raises:
            MissingTopicError: the bag lacks one of `topics`.
        """
        self._check_topics(topics)
        return self._converter.reading().decoded(merged(self._storages, topics))

    def runs(self, topics: Collection[str] | None = None) -> tuple[Reading, Iterator[list[StoredMessage]]]:
        """The same messages as they are stored, in lists, and their decoder.

        Args:
            topics: which; None for all.

        Raises:
            MissingTopicError: the bag lacks one of `topics`.
        """
        self._check_topics(topics)
        return self._converter.reading(), merged_runs(self._storages, topics)

    def raw_messages(self, topics: Collection[str] | None = None) -> Iterator[RawMessage]:
        """Messages as CDR bytes with their schema, in order of log time, also those of types that cannot be decoded.

        Args:
            topics: topics to read; None for all.

        Raises:
            MissingTopicError: the bag lacks one of `topics`.
        """
        self._check_topics(topics)
        return self._converter.raw(merged(self._storages, topics))

    def qos(self, topic: str) -> OfferedQos:
        """Quality of service of the topic's publishers; the defaults of `OfferedQos` if the bag does not contain it.

        Raises:
            MissingTopicError: the bag lacks the topic.
        """
        self._check_topics([topic])
        offered = [channel.qos for channel in self._channels if channel.topic == topic and channel.qos is not None]
        if not offered and self._folder.metadata is not None:
            offered = [known.qos for known in self._folder.metadata.topics if known.name == topic and known.qos is not None]
        if not offered:
            return OfferedQos()
        return OfferedQos(
            latched=any(qos.latched for qos in offered),
            reliable=any(qos.reliable for qos in offered),
            depth=max(qos.depth for qos in offered),
        )

    def note(self, name: str) -> dict[str, str]:
        """A note about the recording that `BagWriter.note` wrote; empty if there is none, or it was cut off."""
        return dict(self.notes.get(name, {}))

    @cached_property
    def notes(self) -> dict[str, dict[str, str]]:
        """All notes about the recording by their names, including those of rosbag2."""
        notes: dict[str, dict[str, str]] = {}
        for file in self._folder.files:
            for name, values in recorded_notes(file).items():
                notes.setdefault(name, {}).update(values)
        return notes

    @property
    def losses(self) -> tuple[str, ...]:
        """What was lost, and contradictions within the bag, one line each; complete after the messages were read."""
        return self._losses.lines

    @cached_property
    def sha256(self) -> str:
        """SHA-256 of the storage file; for several files that of sha256sum's output (`<sha256>  <name>` per line)."""
        parts = [part for file in self._folder.files for part in stored_parts(file)]
        digests = [(file_sha256(part), part.name) for part in parts]
        if len(digests) == 1:
            return digests[0][0]
        listed = "".join(f"{digest}  {name}\n" for digest, name in digests)
        return hashlib.sha256(listed.encode(errors="surrogateescape")).hexdigest()

    def close(self) -> None:
        """Closes the files."""
        self._stack.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    @property
    def _channels(self) -> list[Channel]:
        return [channel for storage in self._storages for channel in storage.channels]

    def _counts(self) -> dict[Channel, int] | None:
        counts: dict[Channel, int] = {}
        for storage in self._storages:
            known = storage.counts()
            if known is None:
                return None
            counts.update(known)
        return counts

    def _check_topics(self, topics: Collection[str] | None) -> None:
        available = sorted({channel.topic for channel in self._channels})
        missing = sorted(set(topics or ()) - set(available))
        if missing:
            raise MissingTopicError(self.path, ", ".join(missing), available)
