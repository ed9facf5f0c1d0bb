"""The poses since the last complete toss, so that a node that is killed takes up the toss in progress where it was."""

import struct
from collections.abc import Sequence
from typing import NamedTuple

from contact_curation.storage.stores.sqlite import SqliteStore

NUMBERS = struct.Struct("<7d")
STATEMENT = (
    "CREATE TABLE poses (sequence INTEGER PRIMARY KEY AUTOINCREMENT, stamp_ns INTEGER NOT NULL, parent TEXT NOT NULL,"
    " child TEXT NOT NULL, static INTEGER NOT NULL, numbers BLOB NOT NULL)"
)


class JournalPose(NamedTuple):
    """Where `child` stood in `parent`.

    Attributes:
        stamp_ns: header stamp.
        parent: frame the pose is given in.
        child: frame the pose is of.
        position: (3,) [m].
        orientation_wxyz: (4,) as it came.
        static: holds for all times.
    """

    stamp_ns: int
    parent: str
    child: str
    position: tuple[float, float, float]
    orientation_wxyz: tuple[float, float, float, float]
    static: bool = False


class PoseJournal:
    """The table of poses in `store`; every number comes back bit for bit."""

    def __init__(self, store: SqliteStore) -> None:
        self._store = store

    def append(self, poses: Sequence[JournalPose]) -> int:
        """Adds poses in one transaction; returns the sequence number of the last pose ever added."""
        rows = [
            (pose.stamp_ns, pose.parent, pose.child, pose.static, NUMBERS.pack(*pose.position, *pose.orientation_wxyz))
            for pose in poses
        ]
        with self._store.transaction():
            statement = "INSERT INTO poses (stamp_ns, parent, child, static, numbers) VALUES (?, ?, ?, ?, ?)"
            self._store.execute_many(statement, rows)
            return self._store.last_sequence("poses")

    def since(self, sequence: int = 0) -> list[tuple[int, JournalPose]]:
        """Poses behind `sequence`, each with its own sequence number, in the order they were added."""
        query = "SELECT sequence, stamp_ns, parent, child, static, numbers FROM poses WHERE sequence > ? ORDER BY sequence"
        return [
            (number, _pose(stamp_ns, parent, child, bool(static), numbers))
            for number, stamp_ns, parent, child, static, numbers in self._store.rows(query, (sequence,))
        ]

    def trim(self, sequence: int) -> None:
        """Forgets the poses up to and including `sequence`."""
        self._store.execute("DELETE FROM poses WHERE sequence <= ?", (sequence,))


def _pose(stamp_ns: int, parent: str, child: str, static: bool, numbers: bytes) -> JournalPose:
    x, y, z, qw, qx, qy, qz = NUMBERS.unpack(numbers)
    return JournalPose(stamp_ns, parent, child, (x, y, z), (qw, qx, qy, qz), static)
