"""A checksum behind each blob of a store, over all columns of its row: SQLite does not notice a bit that flips on a disk."""

import struct
from pathlib import Path
from zlib import crc32

from contact_curation.errors import UnreadableInputError

CHECKSUM = struct.Struct("<I")


def seal(blob: bytes, *beside: object) -> bytes:
    """The blob with its checksum.

    Args:
        blob: as it is.
        beside: the other columns of its row, whose texts belong to the checksum.
    """
    return blob + CHECKSUM.pack(_checksum(blob, beside))


def unsealed(path: Path, where: str, sealed: bytes, *beside: object) -> bytes:
    """The blob without its checksum.

    Args:
        path: of the store, for the message.
        where: which row it is of, for the message.
        sealed: what `seal` gave.
        beside: the other columns of its row.

    Raises:
        UnreadableInputError: something in the row is not what was stored.
    """
    blob, checksum = bytes(sealed[: -CHECKSUM.size]), bytes(sealed[-CHECKSUM.size :])
    if checksum != CHECKSUM.pack(_checksum(blob, beside)):
        why = f"{where} is damaged, expected what was stored: put back a copy, or move the file away"
        raise UnreadableInputError(path, why)
    return blob


def _checksum(blob: bytes, beside: tuple[object, ...]) -> int:
    return crc32("\0".join(map(str, beside)).encode(), crc32(blob))
