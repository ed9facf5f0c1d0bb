"""What `score` writes: all terms of the loss of each transition, as one .npz file that loads without pickle.

The number of transitions is known at the end only, so that the columns grow in files of their own first: memory stays flat
however much is scored, and the .npz appears whole or not at all.
"""

import shutil
import tempfile
import zipfile
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contact_curation.contact.evaluation import LOSS_TERMS, Evaluation
from contact_curation.errors import InvalidValueError, UnreadableInputError
from contact_curation.files import check_version

VERSION_NAME, VERSION = "format_version", 1
UNREADABLE = (OSError, EOFError, ValueError, KeyError, TypeError, zipfile.BadZipFile)
"""What numpy raises on files that are no .npz file of plain arrays."""


def read_scores(path: Path) -> dict[str, NDArray[Any]]:
    """The arrays of a score file by their names, as `ScoreFileWriter` lists them.

    Raises:
        UnreadableInputError: there is no such file, or it is no score file.
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
        parameter_names: P names of the first P columns of the scores; columns behind them are left out.

    Raises:
        InvalidValueError: `path` is no name of an .npz file, or cannot be written.
    """

    def __init__(self, path: Path, parameter_names: tuple[str, ...]) -> None:
        self.path = path
        self.transitions = 0
        self._names = parameter_names
        self._counts: list[tuple[str, int]] = []
        self._columns: dict[str, _Column] = {}
        if path.suffix != ".npz" or path.is_dir():
            raise InvalidValueError("output", path, "the name of an .npz file")
        try:
            # Goes with this object, or with the process, also where an interrupt comes before `with` or while it ends.
            self._holder = tempfile.TemporaryDirectory(prefix=f".{path.name}.", dir=path.parent, ignore_cleanup_errors=True)
        except OSError as error:
            raise InvalidValueError("output", path, f"a path that can be written ({error.strerror})") from error

        self._folder = Path(self._holder.name)

    def add(self, toss_id: str, index: ArrayLike, evaluation: Evaluation) -> None:
        """Adds the N transitions of a toss.

        Args:
            toss_id: id of their toss.
            index: (N,) their numbers in the toss.
            evaluation: their losses, impulses and scores.
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
            column = self._columns.get(name) or self._columns.setdefault(name, _Column(self._folder / name, values))
            column.append(values)
        self._counts.append((toss_id, len(evaluation.status)))
        self.transitions += len(evaluation.status)

    def close(self) -> None:
        """Completes the file and gives it its name."""
        partial = self._folder / self.path.name
        with zipfile.ZipFile(partial, "w", zipfile.ZIP_STORED, allowZip64=True) as archive:
            self._write_ids(archive)
            for name, column in self._columns.items():
                column.copy_to(archive, name, self.transitions)
            for name, values in {"parameter_names": np.array(self._names), VERSION_NAME: np.array(VERSION)}.items():
                with archive.open(f"{name}.npy", "w") as member:
                    np.lib.format.write_array(member, values, allow_pickle=False)
        partial.replace(self.path)
        self.discard()

    def discard(self) -> None:
        """Removes what is not part of a finished file."""
        for column in self._columns.values():
            column.file.close()
        self._holder.cleanup()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if kind is None:
            self.close()
        else:
            self.discard()

    def _write_ids(self, archive: zipfile.ZipFile) -> None:
        dtype = np.dtype(f"U{max((len(toss_id) for toss_id, _ in self._counts), default=1)}")
        with archive.open("toss_id.npy", "w", force_zip64=True) as member:
            _write_header(member, dtype, (self.transitions,))
            for toss_id, count in self._counts:
                member.write(np.full(count, toss_id, dtype).tobytes())


class _Column:
    """Rows of one array, in a file without header."""

    def __init__(self, path: Path, first: NDArray[Any]) -> None:
        self.file: BinaryIO = path.open("w+b")
        self._dtype = first.dtype
        self._shape = first.shape[1:]

    def append(self, values: NDArray[Any]) -> None:
        self.file.write(np.ascontiguousarray(values).tobytes())

    def copy_to(self, archive: zipfile.ZipFile, name: str, rows: int) -> None:
        self.file.seek(0)
        with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
            _write_header(member, self._dtype, (rows, *self._shape))
            shutil.copyfileobj(self.file, member, 1 << 20)


def _write_header(member: Any, dtype: np.dtype[Any], shape: tuple[int, ...]) -> None:
    header = {"descr": np.lib.format.dtype_to_descr(dtype), "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_2_0(member, header)
