"""The file of a dashboard, written from a pipe that Rerun writes to.

Rerun's own writer ends where a disk is full, and whoever waits for it then waits forever. So Rerun gets a pipe, which is always
read, and what the system refuses is an error of the file.
"""

import os
from pathlib import Path
from threading import Thread

from contact_curation.errors import InvalidValueError, UnwritableOutputError
from contact_curation.files import lock

PIECE = 1 << 16
"""[bytes] What a pipe holds."""


class RecordedFile:
    """A file that takes what is written to a pipe.

    Args:
        path: of the file, which is overwritten.

    Attributes:
        pipe: path to write to.

    Raises:
        InvalidValueError: the file cannot be opened, or another process is writing it.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._error = path, ""
        try:
            self._file = path.open("ab", buffering=0)
        except OSError as error:
            raise InvalidValueError("rrd", path, f"a path that can be written ({error.strerror})") from error
        if not lock(self._file):
            self._file.close()
            raise InvalidValueError("rrd", path, "a file that no other dashboard is writing")
        if path.is_file():
            self._file.truncate(0)
        self._source, self._sink = os.pipe()
        self.pipe = Path(f"/dev/fd/{self._sink}")
        self._thread = Thread(target=self._copy, daemon=True)
        self._thread.start()

    def opened(self) -> None:
        """Call it when the pipe was opened by its writer: it then ends with the writer."""
        os.close(self._sink)

    def finish(self) -> None:
        """Waits for the end of the pipe.

        Raises:
            UnwritableOutputError: the file is not whole.
        """
        self._thread.join()
        if self._error:
            raise UnwritableOutputError(self._path, self._error)

    def _copy(self) -> None:
        with self._file:
            while piece := os.read(self._source, PIECE):
                self._write(piece)
        os.close(self._source)

    def _write(self, piece: bytes) -> None:
        """Writes a piece, unless an earlier one could not be written."""
        try:
            while piece and not self._error:
                piece = piece[self._file.write(piece) :]
        except OSError as error:
            self._error = str(error.strerror)
