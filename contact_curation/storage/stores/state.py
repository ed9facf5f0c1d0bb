"""What a node must remember beside its records: small values by name, in the file of its records or in one of its own."""

from collections.abc import Mapping
from pathlib import Path

from contact_curation.storage.stores.seal import seal, unsealed
from contact_curation.storage.stores.sqlite import SqliteStore, Store, StoreSchema, sealed_by

STATES_TABLE = "CREATE TABLE states (key TEXT PRIMARY KEY, value BLOB NOT NULL)"
SEAL_STATES = "UPDATE states SET value = seal(value, key)"
"""Gives the values of an older release their checksums."""

SCHEMA = StoreSchema(
    what="a state store",
    application_id=0x73746174,  # "stat"
    version=2,
    statements=(STATES_TABLE,),
    upgrades={1: lambda connection, _: sealed_by(connection, SEAL_STATES)},
)


class States:
    """Bytes by name, in a table of a store.

    Args:
        store: store with the table `STATES_TABLE`.
    """

    def __init__(self, store: SqliteStore) -> None:
        self._states = store

    def save(self, values: Mapping[str, bytes]) -> None:
        """Stores all of `values`, or none, in place of what was there under their names."""
        rows = [(key, seal(value, key)) for key, value in values.items()]
        self._states.execute_many("INSERT OR REPLACE INTO states (key, value) VALUES (?, ?)", rows)

    def load(self, key: str) -> bytes | None:
        rows = self._states.rows("SELECT value FROM states WHERE key = ?", (key,))
        return self._value(key, rows[0][0]) if rows else None

    def all(self) -> list[tuple[str, bytes]]:
        """Every name with its value."""
        return [
            (key, self._value(key, value)) for key, value in self._states.rows("SELECT key, value FROM states ORDER BY key")
        ]

    def _value(self, key: str, value: bytes) -> bytes:
        return unsealed(self._states.path, f"state {key!r}", value, key)


class StateStore(Store, States):
    """Bytes by name in a SQLite file of their own, which survives a kill; use it as a context manager.

    Args:
        path: path of the file; made when there is none.

    Raises:
        UnreadableInputError: the file is no state store, or one of a newer version.
    """

    def __init__(self, path: Path) -> None:
        Store.__init__(self, path, SCHEMA)
        States.__init__(self, self._store)
