"""A table of records in the order they came, one per key: the core of the toss store and the information store."""

from collections.abc import Sequence
from typing import NamedTuple

from contact_curation.storage.stores.sqlite import SqliteStore

COLUMNS = "sequence, id, version, head, arrays, extra"
MOST_VALUES = 500
"""Values in one query; SQLite's own bound was 999 for long."""

LARGEST_SEQUENCE = (1 << 63) - 1
"""That SQLite can count to; a message can ask for what follows a larger one."""


class Added(NamedTuple):
    """What `add` did: the record's sequence number, from 1, and whether it is new."""

    sequence: int
    added: bool


class Row(NamedTuple):
    """One record.

    Attributes:
        sequence: its place in the order, from 1.
        id: first part of its key.
        version: second part; empty where one part is enough.
        head: its plain fields as JSON.
        arrays: its arrays as a blob.
        extra: what was noted beside it, as JSON.
    """

    sequence: int
    id: str
    version: str
    head: str
    arrays: bytes
    extra: str


class SequencedTable:
    """Records of one kind in `store`; `name` is the table's name."""

    def __init__(self, store: SqliteStore, name: str) -> None:
        self._store = store
        self._name = name

    @staticmethod
    def statement(name: str) -> str:
        """Creates the table. AUTOINCREMENT: a sequence number is never given twice, so that nobody misses a record."""
        return (
            f"CREATE TABLE {name} (sequence INTEGER PRIMARY KEY AUTOINCREMENT, id TEXT NOT NULL, version TEXT NOT NULL,"
            " head TEXT NOT NULL, arrays BLOB NOT NULL, extra TEXT NOT NULL, UNIQUE (id, version))"
        )

    @property
    def last_sequence(self) -> int:
        """The newest sequence number; 0 while there is none."""
        return self._store.last_sequence(self._name)

    def find(self, key: str, version: str = "") -> Row | None:
        rows = self._select("WHERE id = ? AND version = ?", (key, version))
        return rows[0] if rows else None

    def insert(self, key: str, version: str, head: str, arrays: bytes, extra: str) -> int:
        """Adds a record whose key is not in the table; returns its sequence number."""
        statement = f"INSERT INTO {self._name} (id, version, head, arrays, extra) VALUES (?, ?, ?, ?, ?)"
        return self._store.execute(statement, (key, version, head, arrays, extra))

    def get(self, keys: Sequence[str]) -> list[Row]:
        """The records of these ids that there are, in the order of their sequence."""
        unique = list(dict.fromkeys(keys))
        rows: list[Row] = []
        for start in range(0, len(unique), MOST_VALUES):
            part = unique[start : start + MOST_VALUES]
            rows += self._select(f"WHERE id IN ({','.join('?' * len(part))})", part)
        return sorted(rows, key=lambda row: row.sequence)

    def after(self, sequence: int, limit: int, version: str | None = None) -> list[Row]:
        """The next `limit` records behind `sequence`, of `version` or of all."""
        sequence = min(sequence, LARGEST_SEQUENCE)
        if version is None:
            return self._select("WHERE sequence > ? ORDER BY sequence LIMIT ?", (sequence, limit))
        return self._select("WHERE sequence > ? AND version = ? ORDER BY sequence LIMIT ?", (sequence, version, limit))

    def versions(self) -> list[str]:
        """The versions, in the order of their first record."""
        query = f"SELECT version FROM {self._name} GROUP BY version ORDER BY min(sequence)"
        return [version for (version,) in self._store.rows(query)]

    def count(self, version: str) -> int:
        """How many records of a version there are."""
        return int(self._store.rows(f"SELECT count(*) FROM {self._name} WHERE version = ?", (version,))[0][0])

    def drop_version(self, version: str) -> None:
        self._store.execute(f"DELETE FROM {self._name} WHERE version = ?", (version,))

    def _select(self, clause: str, values: Sequence[object]) -> list[Row]:
        return [Row(*row) for row in self._store.rows(f"SELECT {COLUMNS} FROM {self._name} {clause}", values)]
