"""Rules for all outputs: a file is replaced only if it can be made again, and a service call writes in one folder only.

What this program makes of recordings can be made again: manifests, scores, figures, throws, metrics, dashboards. Each of these
files contains a mark of its kind; that of a CSV manifest is its digest in the file beside it, so that one that was edited is
known. Replacing a recording, a checkpoint or another file is refused; commands have `--overwrite`.
"""

import os
from hashlib import sha256
from pathlib import Path

from contact_curation.errors import InvalidValueError

CSV, PROVENANCE = ".csv", ".provenance.json"
"""Endings of a manifest's table, and of the file beside it that holds its head."""

MARKS = {
    ".parquet": (b"contact_curation_manifest",),
    CSV: (b"contact_curation_manifest",),
    ".json": (b'"contact_curation_manifest"', b'"expected_information"'),
    ".npz": (b"parameter_names.npy",),
    ".png": (b"Software\0contact_curation",),
    ".jsonl": (b'{"event": "start", "gradient_steps": ',),
    ".rrd": (b"contact_curation",),
}
"""Marks near the beginning or the end of files that this program made, by their file name ending."""

EDGE = 1 << 16
"""Number of bytes at the beginning and at the end of a file that are searched for its mark."""


def check_replaceable(name: str, path: Path, remedy: str) -> None:
    """Refuses to replace a file that cannot be made again.

    Args:
        name: name of the option or parameter, for the message.
        path: path of the output.
        remedy: what the user can do, for the message.

    Raises:
        InvalidValueError: a file that must not be replaced is at `path`.
    """
    if path.is_file() and path.stat().st_size and not _is_made_again(path):
        raise InvalidValueError(name, f"a file at {path}", remedy)


def _is_made_again(path: Path) -> bool:
    beside = path.with_suffix(PROVENANCE)
    if path.suffix == CSV and beside.is_file():
        return sha256(path.read_bytes()).hexdigest().encode() in beside.read_bytes()
    with path.open("rb") as file:
        edges = file.read(EDGE)
        file.seek(max(0, file.seek(0, os.SEEK_END) - EDGE))
        edges += file.read()
    return any(mark in edges for mark in MARKS.get(path.suffix, ()))


def path_below(name: str, folder: Path, path: str) -> Path:
    """Resolves a path in a message, which must stay in a folder, also through symbolic links.

    Args:
        name: name of the field, for the message.
        folder: allowed folder; relative paths begin there.
        path: text of the path.

    Raises:
        InvalidValueError: the path leads out of the folder, or is invalid.
    """
    try:
        allowed, target = folder.resolve(), (folder / path).resolve()
    except (OSError, RuntimeError, ValueError) as error:  # a loop of links, a null character
        raise InvalidValueError(name, repr(path), "a path") from error
    if target == allowed or not target.is_relative_to(allowed):
        raise InvalidValueError(name, repr(path), f"a file below {allowed}")
    return target
