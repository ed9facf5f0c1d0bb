"""Every toss that was ever cut, in the order it came: kept before it is announced, never deleted."""

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

from contact_curation.errors import InvalidValueError
from contact_curation.motion.toss import Rejected, Toss
from contact_curation.storage.provenance import TossProvenance
from contact_curation.storage.stores.array_blob import arrays_from_blob, arrays_to_blob
from contact_curation.storage.stores.pose_journal import STATEMENT as POSES
from contact_curation.storage.stores.pose_journal import JournalPose, PoseJournal
from contact_curation.storage.stores.sequenced_table import Added, Row, SequencedTable
from contact_curation.storage.stores.sqlite import SqliteStore, StoreSchema

ARRAYS = ("stamps_ns", "positions", "orientations_wxyz", "linear_velocities", "angular_velocities")
SCHEMA = StoreSchema(
    what="a toss store",
    application_id=0x746F7373,  # "toss"
    version=1,
    statements=(
        SequencedTable.statement("tosses"),
        SequencedTable.statement("rejected"),
        "CREATE TABLE states (key TEXT PRIMARY KEY, value BLOB NOT NULL)",
        POSES,
    ),
)


class StoredToss(NamedTuple):
    """A toss of the store: its place in the order, from 1, and where it came from."""

    sequence: int
    toss: Toss
    provenance: TossProvenance


class StoredRejected(NamedTuple):
    """A rejected motion of the store: its place among the rejected ones, from 1, and where it came from."""

    sequence: int
    rejected: Rejected
    provenance: TossProvenance


class TossStore:
    """Tosses, rejected motions, and the working state of the node that cuts them, in one SQLite file.

    Each method is one transaction; `transaction()` makes several one. Use it as a context manager.

    Args:
        path: of the file; made when there is none.

    Raises:
        UnreadableInputError: the file is no toss store, or one of a newer version.
    """

    def __init__(self, path: Path) -> None:
        self._store = SqliteStore(path, SCHEMA)
        self._tosses = SequencedTable(self._store, "tosses")
        self._rejected = SequencedTable(self._store, "rejected")
        self._journal = PoseJournal(self._store)

    def add(self, toss: Toss, *, provenance: TossProvenance | None = None) -> Added:
        """Stores a toss; one that is stored already stays as it is.

        Raises:
            InvalidValueError: another toss is stored under its id.
        """
        return self._add(self._tosses, toss, {}, provenance or TossProvenance())

    def add_rejected(self, rejected: Rejected, *, provenance: TossProvenance | None = None) -> Added:
        """Stores a motion that was kept back, with the reasons.

        Raises:
            InvalidValueError: another motion, or the same for other reasons, is stored under its id.
        """
        more = {"reasons": list(rejected.reasons)}
        return self._add(self._rejected, rejected.toss, more, provenance or TossProvenance())

    def get(self, toss_ids: Sequence[str]) -> tuple[StoredToss, ...]:
        """The tosses of these ids that there are, in the order of their sequence."""
        return tuple(_stored(row) for row in self._tosses.get(toss_ids))

    def after(self, sequence: int, limit: int) -> tuple[StoredToss, ...]:
        """The next `limit` tosses behind `sequence`."""
        return tuple(_stored(row) for row in self._tosses.after(sequence, limit))

    def rejected_after(self, sequence: int, limit: int) -> tuple[StoredRejected, ...]:
        """The next `limit` rejected motions behind `sequence`."""
        return tuple(_stored_rejected(row) for row in self._rejected.after(sequence, limit))

    def contains(self, toss_id: str) -> bool:
        """Whether a toss of this id is stored; rejected ones do not count."""
        return self._tosses.find(toss_id) is not None

    @property
    def last_sequence(self) -> int:
        """Of the newest toss; 0 while there is none."""
        return self._tosses.last_sequence

    @property
    def last_rejected_sequence(self) -> int:
        """Of the newest rejected motion; 0 while there is none."""
        return self._rejected.last_sequence

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Everything done inside becomes permanent together, or not at all."""
        with self._store.transaction():
            yield

    def save_state(self, key: str, value: bytes) -> None:
        """Keeps `value` under `key`, in place of what was there."""
        self._store.execute("INSERT OR REPLACE INTO states (key, value) VALUES (?, ?)", (key, value))

    def load_state(self, key: str) -> bytes | None:
        rows = self._store.rows("SELECT value FROM states WHERE key = ?", (key,))
        return bytes(rows[0][0]) if rows else None

    def append_poses(self, poses: Sequence[JournalPose]) -> int:
        """Adds poses to the journal; returns the sequence number of the last."""
        return self._journal.append(poses)

    def poses_since(self, sequence: int = 0) -> list[tuple[int, JournalPose]]:
        """Poses of the journal behind `sequence`, each with its own sequence number."""
        return self._journal.since(sequence)

    def trim_poses(self, sequence: int) -> None:
        """Forgets the poses of the journal up to and including `sequence`."""
        self._journal.trim(sequence)

    def close(self) -> None:
        self._store.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def _add(self, table: SequencedTable, toss: Toss, more: dict[str, Any], provenance: TossProvenance) -> Added:
        """The first provenance stays: the same toss may be in several recordings."""
        head, arrays = json.dumps({**_plain(toss), **more}), arrays_to_blob(_arrays(toss))
        with self._store.transaction():
            known = table.find(toss.toss_id)
            if known is None:
                return Added(table.insert(toss.toss_id, "", head, arrays, json.dumps(asdict(provenance))), True)
        if (known.head, known.arrays) != (head, arrays):
            raise InvalidValueError(
                f"toss {toss.toss_id}", "other content than is stored", "the same content under the same id"
            )
        return Added(known.sequence, False)


def _plain(toss: Toss) -> dict[str, Any]:
    return {"body": toss.body, "source": toss.source, "frame_period": toss.frame_period}


def _arrays(toss: Toss) -> dict[str, Any]:
    return {name: getattr(toss, name) for name in ARRAYS}


def _toss(row: Row) -> Toss:
    head = json.loads(row.head)
    plain = {name: head[name] for name in ("body", "source", "frame_period")}
    return Toss(toss_id=row.id, **plain, **arrays_from_blob(row.arrays))


def _stored(row: Row) -> StoredToss:
    return StoredToss(row.sequence, _toss(row), TossProvenance(**json.loads(row.extra)))


def _stored_rejected(row: Row) -> StoredRejected:
    rejected = Rejected(_toss(row), tuple(json.loads(row.head)["reasons"]))
    return StoredRejected(row.sequence, rejected, TossProvenance(**json.loads(row.extra)))
