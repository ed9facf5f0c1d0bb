"""What a program says in its log that somebody at the terminal should know, too."""

import re
from pathlib import Path


class LogFollower:
    """Finds what matches in the lines that a log grows by.

    Args:
        path: of the log; need not be there yet.
        pattern: with one group.
    """

    def __init__(self, path: Path, pattern: re.Pattern[str]) -> None:
        self._path = path
        self._pattern = pattern
        self._read = 0

    def new(self) -> list[str]:
        """The group's text in each match since the last call, in lines that are complete."""
        if not self._path.exists():
            return []
        with self._path.open("rb") as log:
            log.seek(self._read)
            lines, end, _ = log.read().rpartition(b"\n")
        self._read += len(lines) + len(end)
        return [found[1] for found in self._pattern.finditer(lines.decode(errors="replace"))]
