"""Files that a user names, read whole and never further than a bound: as bytes, as YAML, as JSON."""

import json
from pathlib import Path
from typing import Any

import yaml

from contact_curation.errors import UnreadableInputError


def read_bounded(path: Path, largest: int, expected: str) -> bytes:
    """The bytes of a file.

    Args:
        path: of the file.
        largest: how many bytes it may have.
        expected: what it should hold, for the message.

    Raises:
        UnreadableInputError: there is no such file, or it is larger.
    """
    try:
        with path.open("rb") as file:
            data = file.read(largest + 1)
    except OSError as error:
        raise UnreadableInputError(path, f"cannot be read: {error.strerror}") from error
    if len(data) > largest:
        raise UnreadableInputError(path, f"holds more than {largest} bytes, expected at most that for {expected}")
    return data


def read_yaml(path: Path, largest: int, expected: str) -> Any:
    """What a YAML file holds; arguments and errors as `read_bounded`, and UnreadableInputError for what is no YAML."""
    try:
        return yaml.safe_load(read_bounded(path, largest, expected).decode("utf-8"))
    except (yaml.YAMLError, ValueError, RecursionError) as error:  # a date that there is not is a ValueError
        raise UnreadableInputError(path, f"found no YAML ({_why(error)}), expected {expected}") from error


def read_json(path: Path, largest: int, expected: str) -> Any:
    """What a JSON file holds; arguments and errors as `read_bounded`, and UnreadableInputError for what is no JSON."""
    try:
        return json.loads(read_bounded(path, largest, expected))
    except (ValueError, RecursionError) as error:
        raise UnreadableInputError(path, f"is not JSON ({_why(error)}), expected {expected}") from error


def _why(error: Exception) -> str:
    return "it is no text" if isinstance(error, UnicodeDecodeError) else str(error)
