"""The path that the `save` of a result writes to: the rule of `storage.outputs`, and an ending for each kind of file."""

from collections.abc import Collection
from pathlib import Path

from contact_curation.configs import truth_value
from contact_curation.errors import InvalidValueError, UnwritableOutputError
from contact_curation.files import path_of
from contact_curation.storage.outputs import check_replaceable

NEW_NAME = "a new name, or overwrite=True to replace it"


def saved_path(path: str | Path, endings: Collection[str], *, overwrite: bool) -> Path:
    """A path that a result may be written to.

    Args:
        path: as the user wrote it.
        endings: accepted endings, such as ``.json``.
        overwrite: whether any file there may be replaced; otherwise the rule of `storage.outputs` applies.

    Raises:
        InvalidValueError: no path, another ending, no truth value, or a file is there that must not be replaced.
    """
    path = path_of("path", path, "the path of a file")
    if path.suffix not in endings:
        raise InvalidValueError("path", path, f"a file ending in {', '.join(endings)}")
    if not truth_value("overwrite", overwrite):
        try:
            check_replaceable("path", path, NEW_NAME)
        except OSError as error:  # a name that is too long, a folder that may not be entered
            raise UnwritableOutputError(path, error.strerror or str(error)) from error
    return path
