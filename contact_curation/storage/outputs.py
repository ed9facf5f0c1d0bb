"""Rules for all outputs: a file is replaced only if it can be made again, and a service call writes in one folder only.

What this program makes can be made again: manifests, scores, figures, throws, metrics, dashboards, objects for simulators. Each
of these files contains a mark of its kind. Tables of CSV have their digest in the file beside them, and objects have it in the
last line, so that an edited one is known. Replacing a recording, a checkpoint or another file is refused; commands have
`--overwrite`.
"""

import os
from hashlib import sha256
from pathlib import Path

from contact_curation.errors import InvalidValueError
from contact_curation.files import BLUEPRINT

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
    BLUEPRINT: (b"contact_curation",),
}
"""Marks near the beginning or the end of files that this program made, by their file name ending."""

COMMENTS = {".xml": "<!-- {} -->", ".urdf": "<!-- {} -->", ".yaml": "# {}", ".obj": "# {}"}
"""How files of an object have a comment, by their file name ending."""

SEAL = "made by contact_curation; sha256 of the lines above: "
LARGEST_SEALED = 1 << 20
"""[bytes] Far more than an object takes."""

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


def sealed(lines: bytes, ending: str) -> bytes:
    """The lines of an object's file, and a comment with their digest, by which `check_replaceable` knows them unedited."""
    return lines + COMMENTS[ending].format(SEAL + sha256(lines).hexdigest()).encode() + b"\n"


def _is_sealed(path: Path) -> bool:
    data = path.read_bytes() if path.stat().st_size <= LARGEST_SEALED else b""
    return data == sealed(b"".join(data.splitlines(keepends=True)[:-1]), path.suffix)


def _is_made_again(path: Path) -> bool:
    if path.suffix in COMMENTS:
        return _is_sealed(path)
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
