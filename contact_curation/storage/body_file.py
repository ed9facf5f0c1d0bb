"""A body from a YAML file, as a user describes it (see config/cube.yaml)."""

from collections.abc import Mapping
from pathlib import Path

from contact_curation.contact.body import Body
from contact_curation.errors import InvalidValueError, UnreadableInputError
from contact_curation.storage.files import read_yaml

LARGEST_FILE = 2**22
"""Bytes."""


def read_body(path: Path) -> Body:
    """The body that a YAML file describes.

    Raises:
        UnreadableInputError: there is no such file, it is no YAML mapping, or it describes no body; the line names the key.
    """
    content = read_yaml(path, LARGEST_FILE, "the description of a body")
    if not isinstance(content, Mapping) or not all(isinstance(key, str) for key in content):
        raise UnreadableInputError(path, f"found a {type(content).__name__}, expected the keys of a body and their values")
    try:
        return Body.from_mapping(content)
    except InvalidValueError as error:
        raise UnreadableInputError(path, str(error)) from error
    except (TypeError, ValueError) as error:  # a list where one number belongs, three numbers where there are two
        raise UnreadableInputError(path, f"found values of the wrong form ({error}), expected those of a body") from error
