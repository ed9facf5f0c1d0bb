"""A checksum after each blob of a store, over all columns of its row, because SQLite does not notice flipped bits on a disk."""

import struct
from pathlib import Path
from zlib import crc32

from contact_curation.errors import UnreadableInputError

CHECKSUM = struct.Struct("<I")


def seal(blob: bytes, *beside: object) -> bytes:
    """Appends the checksum to a blob.

    Args:
        blob: blob without checksum.
        beside: the other columns of its row, which the checksum covers, too.
    """
    return blob + CHECKSUM.pack(_checksum(blob, beside))


def unsealed(path: Path, where: str, sealed: bytes, *beside: object) -> bytes:
    """Checks and removes the checksum of a blob.

    Args:
        path: path of the store, for the message.
        where: name of the row, for the message.
        sealed: blob with checksum, as `seal` returned it.
        beside: the other columns of its row.

    Raises:
        UnreadableInputError: the row is damaged.
    """
    blob, checksum = bytes(sealed[: -CHECKSUM.size]), bytes(sealed[-CHECKSUM.size :])
    if checksum != CHECKSUM.pack(_checksum(blob, beside)):
        why = f"{where} is damaged, expected what was stored: put back a copy, or move the file away"
        raise UnreadableInputError(path, why)
    return blob


def _checksum(blob: bytes, beside: tuple[object, ...]) -> int:
    return crc32("\0".join(map(str, beside)).encode(), crc32(blob))
