"""The store of `pose_ingest`: every toss that was cut, stored before it is announced, never deleted.

It also contains the poses since the last complete toss, so that a node that was killed continues the toss in progress.
"""

import json
import sqlite3
import struct
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

from contact_curation.errors import InvalidValueError
from contact_curation.motion.toss import Rejected, Toss
from contact_curation.storage.provenance import TossProvenance
from contact_curation.storage.stores.record_table import Added, Row, SequencedTable, arrays_from_blob, arrays_to_blob
from contact_curation.storage.stores.seal import seal, unsealed
from contact_curation.storage.stores.sqlite import Store, StoreSchema, sealed_by
from contact_curation.storage.stores.state import SEAL_STATES, STATES_TABLE, States

ARRAYS = ("stamps_ns", "positions", "orientations_wxyz", "linear_velocities", "angular_velocities")
NUMBERS = struct.Struct("<7d")
"""Number of values of a pose: position and orientation."""


def _with_checksums(connection: sqlite3.Connection, _: Path) -> None:
    poses = "UPDATE poses SET numbers = seal(numbers, stamp_ns, parent, child, static)"
    sealed_by(connection, *map(SequencedTable.sealing, ("tosses", "rejected")), SEAL_STATES, poses)


SCHEMA = StoreSchema(
    what="a toss store",
    application_id=0x746F7373,  # "toss"
    version=2,
    statements=(
        SequencedTable.statement("tosses"),
        SequencedTable.statement("rejected"),
        STATES_TABLE,
        (
            "CREATE TABLE poses (sequence INTEGER PRIMARY KEY AUTOINCREMENT, stamp_ns INTEGER NOT NULL, parent TEXT NOT NULL,"
            " child TEXT NOT NULL, static INTEGER NOT NULL, numbers BLOB NOT NULL)"
        ),
    ),
    upgrades={1: _with_checksums},
)


class JournalPose(NamedTuple):
    """Pose of the frame `child` in the frame `parent`.

    Attributes:
        stamp_ns: header stamp [ns].
        parent: frame in which the pose is given.
        child: frame whose pose it is.
        position: (3,) [m].
        orientation_wxyz: (4,) as received.
        static: whether the pose holds for all times.
    """

    stamp_ns: int
    parent: str
    child: str
    position: tuple[float, float, float]
    orientation_wxyz: tuple[float, float, float, float]
    static: bool = False


class StoredToss(NamedTuple):
    """A toss of the store with its sequence number, from 1, and its provenance."""

    sequence: int
    toss: Toss
    provenance: TossProvenance


class StoredRejected(NamedTuple):
    """A rejected motion of the store with its number among the rejected ones, from 1, and its provenance."""

    sequence: int
    rejected: Rejected
    provenance: TossProvenance


class TossStore(Store):
    """Tosses, rejected motions, and the working state of the node that cuts them, in one SQLite file.

    Each method is one transaction; `transaction()` joins several. Use it as a context manager.

    Args:
        path: path of the file; it is made if it does not exist.

    Attributes:
        states: further values that the node stores.

    Raises:
        UnreadableInputError: the file is no toss store, or has a newer version.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path, SCHEMA)
        self._tosses = SequencedTable(self._store, "tosses")
        self._rejected = SequencedTable(self._store, "rejected")
        self.states = States(self._store)

    def add(self, toss: Toss, *, provenance: TossProvenance | None = None) -> Added:
        """Stores a toss; if it is stored already, nothing changes.

        Raises:
            InvalidValueError: another toss is stored under the same id.
        """
        return self._add(self._tosses, toss, {}, provenance or TossProvenance())

    def add_rejected(self, rejected: Rejected, *, provenance: TossProvenance | None = None) -> Added:
        """Stores a rejected motion, with the reasons.

        Raises:
            InvalidValueError: another motion, or the same one with other reasons, is stored under the same id.
        """
        more = {"reasons": list(rejected.reasons)}
        return self._add(self._rejected, rejected.toss, more, provenance or TossProvenance())

    def get(self, toss_ids: Sequence[str]) -> tuple[StoredToss, ...]:
        """The stored tosses with these ids, in the order of their numbers."""
        return tuple(_stored(row) for row in self._tosses.get(toss_ids))

    def after(self, sequence: int, limit: int) -> tuple[StoredToss, ...]:
        """The next `limit` tosses after the number `sequence`."""
        return tuple(_stored(row) for row in self._tosses.after(sequence, limit))

    def rejected_after(self, sequence: int, limit: int) -> tuple[StoredRejected, ...]:
        """The next `limit` rejected motions after the number `sequence`."""
        return tuple(_stored_rejected(row) for row in self._rejected.after(sequence, limit))

    def contains(self, toss_id: str) -> bool:
        """Whether a toss with this id is stored; rejected motions do not count."""
        return self._tosses.find(toss_id) is not None

    @property
    def last_sequence(self) -> int:
        """Sequence number of the newest toss; 0 if there is none."""
        return self._tosses.last_sequence

    @property
    def last_rejected_sequence(self) -> int:
        """Sequence number of the newest rejected motion; 0 if there is none."""
        return self._rejected.last_sequence

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """All changes in the block are committed together or not at all."""
        with self._store.transaction():
            yield

    def append_poses(self, poses: Sequence[JournalPose]) -> int:
        """Adds poses to the journal with all bits; returns the sequence number of the last pose that was ever added."""
        rows = [_row(pose) for pose in poses]
        with self._store.transaction():
            statement = "INSERT INTO poses (stamp_ns, parent, child, static, numbers) VALUES (?, ?, ?, ?, ?)"
            self._store.execute_many(statement, rows)
            return self._store.last_sequence("poses")

    def poses_since(self, sequence: int = 0) -> list[tuple[int, JournalPose]]:
        """The poses of the journal after the number `sequence`, with their numbers, in the order in which they were added."""
        query = "SELECT sequence, stamp_ns, parent, child, static, numbers FROM poses WHERE sequence > ? ORDER BY sequence"
        return [
            (number, self._pose(number, stamp_ns, parent, child, static, numbers))
            for number, stamp_ns, parent, child, static, numbers in self._store.rows(query, (sequence,))
        ]

    def trim_poses(self, sequence: int) -> None:
        """Deletes the poses of the journal up to and including the number `sequence`."""
        self._store.execute("DELETE FROM poses WHERE sequence <= ?", (sequence,))

    def _pose(self, number: int, stamp_ns: int, parent: str, child: str, static: int, sealed: bytes) -> JournalPose:
        numbers = unsealed(self._store.path, f"row {number} of poses", sealed, stamp_ns, parent, child, static)
        x, y, z, qw, qx, qy, qz = NUMBERS.unpack(numbers)
        return JournalPose(stamp_ns, parent, child, (x, y, z), (qw, qx, qy, qz), bool(static))

    def _add(self, table: SequencedTable, toss: Toss, more: dict[str, Any], provenance: TossProvenance) -> Added:
        """Adds a toss to a table. The first provenance stays, because the same toss may be in several recordings."""
        head, arrays = packed_toss(toss, more)
        with self._store.transaction():
            known = table.find(toss.toss_id)
            if known is None:
                return Added(table.insert(toss.toss_id, "", head, arrays, json.dumps(asdict(provenance))), True)
        if (known.head, known.arrays) != (head, arrays):
            raise InvalidValueError(
                f"toss {toss.toss_id}",
                "other content than is stored",
                "the same content under the same id: with other settings name another store",
            )
        return Added(known.sequence, False)


PLAIN = ("body", "source", "frame_period")


def packed_toss(toss: Toss, more: Mapping[str, Any]) -> tuple[str, bytes]:
    """Packs a toss without its id: its plain fields and `more` as JSON, its arrays as a blob."""
    plain = {name: getattr(toss, name) for name in PLAIN}
    return json.dumps({**plain, **more}), arrays_to_blob({name: getattr(toss, name) for name in ARRAYS})


def unpacked_toss(toss_id: str, head: str, arrays: bytes) -> Toss:
    """Restores the toss that `packed_toss` packed."""
    known = json.loads(head)
    return Toss(toss_id=toss_id, **{name: known[name] for name in PLAIN}, **arrays_from_blob(arrays))


def _toss(row: Row) -> Toss:
    return unpacked_toss(row.id, row.head, row.arrays)


def _stored(row: Row) -> StoredToss:
    return StoredToss(row.sequence, _toss(row), TossProvenance(**json.loads(row.extra)))


def _stored_rejected(row: Row) -> StoredRejected:
    rejected = Rejected(_toss(row), tuple(json.loads(row.head)["reasons"]))
    return StoredRejected(row.sequence, rejected, TossProvenance(**json.loads(row.extra)))


def _row(pose: JournalPose) -> tuple[int, str, str, int, bytes]:
    plain = (pose.stamp_ns, pose.parent, pose.child, int(pose.static))
    return (*plain, seal(NUMBERS.pack(*pose.position, *pose.orientation_wxyz), *plain))
