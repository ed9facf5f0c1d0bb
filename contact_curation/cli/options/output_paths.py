"""Checks output paths before the work starts: whether they can be written and may be replaced."""

import argparse
import os
from pathlib import Path

from contact_curation.errors import InvalidValueError
from contact_curation.storage.outputs import check_replaceable

NEW_NAME = "a new name, or --overwrite to replace it"


def add_overwrite_option(group: argparse._ActionsContainer) -> None:
    """Adds `--overwrite`, for files that `check_outputs` would refuse to replace."""
    group.add_argument(
        "--overwrite",
        action="store_true",
        help="replace any file that is there (without it only an earlier manifest, figure, score, throws or object file)",
    )


def check_outputs(*, overwrite: bool, remedy: str = NEW_NAME, **paths: Path | None) -> None:
    """Checks whether files can be written.

    Args:
        overwrite: whether any file may be replaced; otherwise the rule of `storage.outputs` applies.
        remedy: what the user can do if a file may not be replaced, for the message.
        paths: paths by the names of their options (`figure` for `--figure`); None for those that were not given.

    Raises:
        InvalidValueError: a path is a folder, its folder does not exist, it may not be written, or must not be replaced.
    """
    for name, path in paths.items():
        if path is None:
            continue
        why = _obstacle(path)
        if why:
            raise InvalidValueError(f"--{name}", path, f"a path that can be written ({why})")
        if not overwrite:
            check_replaceable(f"--{name}", path, remedy)


def _obstacle(path: Path) -> str:
    """Says why a file cannot be written; empty if it can."""
    if path.is_dir():
        return "it is a folder"
    folder = path.parent
    if not folder.is_dir():
        return f"{folder} is no folder"
    return "" if os.access(path if path.exists() else folder, os.W_OK) else "it may not be written"
