"""Factors wait on disk: of what stays of a scored toss they are by far the most, and a ranking reads them a handful at a time.

The file has no name, so nothing is left of it however the process ends; it is read past Python's buffers and never mapped, so
its pages are the system's to drop.
"""

import os
from dataclasses import dataclass, replace
from tempfile import TemporaryFile
from types import TracebackType
from typing import IO, Any, Self, cast

import numpy as np
from numpy.typing import NDArray

from contact_curation.information.record import Rows, TossInformation


class FactorSpool:
    """A file of factors, open until `close`; use it as a context manager around all that ranks."""

    def __init__(self) -> None:
        self._file = TemporaryFile(prefix="contact-curation-", buffering=0)  # noqa: SIM115 - open until `close`
        self._end = 0

    def with_factor_on_disk(self, info: TossInformation) -> TossInformation:
        """The same information; its factor is read from the file whenever it is computed with.

        Raises:
            OSError: the disk is full.
        """
        rows = np.ascontiguousarray(info.factor)
        begin, view = self._end, memoryview(rows).cast("B") if rows.size else memoryview(b"")
        while view:
            written = os.pwrite(self._file.fileno(), view, self._end)
            self._end, view = self._end + written, view[written:]
        kept = _RowsOnDisk(self._file, begin, rows.shape, rows.dtype)
        return replace(info, factor=cast("Rows", kept))  # NumPy takes whatever has a shape and can become an array

    def close(self) -> None:
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()


@dataclass(frozen=True, slots=True)
class _RowsOnDisk:
    """Rows of a spooled factor: an array to NumPy, a place in a file to everyone else.

    Attributes:
        file: while it is open; its number alone could be another file's by now.
        begin: where the rows are in it [bytes].
        shape: (R, P).
        dtype: dtype of their numbers.
    """

    file: IO[bytes]
    begin: int
    shape: tuple[int, ...]
    dtype: np.dtype[Any]

    @property
    def ndim(self) -> int:
        return len(self.shape)

    def __array__(self, dtype: np.dtype[Any] | None = None, copy: bool | None = None) -> NDArray[Any]:
        """The rows, read again; ValueError once the file is closed."""
        size = int(np.prod(self.shape)) * self.dtype.itemsize
        data = os.pread(self.file.fileno(), size, self.begin)
        rows = np.frombuffer(data, self.dtype).reshape(self.shape)
        return rows if dtype is None else rows.astype(dtype)
