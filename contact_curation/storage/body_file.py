"""A body from a YAML file, as a user describes it (see config/cube.yaml)."""

from collections.abc import Mapping
from pathlib import Path

import yaml

from contact_curation.contact.body import Body
from contact_curation.errors import InvalidValueError, UnreadableInputError

LARGEST_FILE = 2**22
"""Bytes."""


def read_body(path: Path) -> Body:
    """The body that a YAML file describes.

    Raises:
        UnreadableInputError: there is no such file, it is no YAML mapping, or it describes no body; the line names the key.
    """
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise UnreadableInputError(path, f"found {path.stat().st_size} bytes, expected at most {LARGEST_FILE}")
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UnreadableInputError(path, f"cannot be read: {error.strerror}") from error
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError) as error:
        raise UnreadableInputError(path, f"found no YAML ({error}), expected the description of a body") from error
    if not isinstance(content, Mapping) or not all(isinstance(key, str) for key in content):
        raise UnreadableInputError(path, f"found a {type(content).__name__}, expected the keys of a body and their values")
    try:
        return Body.from_mapping(content)
    except InvalidValueError as error:
        raise UnreadableInputError(path, str(error)) from error
    except (TypeError, ValueError) as error:  # a list where one number belongs, three numbers where there are two
        raise UnreadableInputError(path, f"found values of the wrong form ({error}), expected those of a body") from error
