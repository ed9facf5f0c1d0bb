"""One rule for all outputs: a file is replaced only where it can be made again.

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
