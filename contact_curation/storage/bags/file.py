"""An input file, read by offset and never beyond its end."""

import fcntl
import hashlib
import stat
from contextlib import suppress
from pathlib import Path

from contact_curation.errors import UnreadableInputError
from contact_curation.storage.bags.errors import DamagedBagError

READ_AHEAD = 1 << 16
"""Bytes; one read then serves many small records."""


class BagFile:
    """A regular file opened for reading, under a shared advisory lock that keeps `BagWriter` from replacing it.

    Attributes:
        path: of the file.
        size: in bytes, when it was opened.

    Raises:
        UnreadableInputError: there is no such file, it is not a regular file, or it may not be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            if not stat.S_ISREG(path.stat().st_mode):
                raise UnreadableInputError(path, "is not a file")
            self._file = path.open("rb", buffering=READ_AHEAD)
        except OSError as error:
            raise UnreadableInputError(path, f"cannot be opened: {error.strerror}") from error
        self.size = path.stat().st_size
        with suppress(OSError):  # a file system without locks only loses the warning
            fcntl.flock(self._file, fcntl.LOCK_SH | fcntl.LOCK_NB)

    def read(self, offset: int, length: int) -> bytes:
        """`length` bytes from `offset` on.

        Raises:
            DamagedBagError: the file does not hold that many, which is known before anything is allocated.
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
    """SHA-256 of a file's bytes, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
