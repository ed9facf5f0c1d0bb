"""Reads an input file safely: within bounds, never beyond its end; damage raises an error.

A damaged part raises `DamagedBagError`. The readers catch it, continue after the damage, and report in `Losses` what was lost.
Every size that a file declares is compared with `BagLimits` before memory is allocated. A compressed frame of a few bytes can
declare any size, and the one-call functions of zstd and lz4 allocate it; so data are unpacked in steps here.
"""

import bz2
import fcntl
import hashlib
import stat
from collections.abc import Callable, Hashable
from dataclasses import dataclass, fields
from pathlib import Path

import lz4.frame  # type: ignore[import-untyped]
import zstandard

from contact_curation.errors import ContactCurationError, InvalidValueError, UnreadableInputError, why_unreadable
from contact_curation.files import lock
from contact_curation.storage.addresses import Address

MEBIBYTE = 1 << 20


@dataclass(frozen=True)
class BagLimits:
    """Bounds on the memory and disk space for reading a bag; far above what recorders write, far below what a machine has.

    Attributes:
        chunk_bytes: largest size of a chunk or record, stored and unpacked [B].
        message_bytes: largest size of one message [B].
        reorder_bytes: largest size of messages held back to bring overlapping chunks into order of log time [B].
        unpacked_file_bytes: largest size of a storage file that is compressed as a whole, on disk [B].
        fixed_array_length: largest length of fixed-size arrays in message definitions, which decoders unroll.
    """

    chunk_bytes: int = 256 * MEBIBYTE
    message_bytes: int = 64 * MEBIBYTE
    reorder_bytes: int = 512 * MEBIBYTE
    unpacked_file_bytes: int = 256 * 1024 * MEBIBYTE
    fixed_array_length: int = 1 << 16

    def __post_init__(self) -> None:
        for field in fields(self):
            if getattr(self, field.name) <= 0:
                raise InvalidValueError(field.name, getattr(self, field.name), "a positive number")


class DamagedBagError(ContactCurationError):
    """A part of a bag cannot be read; the message says why."""


class UndecodableTypeError(ContactCurationError):
    """Messages of a type cannot be decoded; the message says why."""


class Losses:
    """What was lost while reading, one line per cause; reporting a cause again replaces its line."""

    def __init__(self) -> None:
        self._lines: dict[Hashable, str] = {}

    def say(self, cause: Hashable, line: str) -> None:
        self._lines[cause] = " ".join(line.split())

    @property
    def lines(self) -> tuple[str, ...]:
        return tuple(self._lines.values())


READ_AHEAD = 1 << 16
"""Size of a read [bytes]; one read then serves many small records."""


class BagFile:
    """A regular file opened for reading, under a shared advisory lock that keeps `BagWriter` from replacing it.

    Attributes:
        path: path of the file.
        size: size of the file when it was opened [bytes].

    Raises:
        UnreadableInputError: the file does not exist, is not a regular file, or may not be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            if not stat.S_ISREG(path.stat().st_mode):
                raise UnreadableInputError(path, "is not a file")
            self._file = path.open("rb", buffering=READ_AHEAD)
        except OSError as error:
            raise UnreadableInputError(path, f"cannot be opened: {why_unreadable(path, error)}") from error
        self.size = path.stat().st_size
        lock(self._file, fcntl.LOCK_SH)  # where another process writes it, only this protection is missing

    def read(self, offset: int, length: int) -> bytes:
        """Reads `length` bytes from `offset` on.

        Raises:
            DamagedBagError: the file has fewer bytes; this is checked before memory is allocated.
        """
        rest = self.size - offset
        if length > rest:
            raise DamagedBagError(f"{length} bytes are declared at byte {offset}, where the file holds {max(rest, 0)} more")
        try:
            self._file.seek(offset)
            data = self._file.read(length)
        except OSError as error:
            raise DamagedBagError(f"byte {offset} cannot be read: {error.strerror}") from error
        if len(data) < length:
            raise DamagedBagError(f"the file became shorter than {offset + length} bytes while it was read")
        return data

    def close(self) -> None:
        self._file.close()


def file_sha256(path: Path) -> str:
    """SHA-256 of a file's bytes, in hexadecimal; for a file on a server its `fingerprint`."""
    if isinstance(path, Address):
        return path.fingerprint()
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
STEP = 1 << 22
"""Number of bytes that are unpacked at a time."""


def _in_steps(read: Callable[[int], bytes], most: int) -> bytes:
    """Reads at most `most` bytes of a stream; memory grows with the bytes that exist, not with `most`."""
    parts: list[bytes] = []
    while most > 0 and (part := read(min(most, STEP))):
        parts.append(part)
        most -= len(part)
    return b"".join(parts)


def _plain(data: bytes, most: int) -> bytes:
    return data[:most]


def _zstd(data: bytes, most: int) -> bytes:
    with zstandard.ZstdDecompressor().stream_reader(data) as reader:
        return _in_steps(reader.read, most)


def _lz4(data: bytes, most: int) -> bytes:
    unpacker = lz4.frame.LZ4FrameDecompressor()
    rest = iter([data])
    return _in_steps(lambda step: b"" if unpacker.eof else bytes(unpacker.decompress(next(rest, b""), step)), most)


def _bz2(data: bytes, most: int) -> bytes:
    return bz2.BZ2Decompressor().decompress(data, max_length=most)


UNPACKERS: dict[str, Callable[[bytes, int], bytes]] = {"": _plain, "none": _plain, "zstd": _zstd, "lz4": _lz4, "bz2": _bz2}
"""Decompressors by the names that MCAP and ROS 1 bags use."""


def unpack(compression: str, data: bytes, size: int, limit: int) -> bytes:
    """Unpacks `data` to `size` bytes.

    Raises:
        DamagedBagError: `size` is above `limit`, `data` contains another number of bytes, or it is damaged.
    """
    if size > limit:
        raise DamagedBagError(f"{size} bytes are declared where at most {limit} are accepted")
    unpacked = unpack_some(compression, data, size + 1)
    if len(unpacked) != size:
        raise DamagedBagError(f"{size} bytes are declared, {_counted(len(unpacked), size)} are there")
    return unpacked


def unpack_some(compression: str, data: bytes, most: int) -> bytes:
    """Unpacks as much of `data` as possible, at most `most` bytes; `data` may be cut off.

    Raises:
        DamagedBagError: the compression is unknown, or `data` is damaged.
    """
    if compression not in UNPACKERS:
        raise DamagedBagError(f"compression {compression!r} is not one of {sorted(UNPACKERS)}")
    try:
        return UNPACKERS[compression](data, most)
    except (zstandard.ZstdError, RuntimeError, OSError, EOFError, ValueError) as error:
        raise DamagedBagError(f"cannot be decompressed: {error}") from error


def unpack_message(data: bytes, limit: int) -> bytes:
    """Unpacks a message of a bag that was recorded with compression per message (a zstd frame each).

    Raises:
        DamagedBagError: the message is damaged, or larger than `limit`.
    """
    unpacked = unpack_some("zstd", data, limit + 1)
    if len(unpacked) > limit:
        raise DamagedBagError(f"more than {limit} bytes in one message")
    return unpacked


def unpack_file(source: Path, target: Path, limit: int) -> None:
    """Unpacks the zstd file `source` to `target`, up to the first damage.

    Raises:
        DamagedBagError: the source is damaged or has more than `limit` bytes; `target` then contains what came before.
    """
    written = 0
    unpacker = zstandard.ZstdDecompressor()
    with source.open("rb") as packed, target.open("wb") as out, unpacker.stream_reader(packed) as reader:
        try:
            while part := reader.read(STEP):
                written += len(part)
                if written > limit:
                    raise DamagedBagError(f"holds more than {limit} bytes")
                out.write(part)
        except zstandard.ZstdError as error:
            raise DamagedBagError(f"cannot be decompressed beyond byte {written}: {error}") from error


def _counted(found: int, declared: int) -> str:
    return "more" if found > declared else str(found)
