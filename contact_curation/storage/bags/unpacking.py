"""Decompression that never gives more than was asked for.

A compressed frame of a few bytes can declare any size, and the one-call functions of zstd and lz4 allocate what it declares.
"""

import bz2
from collections.abc import Callable
from pathlib import Path

import lz4.frame  # type: ignore[import-untyped]
import zstandard

from contact_curation.storage.bags.errors import DamagedBagError

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
STEP = 1 << 22
"""Bytes unpacked at a time."""


def _in_steps(read: Callable[[int], bytes], most: int) -> bytes:
    """At most `most` bytes of a stream; what is allocated follows what is there, not what is asked for."""
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
"""By the names that MCAP and ROS 1 bags use."""


def unpack(compression: str, data: bytes, size: int, limit: int) -> bytes:
    """The `size` bytes that `data` holds.

    Raises:
        DamagedBagError: they are more than `limit`, or `data` holds another number of bytes, or is damaged.
    """
    if size > limit:
        raise DamagedBagError(f"{size} bytes are declared where at most {limit} are accepted")
    unpacked = unpack_some(compression, data, size + 1)
    if len(unpacked) != size:
        raise DamagedBagError(f"{size} bytes are declared, {_counted(len(unpacked), size)} are there")
    return unpacked


def unpack_some(compression: str, data: bytes, most: int) -> bytes:
    """What can be had of `data`, which may end too early; at most `most` bytes.

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
    """A message of a bag that was recorded with compression per message (a zstd frame each).

    Raises:
        DamagedBagError: it is damaged, or larger than `limit`.
    """
    unpacked = unpack_some("zstd", data, limit + 1)
    if len(unpacked) > limit:
        raise DamagedBagError(f"more than {limit} bytes in one message")
    return unpacked


def unpack_file(source: Path, target: Path, limit: int) -> None:
    """Writes what the zstd file `source` holds to `target`, up to where it is damaged.

    Raises:
        DamagedBagError: the source is damaged or holds more than `limit` bytes; `target` has what came before.
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
