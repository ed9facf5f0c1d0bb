"""The file that `score` writes: loss terms, impulses and scores of each transition, as an .npz file that loads without pickle.

The number of transitions is only known at the end, so each column is first written to a temporary file. Memory does not grow
with the number of transitions, and the .npz file appears whole or not at all.
"""

import shutil
import tempfile
import zipfile
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contact_curation.contact.evaluation import LOSS_TERMS, Evaluation
from contact_curation.errors import InvalidValueError, UnreadableInputError
from contact_curation.files import check_version, replacing, writing

VERSION_NAME, VERSION = "format_version", 1
UNREADABLE = (OSError, EOFError, ValueError, KeyError, TypeError, zipfile.BadZipFile)
"""Errors of numpy for files that are not .npz files of plain arrays."""


def read_scores(path: Path) -> dict[str, NDArray[Any]]:
    """Reads the arrays of a score file by their names, which `ScoreFileWriter` lists.

    Raises:
        UnreadableInputError: the file does not exist, or is no score file.
        NewerVersionError: a later release wrote it.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            version = int(file[VERSION_NAME]) if VERSION_NAME in file else 1  # the first release did not write it
            check_version(path, "a score file", version, VERSION)
            return {name: file[name] for name in file.files if name != VERSION_NAME}
    except UNREADABLE as error:
        raise UnreadableInputError(path, f"is no score file: {error}") from error


class ScoreFileWriter:
    """Writes one score file; use it as a context manager.

    For N transitions, in characteristic units:

        toss_id (N,) text · index (N,) of the transition in its toss · loss (N,), the sum of match, complementarity_n,
        complementarity_t, cone and penetration (N,) · impulse (N, K, 3) as normal, tangent 1, tangent 2 · score (N, P) ·
        parameter_names (P,) text · status (N,), `SolveStatus` · kkt_residual (N,) · format_version ()

    Args:
        path: path of the file, `*.npz`.
        parameter_names: names of the first P columns of the scores; further columns are left out.

    Raises:
        InvalidValueError: `path` does not end in .npz, or cannot be written.
    """

    def __init__(self, path: Path, parameter_names: tuple[str, ...]) -> None:
        self.path = path
        self.transitions = 0
        self._names = parameter_names
        self._counts: list[tuple[str, int]] = []
        self._columns: dict[str, _Column] = {}
        if path.suffix != ".npz" or path.is_dir():
            raise InvalidValueError("output", path, "the name of an .npz file")
        self._column("index", np.zeros(0, dtype=np.int64))  # fails before any work if the folder cannot be written

    def add(self, toss_id: str, index: ArrayLike, evaluation: Evaluation) -> None:
        """Adds the N transitions of a toss.

        Args:
            toss_id: id of the toss.
            index: (N,) numbers of the transitions in the toss.
            evaluation: losses, impulses and scores of the transitions.
        """
        rows: dict[str, Any] = {
            "index": np.asarray(index, dtype=np.int64),
            "loss": evaluation.losses,
            **dict(zip(LOSS_TERMS, evaluation.terms.T)),
            "impulse": evaluation.impulses,
            "score": evaluation.scores[:, : len(self._names)],
            "status": evaluation.status,
            "kkt_residual": evaluation.residuals,
        }
        for name, values in rows.items():
            column = self._column(name, values)
            with writing(self.path):
                column.append(values)
        self._counts.append((toss_id, len(evaluation.status)))
        self.transitions += len(evaluation.status)

    def close(self) -> None:
        """Completes the file and gives it its final name."""
        with replacing(self.path) as file, zipfile.ZipFile(file, "w", zipfile.ZIP_STORED, allowZip64=True) as archive:
            self._write_ids(archive)
            for name, column in self._columns.items():
                column.copy_to(archive, name, self.transitions)
            for name, values in {"parameter_names": np.array(self._names), VERSION_NAME: np.array(VERSION)}.items():
                with archive.open(_member(name), "w") as member:
                    np.lib.format.write_array(member, values, allow_pickle=False)
        self.discard()

    def discard(self) -> None:
        """Removes the temporary files."""
        for column in self._columns.values():
            column.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if kind is None:
            self.close()
        else:
            self.discard()

    def _column(self, name: str, values: NDArray[Any]) -> "_Column":
        with writing(self.path):
            return self._columns.get(name) or self._columns.setdefault(name, _Column(self.path.absolute().parent, values))

    def _write_ids(self, archive: zipfile.ZipFile) -> None:
        dtype = np.dtype(f"U{max((len(toss_id) for toss_id, _ in self._counts), default=1)}")
        with archive.open(_member("toss_id"), "w", force_zip64=True) as member:
            _write_header(member, dtype, (self.transitions,))
            for toss_id, count in self._counts:
                member.write(np.full(count, toss_id, dtype).tobytes())


class _Column:
    """Rows of one array in an unnamed temporary file, which disappears however the process ends."""

    def __init__(self, folder: Path, first: NDArray[Any]) -> None:
        self._file = tempfile.TemporaryFile(dir=folder)  # noqa: SIM115 - open until `close`
        self._dtype = first.dtype
        self._shape = first.shape[1:]

    def append(self, values: NDArray[Any]) -> None:
        self._file.write(np.ascontiguousarray(values).tobytes())

    def copy_to(self, archive: zipfile.ZipFile, name: str, rows: int) -> None:
        self._file.seek(0)
        with archive.open(_member(name), "w", force_zip64=True) as member:
            _write_header(member, self._dtype, (rows, *self._shape))
            shutil.copyfileobj(self._file, member, 1 << 20)

    def close(self) -> None:
        with suppress(OSError):  # on a full disk, which could not take the rest
            self._file.close()


def _member(name: str) -> zipfile.ZipInfo:
    """A member of the archive with a fixed time stamp, so that the same scores give the same bytes."""
    return zipfile.ZipInfo(f"{name}.npy")


def _write_header(member: Any, dtype: np.dtype[Any], shape: tuple[int, ...]) -> None:
    header = {"descr": np.lib.format.dtype_to_descr(dtype), "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_2_0(member, header)
