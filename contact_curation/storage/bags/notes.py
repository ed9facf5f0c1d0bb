"""Notes about a whole recording: MCAP metadata records, which rosbag2 passes over."""

from pathlib import Path
from struct import error as StructError

from mcap.exceptions import McapError
from mcap.reader import SeekingReader

DAMAGED = (McapError, StructError, OSError, EOFError, KeyError, ValueError)
"""What the reader raises on files that were cut off or changed; it leaves the checks to whatever fails."""


def recorded_notes(path: Path) -> dict[str, dict[str, str]]:
    """The notes of an MCAP file by their names; none for other files, or where the file's index is damaged."""
    if path.suffix != ".mcap":
        return {}
    with path.open("rb") as file:
        try:
            return {record.name: record.metadata for record in SeekingReader(file, validate_crcs=True).iter_metadata()}
        except DAMAGED:
            return {}
