"""Files that are there whole or not at all."""

import os
from contextlib import suppress
from pathlib import Path

from contact_curation.errors import InvalidValueError


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
