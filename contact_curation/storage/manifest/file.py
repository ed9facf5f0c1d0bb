"""Manifests on disk: Parquet, CSV or JSON by the file's ending, with the same content in each."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from contact_curation.errors import ContactCurationError, InvalidValueError, UnreadableInputError
from contact_curation.storage.atomic_file import write_atomically
from contact_curation.storage.manifest.csv_form import from_csv, to_csv
from contact_curation.storage.manifest.json_form import from_json, to_json
from contact_curation.storage.manifest.manifest import Manifest
from contact_curation.storage.manifest.parquet_form import from_parquet, to_parquet

AROUND = 20
"""Characters beside one that cannot be written, for the message."""


class _Format(NamedTuple):
    write: Callable[[Manifest], bytes]
    read: Callable[[bytes], Manifest]


FORMATS = {
    ".parquet": _Format(to_parquet, from_parquet),
    ".csv": _Format(to_csv, from_csv),
    ".json": _Format(to_json, from_json),
}


def write_manifest(manifest: Manifest, path: Path) -> None:
    """Writes a manifest, whole or not at all; the same manifest always gives the same bytes.

    Raises:
        InvalidValueError: the ending of `path` is not one of `FORMATS`, it cannot be written, or a name is not Unicode.
    """
    write = _format(path).write
    try:
        data = write(manifest)
    except UnicodeEncodeError as error:
        near = error.object[max(0, error.start - AROUND) : error.end + AROUND]
        raise InvalidValueError("manifest", f"{near!r} in it", "names and paths that are Unicode") from error
    write_atomically(path, data)


def read_manifest(path: Path) -> Manifest:
    """Reads a manifest that `write_manifest` wrote.

    Raises:
        InvalidValueError: the ending of `path` is not one of `FORMATS`.
        UnreadableInputError: the file is no manifest, or one of a newer version.
    """
    read = _format(path).read
    try:
        return read(path.read_bytes())
    except OSError as error:
        raise UnreadableInputError(path, f"cannot be read: {error.strerror or error}") from error
    except (ValueError, LookupError, TypeError, ContactCurationError) as error:
        raise UnreadableInputError(path, f"is no manifest of `contact-curation rank`: {_why(error)}") from error


def _why(error: Exception) -> str:
    """What one of our readers, or one of Python's, found."""
    if isinstance(error, KeyError):
        return f"found no key {error.args[0]!r}"
    if isinstance(error, IndexError):
        return "found a row that is cut off"
    return "found a value of another type" if isinstance(error, TypeError) else str(error)


def _format(path: Path) -> _Format:
    if path.suffix not in FORMATS:
        raise InvalidValueError("manifest", path, f"a file ending in {', '.join(FORMATS)}")
    return FORMATS[path.suffix]
