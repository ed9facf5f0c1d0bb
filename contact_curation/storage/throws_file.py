"""Reads and writes throws as a JSON file, which `design` writes, and `simulate` or a robot reads.

    {"version": 1, "body": {...},
     "throws": [{"throw_id", "body", "position", "orientation_wxyz", "linear_velocity", "angular_velocity",
                 "expected_information", "parameters_version"}, ...]}

`body` is in files that `design` wrote. Units are SI. Positions of the centre of mass and velocities are in the board's
frame, angular velocities in the body's frame.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from contact_curation.contact.body import Body
from contact_curation.design.throw import Throw
from contact_curation.errors import ContactCurationError, InvalidValueError, UnreadableInputError
from contact_curation.files import check_version, read_json, write_atomically

VERSION = 1
LARGEST_BYTES = 16 << 20
MOST_THROWS = 100_000


def write_throws(path: Path, throws: Sequence[Throw], body: Body | None = None) -> None:
    """Writes throws, whole or not at all.

    Args:
        path: path of the file.
        throws: throws of one body.
        body: body that is thrown; None leaves it out.

    Raises:
        InvalidValueError: the file cannot be written there.
    """
    described = {} if body is None else {"body": body.to_mapping()}
    document = {"version": VERSION, **described, "throws": [throw.to_mapping() for throw in throws]}
    write_atomically(path, (json.dumps(document, indent=1) + "\n").encode())


def read_throws(path: Path) -> tuple[Throw, ...]:
    """Reads the throws in a file.

    Raises:
        UnreadableInputError: the file does not exist, contains no throws, or contains an id twice.
    """
    listed = _listed(path, read_json(path, LARGEST_BYTES, "throws"))
    throws: list[Throw] = []
    for number, entry in enumerate(listed):
        if not isinstance(entry, dict):
            raise UnreadableInputError(path, f"throw {number}: found a JSON {type(entry).__name__}, expected an object")
        try:
            throws.append(Throw.from_mapping(entry))
        except InvalidValueError as error:
            raise UnreadableInputError(path, f"throw {number}: {error}") from error
    _check_ids(path, throws)
    return tuple(throws)


def read_throws_body(path: Path) -> Body | None:
    """Reads the body of the throws in a file; None if the file does not describe it.

    Raises:
        UnreadableInputError: the file does not exist, or its body is invalid.
    """
    document = read_json(path, LARGEST_BYTES, "throws")
    told = document.get("body") if isinstance(document, dict) else None
    if told is None:
        return None
    try:
        return Body.from_mapping(told)
    except (ContactCurationError, TypeError, AttributeError) as error:
        raise UnreadableInputError(path, f"body: {error}") from error


def _listed(path: Path, document: Any) -> list[Any]:
    if isinstance(document, dict) and "version" in document:
        check_version(path, "throws", document["version"], VERSION)
    if not isinstance(document, dict) or "version" not in document or not isinstance(document.get("throws"), list):
        raise UnreadableInputError(path, "holds no throws, expected an object with the keys version and throws")
    throws: list[Any] = document["throws"]
    if not 0 < len(throws) <= MOST_THROWS:
        raise UnreadableInputError(path, f"found {len(throws)} throws, expected 1 to {MOST_THROWS}")
    return throws


def _check_ids(path: Path, throws: Sequence[Throw]) -> None:
    seen: set[str] = set()
    for throw in throws:
        if throw.throw_id in seen:
            raise UnreadableInputError(path, f"throw_id: found {throw.throw_id} twice, expected each once")
        seen.add(throw.throw_id)
