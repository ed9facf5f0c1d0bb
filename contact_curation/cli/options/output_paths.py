"""Outputs that could never be written are said before hours of work, not after them."""

import os
from pathlib import Path

from contact_curation.errors import InvalidValueError


def check_outputs(**paths: Path | None) -> None:
    """Looks whether files can be written; by their options, `figure` for `--figure`, None for those that were not given.

    Raises:
        InvalidValueError: one is a folder, its folder is not there, or it may not be written.
    """
    for name, path in paths.items():
        why = "" if path is None else _obstacle(path)
        if why:
            raise InvalidValueError(f"--{name}", path, f"a path that can be written ({why})")


def _obstacle(path: Path) -> str:
    """Why a file cannot be written; empty where nothing speaks against it."""
    if path.is_dir():
        return "it is a folder"
    folder = path.parent
    if not folder.is_dir():
        return f"{folder} is no folder"
    return "" if os.access(path if path.exists() else folder, os.W_OK) else "it may not be written"
