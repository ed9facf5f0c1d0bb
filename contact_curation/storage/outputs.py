"""Rules for all outputs: a file is replaced only where it can be made again, and a message writes in one folder only.

That is so of what this program made of recordings: manifests, scores, figures, throws, metrics, dashboards. Each of them has
a mark of its own in its bytes. A recording, a checkpoint, and any other file is refused; a command takes `--overwrite`.
"""

import os
from pathlib import Path

from contact_curation.errors import InvalidValueError

MARKS = {
    ".parquet": (b"contact_curation_manifest",),
    ".csv": (b"contact_curation_manifest", b"first_stamp_ns,last_stamp_ns"),
    ".json": (b'"contact_curation_manifest"', b'"expected_information"'),
    ".npz": (b"parameter_names.npy",),
    ".png": (b"Matplotlib",),
    ".jsonl": (b'"event": "start"',),
    ".rrd": (b"contact_curation",),
}
"""Marks near the beginning or the end of files that this program made, by their ending."""

EDGE = 1 << 16
"""Bytes at the begin and at the end of a file in which its mark is."""


def check_replaceable(name: str, path: Path, remedy: str) -> None:
    """Refuses to replace what cannot be made again.

    Args:
        name: name of the option or parameter, for the message.
        path: path of the output.
        remedy: what its user can do.

    Raises:
        InvalidValueError: there is such a file.
    """
    if path.is_file() and path.stat().st_size and not _is_made_again(path):
        raise InvalidValueError(name, f"a file at {path}", remedy)


def _is_made_again(path: Path) -> bool:
    with path.open("rb") as file:
        edges = file.read(EDGE)
        file.seek(max(0, file.seek(0, os.SEEK_END) - EDGE))
        edges += file.read()
    return any(mark in edges for mark in MARKS.get(path.suffix, ()))


def path_below(name: str, folder: Path, path: str) -> Path:
    """A path that a message names, which must stay in a folder, symbolic links included.

    Args:
        name: of the field, for the message.
        folder: that its owner allows; relative paths begin there.
        path: as it came.

    Raises:
        InvalidValueError: it leads elsewhere, or is no path.
    """
    try:
        allowed, target = folder.resolve(), (folder / path).resolve()
    except (OSError, RuntimeError, ValueError) as error:  # a loop of links, a null character
        raise InvalidValueError(name, repr(path), "a path") from error
    if target == allowed or not target.is_relative_to(allowed):
        raise InvalidValueError(name, repr(path), f"a file below {allowed}")
    return target
