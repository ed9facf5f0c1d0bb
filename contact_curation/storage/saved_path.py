"""The path that the `save` of a result writes to: the rule of `storage.outputs`, and an ending for each kind of file."""

from collections.abc import Collection
from pathlib import Path

from contact_curation.errors import InvalidValueError
from contact_curation.storage.outputs import check_replaceable

NEW_NAME = "a new name, or overwrite=True to replace it"


def saved_path(path: str | Path, endings: Collection[str], *, overwrite: bool) -> Path:
    """A path that a result may be written to.

    Args:
        path: as the user wrote it.
        endings: accepted endings, such as ``.json``.
        overwrite: whether any file there may be replaced; otherwise the rule of `storage.outputs` applies.

    Raises:
        InvalidValueError: another ending, or a file is there that must not be replaced.
    """
    path = Path(path)
    if path.suffix not in endings:
        raise InvalidValueError("path", path, f"a file ending in {', '.join(endings)}")
    if not overwrite:
        check_replaceable("path", path, NEW_NAME)
    return path
