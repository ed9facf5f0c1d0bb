"""A folder that is there whole or not at all."""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from contact_curation.errors import InvalidValueError


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
