"""Simulated time that never goes back: a node that starts again goes on behind every stamp it has ever given.

A stamp is given only when a file says that time up to it is used. So that this does not take a write for each, time is reserved
ahead, a block at a time; an orderly end gives back what is left of it.
"""

import json
from pathlib import Path
from typing import Any

from contact_curation.errors import UnreadableInputError
from contact_curation.files import read_json, write_atomically
from contact_curation.motion.toss import NANOSECONDS

KEY = "used_until_ns"
LARGEST_BYTES = 1000
BLOCK = 60 * NANOSECONDS
"""Of simulated time, reserved at once [ns]."""


class SimulatedTime:
    """Stamps of one run, behind those of the runs before it.

    Args:
        path: of the file that remembers; None for none.
        epoch_ns: at which time begins, unless an earlier run got further.

    Raises:
        UnreadableInputError: the file is there and holds something else.
        InvalidValueError: the file cannot be written there.
    """

    def __init__(self, path: Path | None, epoch_ns: int) -> None:
        self._path = path
        self._begin_ns = max(epoch_ns, _used_until(path) if path is not None and path.exists() else 0)
        self._next_ns = self._reserved_ns = self._begin_ns
        self.stamp_ns(0.0)

    def stamp_ns(self, seconds: float) -> int:
        """The stamp of a time since this run began."""
        stamp = self._begin_ns + round(seconds * NANOSECONDS)
        if stamp >= self._reserved_ns:
            self._reserved_ns = stamp + BLOCK
            self._write(self._reserved_ns)
        self._next_ns = max(self._next_ns, stamp + 1)
        return stamp

    def close(self) -> None:
        """Gives back what was reserved and not used."""
        self._write(self._next_ns)

    def _write(self, used_until_ns: int) -> None:
        if self._path is not None:
            write_atomically(self._path, (json.dumps({KEY: used_until_ns}) + "\n").encode())


def _used_until(path: Path) -> int:
    expected = f'{{"{KEY}": nanoseconds}}'
    found: Any = read_json(path, LARGEST_BYTES, expected)
    used = found.get(KEY) if isinstance(found, dict) else None
    if type(used) is not int or used < 0:
        raise UnreadableInputError(path, f"holds {str(found)[:80]}, expected {expected}")
    return used
