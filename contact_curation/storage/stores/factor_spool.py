"""Keeps factors on disk until they are ranked: they are most of a scored toss's data, and a ranking reads a few at a time.

The file has no name, so it disappears however the process ends. It is read without Python's buffers and is not memory-mapped,
so the operating system can free its pages.
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
    """A temporary file of factors, open until `close`; use it as a context manager around the ranking."""

    def __init__(self) -> None:
        self._file = TemporaryFile(prefix="contact-curation-", buffering=0)  # noqa: SIM115 - open until `close`
        self._end = 0

    def with_factor_on_disk(self, info: TossInformation) -> TossInformation:
        """The same information with its factor on disk, which is read from the file whenever it is used.

        Raises:
            OSError: the disk is full.
        """
        rows = np.ascontiguousarray(info.factor)
        begin, view = self._end, memoryview(rows).cast("B") if rows.size else memoryview(b"")
        while view:
            written = os.pwrite(self._file.fileno(), view, self._end)
            self._end, view = self._end + written, view[written:]
        kept = _RowsOnDisk(self._file, begin, rows.shape, rows.dtype)
        return replace(info, factor=cast("Rows", kept))  # NumPy accepts any object with a shape and __array__

    def close(self) -> None:
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()


@dataclass(frozen=True, slots=True)
class _RowsOnDisk:
    """Rows of a factor in the file, which NumPy can use as an array.

    Attributes:
        file: the open file; None of a copy that was made after it was closed, whose rows cannot be read either.
        begin: position of the rows in the file [bytes].
        shape: (R, P).
        dtype: dtype of the numbers.
    """

    file: IO[bytes] | None
    begin: int
    shape: tuple[int, ...]
    dtype: np.dtype[Any]

    @property
    def ndim(self) -> int:
        return len(self.shape)

    def __array__(self, dtype: np.dtype[Any] | None = None, copy: bool | None = None) -> NDArray[Any]:
        """Reads the rows; raises ValueError if the file is closed."""
        if self.file is None:
            raise ValueError("the factors were on disk until they were ranked")
        size = int(np.prod(self.shape)) * self.dtype.itemsize
        data = os.pread(self.file.fileno(), size, self.begin)
        rows = np.frombuffer(data, self.dtype).reshape(self.shape)
        return rows if dtype is None else rows.astype(dtype)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickles and copies the rows themselves; after the ranking, when the file is closed, their shape alone."""
        if self.file is None or self.file.closed:
            return _RowsOnDisk, (None, self.begin, self.shape, self.dtype)
        return np.array, (np.asarray(self),)
