"""Files and folders that a user names: read whole and never further than a bound, written whole or not at all."""

import json
import math
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import yaml

from contact_curation.errors import InvalidValueError, NewerVersionError, UnreadableInputError, why_unreadable

MOST_VALUES = 1_000_000
"""In a YAML file, whose few aliases can stand for any number."""


def read_bounded(path: Path, largest: int, expected: str) -> bytes:
    """The bytes of a file.

    Args:
        path: of the file.
        largest: how many bytes it may have.
        expected: what it should hold, for the message.

    Raises:
        UnreadableInputError: there is no such file, it is a pipe or a device that nobody may ever write to, or it is larger.
    """
    if path.exists() and not (path.is_file() or path.is_dir() or path.is_relative_to("/dev")):
        raise UnreadableInputError(path, f"is no regular file, expected one with {expected}")
    try:
        with path.open("rb") as file:
            data = file.read(largest + 1)
    except OSError as error:
        raise UnreadableInputError(path, f"cannot be read: {why_unreadable(path, error)}") from error
    if len(data) > largest:
        raise UnreadableInputError(path, f"holds more than {largest} bytes, expected at most that for {expected}")
    return data


def read_yaml(path: Path, largest: int, expected: str) -> Any:
    """What a YAML file holds; arguments and errors as `read_bounded`, and UnreadableInputError for what is no YAML."""
    try:
        content = yaml.safe_load(read_bounded(path, largest, expected).decode("utf-8"))
        values = _expanded(content, {})
    except (yaml.YAMLError, ValueError, RecursionError) as error:  # a date that there is not is a ValueError
        raise UnreadableInputError(path, f"found no YAML ({_why(error)}), expected {expected}") from error
    if values > MOST_VALUES:
        raise UnreadableInputError(path, f"its aliases stand for over {MOST_VALUES} values, expected {expected}")
    return content


def _expanded(value: Any, known: dict[int, float]) -> float:
    """How many values nested ones hold, each alias counted as often as it stands there; inf for one that holds itself."""
    if not isinstance(value, list | dict | tuple | set):
        return 1
    if id(value) not in known:
        known[id(value)] = math.inf
        parts = [*value, *(value.values() if isinstance(value, dict) else ())]
        known[id(value)] = 1 + sum(_expanded(part, known) for part in parts)
    return known[id(value)]


def read_json(path: Path, largest: int, expected: str) -> Any:
    """What a JSON file holds; arguments and errors as `read_bounded`, and UnreadableInputError for what is no JSON."""
    try:
        return json.loads(read_bounded(path, largest, expected))
    except (ValueError, RecursionError) as error:
        raise UnreadableInputError(path, f"is not JSON ({_why(error)}), expected {expected}") from error


def check_version(path: Path, what: str, found: object, newest: int) -> None:
    """Refuses a file in a version of its format that this release does not know.

    Args:
        path: of the file, for the message.
        what: its format, for the message.
        found: the version that the file names; the first is 1.
        newest: that is known.

    Raises:
        NewerVersionError: a later release wrote the file.
        UnreadableInputError: what the file names is no version.
    """
    if type(found) is not int or found < 1:
        raise UnreadableInputError(path, f"found version {str(found)[:40]} of {what}, expected 1 to {newest}")
    if found > newest:
        raise NewerVersionError(path, what, found, newest)


def _why(error: Exception) -> str:
    return "it is no text" if isinstance(error, UnicodeDecodeError) else str(error)


def write_atomically(path: Path, data: bytes) -> None:
    """Writes `data` to `path`, in place of what was there; whoever reads meanwhile sees the old file or the new one.

    Raises:
        InvalidValueError: the file cannot be written there.
    """
    partial = path.with_name(f".{path.name}.partial-{os.getpid()}")
    try:
        with partial.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(path)
    except BaseException as error:  # an interrupt leaves nothing behind either
        with suppress(OSError):
            partial.unlink()
        if isinstance(error, OSError):
            raise InvalidValueError("output", path, f"a path that can be written ({error.strerror})") from error
        raise


@contextmanager
def staged_folder(path: Path) -> Iterator[Path]:
    """A hidden folder beside `path` that takes its name when the block ends well, and is removed when it does not.

    Raises:
        InvalidValueError: `path` holds something, or cannot be written.
    """
    if path.exists() and not (path.is_dir() and not any(path.iterdir())):
        what = "a folder that is not empty" if path.is_dir() else "a file"
        raise InvalidValueError("output", f"{path}, {what}", "a folder that is empty or not there yet")
    staged = path.absolute().with_name(f".{path.name}.partial-{os.getpid()}")
    try:
        staged.mkdir(parents=True)
    except OSError as error:
        raise InvalidValueError("output", path, f"a path that can be written ({error.strerror})") from error
    try:
        yield staged
        staged.replace(path)
    except BaseException as error:
        shutil.rmtree(staged, ignore_errors=True)
        if isinstance(error, OSError):
            raise InvalidValueError("output", path, f"a path that can be written ({error.strerror})") from error
        raise
