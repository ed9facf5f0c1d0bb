"""One storage file, whatever its format: told by its first bytes, not by its name."""

import heapq
import tempfile
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Protocol

from contact_curation.errors import UnreadableInputError
from contact_curation.storage.bags.errors import DamagedBagError, Losses
from contact_curation.storage.bags.file import BagFile
from contact_curation.storage.bags.formats.mcap import open_mcap
from contact_curation.storage.bags.formats.mcap_records import MCAP_MAGIC
from contact_curation.storage.bags.formats.ros1 import open_ros1
from contact_curation.storage.bags.formats.ros1_records import ROS1_MAGIC
from contact_curation.storage.bags.formats.sqlite import SQLITE_MAGIC, SqliteStorage
from contact_curation.storage.bags.limits import BagLimits
from contact_curation.storage.bags.records import Channel, StoredMessage
from contact_curation.storage.bags.unpacking import ZSTD_MAGIC, unpack_file

LONGEST_MAGIC = max(len(magic) for magic in (MCAP_MAGIC, ROS1_MAGIC, SQLITE_MAGIC, ZSTD_MAGIC))
KINDS = "an MCAP file, a rosbag2 database (.db3) or a ROS 1 bag (version 2.0)"


class BagStorage(Protocol):
    """What the reader needs of a storage file."""

    @property
    def name(self) -> str:
        """Of the file."""

    @property
    def channels(self) -> tuple[Channel, ...]:
        """As declared so far."""

    @property
    def extent_ns(self) -> tuple[int, int]:
        """First and last log time, as declared."""

    def counts(self) -> Mapping[Channel, int] | None:
        """Messages per channel; None when only reading everything would tell."""

    def messages(self, topics: Collection[str] | None) -> Iterator[StoredMessage]:
        """Messages of `topics` (None: all) in order of log time."""

    def close(self) -> None:
        """Lets go of the file."""


def open_storage(path: Path, limits: BagLimits, losses: Losses, stack: ExitStack) -> BagStorage:
    """Opens a storage file; `stack` closes it.

    Raises:
        UnreadableInputError: it cannot be opened, or it is none of the kinds that are understood.
    """
    file = BagFile(path)
    stack.callback(file.close)
    head = file.read(0, min(LONGEST_MAGIC, file.size))
    if head.startswith(ZSTD_MAGIC):
        return open_storage(_unpacked(path, limits, losses, stack), limits, losses, stack)
    storage = _opened(file, head, limits, losses)
    stack.callback(storage.close)
    return storage


def merged(storages: Sequence[BagStorage], topics: Collection[str] | None) -> Iterator[StoredMessage]:
    """Messages of several files in order of log time; only files whose times overlap are read side by side."""
    for together in _overlapping(storages):
        yield from heapq.merge(*(storage.messages(topics) for storage in together), key=_log_time)


def _overlapping(storages: Sequence[BagStorage]) -> list[list[BagStorage]]:
    """Runs of files, each after the one before."""
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
    raise UnreadableInputError(file.path, f"begins with {head!r}; expected {KINDS}")


def _unpacked(path: Path, limits: BagLimits, losses: Losses, stack: ExitStack) -> Path:
    """A temporary copy of a file that rosbag2 compressed as a whole."""
    target = Path(stack.enter_context(tempfile.TemporaryDirectory())) / path.stem
    try:
        unpack_file(path, target, limits.unpacked_file_bytes)
    except DamagedBagError as error:
        losses.say((path.name, "compressed"), f"{path.name}: {error}")
    return target
