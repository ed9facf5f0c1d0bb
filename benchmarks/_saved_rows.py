"""Rows of a benchmark in a file, one line of JSON each, so that a benchmark that was stopped goes on."""

import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

type Row = dict[str, Any]


class SavedRows:
    """All rows so far.

    Args:
        path: of the file, which need not be there yet; None to have the rows in memory only.

    Attributes:
        rows: those of the file, and those that were added, in this order.
    """

    def __init__(self, path: Path | None) -> None:
        self._path = path
        there = path is not None and path.exists()
        self.rows: list[Row] = [json.loads(line) for line in path.read_text().splitlines()] if path and there else []

    def of(self, key: Row, make: Callable[[], Sequence[Row]]) -> list[Row]:
        """The rows that have the values of `key`; if there are none, they are made, added and printed to standard error."""
        found = [row for row in self.rows if {**row, **key} == row]
        if not found:
            found = [{**key, **row} for row in make()]
            self.add(found)
            print(*found, sep="\n", file=sys.stderr, flush=True)
        return found

    def one(self, key: Row, make: Callable[[], Row]) -> Row:
        """The same where a key has one row."""
        return self.of(key, lambda: [make()])[0]

    def add(self, rows: Sequence[Row]) -> None:
        """Adds rows, to the file, too."""
        self.rows += rows
        if self._path is not None:
            with self._path.open("a") as file:
                file.writelines(json.dumps(row) + "\n" for row in rows)
