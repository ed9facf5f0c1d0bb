"""Notes about a whole recording: MCAP metadata records, which rosbag2 passes over."""

from pathlib import Path
from struct import error as StructError

from mcap.exceptions import McapError
from mcap.reader import SeekingReader

DAMAGED = (McapError, StructError, OSError, EOFError, KeyError, ValueError)
"""What the reader raises on files that were cut off or changed; it leaves the checks to whatever fails."""


def recorded_note(path: Path, name: str) -> dict[str, str]:
    """The note `name` of an MCAP file; empty for other files, without such a note, or where the file's index is damaged."""
    if path.suffix != ".mcap":
        return {}
    with path.open("rb") as file:
        try:
            found = [
                record.metadata for record in SeekingReader(file, validate_crcs=True).iter_metadata() if record.name == name
            ]
        except DAMAGED:
            return {}
    return found[-1] if found else {}
