"""ContactNets' public tosses: one PyTorch file each, a float64 tensor (1, T, 19) (arXiv 2009.11193, DAIRLab/contact-nets).

A row is position (3), orientation wxyz (4), linear velocity (3), angular velocity in the body's frame (3), control (6). Lengths
are in half widths of the cube; frames are 1/148 s apart. Positions and velocities are those of the frame that the tracker
followed, wherever the body has its centre of mass. Files are read as plain tensors; pickled objects are never unpickled.
"""

import re
import warnings
import zipfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from pickle import UnpicklingError
from struct import error as StructError

import numpy as np

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.errors import InvalidValueError, UnreadableInputError
from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.scalars import vector
from contact_curation.motion.calibration import RigCalibration, apply_calibration
from contact_curation.motion.gates import inspect
from contact_curation.motion.restored_toss import RestoredToss, restored
from contact_curation.motion.toss import NANOSECONDS, Rejected, Toss
from contact_curation.storage.addresses import Address
from contact_curation.storage.bags.file import file_sha256
from contact_curation.storage.inputs.records import Found, InputReading, InputsConfig, InputSummary, Problem
from contact_curation.storage.provenance import TossProvenance

FRAME_RATE = 148.0
"""Frame rate of the public data [Hz]."""

COLUMNS = 19
CONTROL = slice(13, 19)
LARGEST_FILE = 64 * 2**20
"""Largest accepted file after unpacking [bytes]; a minute of frames has 1.3 MB."""

LARGEST_VALUE = 1e6
"""Largest accepted number in the files' units: far above any measurement, and far below an overflow in computations."""

NO_TENSOR = (
    AssertionError,
    AttributeError,
    EOFError,
    LookupError,
    NotImplementedError,
    OSError,
    RuntimeError,
    StructError,
    TypeError,
    UnpicklingError,
    UserWarning,
    ValueError,
    zipfile.BadZipFile,
)
"""Errors of torch's reader of plain tensors and of zipfile for other files."""

SUBFOLDER = "tosses_processed"
"""Folder of the files in the public repository."""


def contactnets_files(path: Path) -> list[Path]:
    """The `.pt` files of a folder in the order of their numbers, or the file itself.

    Raises:
        UnreadableInputError: there is no such file.
    """
    if path.is_file():
        return [path]
    if not path.is_dir():
        raise UnreadableInputError(path, "found nothing there, expected a .pt file or a folder of them")
    folder = path / SUBFOLDER if (path / SUBFOLDER).is_dir() else path
    files = sorted(folder.glob("*.pt"), key=_natural)
    if not files:
        raise UnreadableInputError(path, "found no .pt files, expected ContactNets' N.pt")
    return files


def read_contactnets(path: Path, body: Body = CONTACTNETS_CUBE) -> Iterator[Toss | UnreadableInputError]:
    """The tosses of a folder or file, one after the other; for a file that is no toss, the error.

    Args:
        path: a `.pt` file or a folder of them.
        body: tossed body; its length scale is the files' unit of length.

    Raises:
        UnreadableInputError: there are no files.
    """
    for file in contactnets_files(path):
        try:
            yield read_contactnets_toss(file, body)
        except UnreadableInputError as error:
            yield error


def read_contactnets_toss(file: Path, body: Body = CONTACTNETS_CUBE) -> Toss:
    """Reads one toss in SI units, as it was tracked; its id follows from the file's name, and its stamps begin at zero.

    Raises:
        UnreadableInputError: the file does not contain such a tensor, or its numbers are not a toss.
    """
    rows = _rows(file)
    try:
        return Toss(
            toss_id=file.stem,
            body=body.name,
            source=file.name,
            frame_period=1.0 / FRAME_RATE,
            stamps_ns=np.round(np.arange(len(rows)) * (NANOSECONDS / FRAME_RATE)).astype(np.int64),
            positions=rows[:, 0:3] * body.length_scale,
            orientations_wxyz=rows[:, 3:7],
            linear_velocities=rows[:, 7:10] * body.length_scale,
            angular_velocities=rows[:, 10:13],
        )
    except InvalidValueError as error:
        raise UnreadableInputError(file, str(error)) from error


def of_center_of_mass(toss: Toss, body: Body, scale: float = 1.0) -> Toss:
    """The motion of the body's centre of mass, where `toss` is that of the frame that the tracker followed, as in the files.

    Args:
        toss: in the length of its tracker.
        body: whose centre of mass is described in metres.
        scale: what lengths of the tracker are multiplied with later.
    """
    return apply_calibration(toss, RigCalibration(marker_offset=vector(body.center_of_mass / scale)))


def of_tracked_frame(toss: Toss, body: Body) -> Toss:
    """The inverse of `of_center_of_mass`."""
    return apply_calibration(toss, RigCalibration(marker_offset=vector(-body.center_of_mass)))


def restored_of(stored: Toss, body: Body) -> RestoredToss:
    """As `restored`, by velocities of the tracked frame or, in files of `export`, of the centre of mass: the more certain."""
    tracked = restored(stored)
    central = restored(of_center_of_mass(stored, body)) if body.center_of_mass.any() else tracked
    if central.timed_steps <= tracked.timed_steps:
        return tracked
    return replace(central, toss=of_tracked_frame(central.toss, body))


def _natural(file: Path) -> list[tuple[int, str]]:
    """Sort key that puts 2.pt before 10.pt."""
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in re.split(r"(\d+)", file.stem)]


def _rows(file: Path) -> Array:
    """The rows (T, 19) of a file."""
    import torch  # here, because it takes over a second and bags do not need it

    try:
        _check_size(file)
        with warnings.catch_warnings(action="error"):  # torch warns of pickles of unknown versions
            content = torch.load(_opened(file), map_location="cpu", weights_only=True)
    except NO_TENSOR as error:
        raise UnreadableInputError(file, f"found no plain tensor ({_first_sentence(error)}), expected {_EXPECTED}") from error
    if not isinstance(content, torch.Tensor):
        raise UnreadableInputError(file, f"found a {type(content).__name__}, expected {_EXPECTED}")
    batch, frames, columns = content.shape if content.ndim == 3 else (0, 0, 0)
    if content.dtype != torch.float64 or batch != 1 or frames < 2 or columns != COLUMNS:
        raise UnreadableInputError(file, f"found {content.dtype} of shape {tuple(content.shape)}, expected {_EXPECTED}")
    stored = content.untyped_storage().nbytes()
    if stored < content.numel() * content.element_size():
        raise UnreadableInputError(file, f"found {frames} frames in {stored} bytes, expected a tensor that holds its numbers")
    rows: Array = content.detach()[0].numpy()
    if rows[:, CONTROL].any():
        raise UnreadableInputError(file, "found a control that is not zero, expected a body that moves freely")
    largest = np.abs(rows).max()
    if not largest <= LARGEST_VALUE:
        raise UnreadableInputError(file, f"found a value of {largest:.3g}, expected at most {LARGEST_VALUE:g}")
    return rows


_EXPECTED = f"one float64 tensor of shape (1, T, {COLUMNS}) with T >= 2"


def _opened(file: Path) -> Path | BytesIO:
    """A file that torch and zipfile can open: a path on this machine, or the bytes of a file on a server."""
    return BytesIO(file.read_bytes()) if isinstance(file, Address) else file


def _check_size(file: Path) -> None:
    """Refuses a file that would unpack to more than any toss."""
    size = file.stat().st_size
    if zipfile.is_zipfile(_opened(file)):
        with zipfile.ZipFile(_opened(file)) as archive:
            size = max(size, sum(entry.file_size for entry in archive.infolist()))
    if size > LARGEST_FILE:
        raise UnreadableInputError(file, f"found {size} bytes unpacked, expected at most {LARGEST_FILE}")


def _first_sentence(error: Exception) -> str:
    if isinstance(error, UnpicklingError | UserWarning):
        return "pickled objects are never unpickled"
    return str(error).partition("\n")[0].partition(". ")[0] or type(error).__name__


def read_contactnets_tosses(path: Path, body: Body, config: InputsConfig) -> InputReading:
    """The tosses of a folder of files, or of one, in the order of their numbers.

    Raises:
        UnreadableInputError: there are no files, or no file is a toss.
    """
    files = contactnets_files(path)
    digests = [file_sha256(file) for file in files]
    counts: Counter[str] = Counter()
    unreadable: list[UnreadableInputError] = []  # reported if there is a toss; otherwise the whole folder is refused
    for file, digest in zip(files, digests):
        try:
            found = _gated(file, digest, body, config)
        except UnreadableInputError as error:
            unreadable.append(error)
        else:
            counts["rejected" if isinstance(found.outcome, Rejected) else "tosses"] += 1
            counts["poses"] += found.toss.frames
            yield found
        if counts:
            yield from _told(path, unreadable)
    if not counts:
        raise unreadable[0] if len(files) == 1 else _none_of(path, files, unreadable[0])
    return InputSummary(str(path), _together(files, digests), "", None, None, dict(counts))


def _gated(file: Path, digest: str, body: Body, config: InputsConfig) -> Found:
    stored = read_contactnets_toss(file, body)
    tracked = stored if config.as_stored else restored_of(stored, body).toss
    toss = apply_calibration(of_center_of_mass(tracked, body, config.rig.scale), config.rig)
    reasons = inspect(toss, body, config.gates, config.segmenter.tracker)
    return Found(Rejected(toss, reasons) if reasons else toss, TossProvenance(str(file), digest))


def _told(path: Path, unreadable: list[UnreadableInputError]) -> Iterator[Problem]:
    yield from (Problem(str(path), str(error).removeprefix(f"{path}/")) for error in unreadable)
    unreadable.clear()


def _none_of(path: Path, files: list[Path], first: UnreadableInputError) -> UnreadableInputError:
    why = str(first).removeprefix(f"{path}/")
    return UnreadableInputError(path, f"found {len(files)} .pt files, none of them a toss of ContactNets', e.g. {why}")


def _together(files: list[Path], digests: list[str]) -> str:
    if len(digests) == 1:
        return digests[0]
    return sha256("".join(f"{digest}  {file.name}\n" for digest, file in zip(digests, files)).encode()).hexdigest()
