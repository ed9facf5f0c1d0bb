"""Further state of a node: small values by name, in the store of its records or in a file of their own."""

from collections.abc import Mapping
from pathlib import Path

from contact_curation.storage.stores.seal import seal, unsealed
from contact_curation.storage.stores.sqlite import SqliteStore, Store, StoreSchema, sealed_by

STATES_TABLE = "CREATE TABLE states (key TEXT PRIMARY KEY, value BLOB NOT NULL)"
SEAL_STATES = "UPDATE states SET value = seal(value, key)"
"""Adds checksums to values of an older release."""

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
        """Stores all of `values` or none; earlier values of the same names are replaced."""
        rows = [(key, seal(value, key)) for key, value in values.items()]
        self._states.execute_many("INSERT OR REPLACE INTO states (key, value) VALUES (?, ?)", rows)

    def load(self, key: str) -> bytes | None:
        rows = self._states.rows("SELECT value FROM states WHERE key = ?", (key,))
        return self._value(key, rows[0][0]) if rows else None

    def all(self) -> list[tuple[str, bytes]]:
        """All names with their values."""
        return [
            (key, self._value(key, value)) for key, value in self._states.rows("SELECT key, value FROM states ORDER BY key")
        ]

    def _value(self, key: str, value: bytes) -> bytes:
        return unsealed(self._states.path, f"state {key!r}", value, key)


class StateStore(Store, States):
    """Bytes by name in a SQLite file of their own, which survives a kill; use it as a context manager.

    Args:
        path: path of the file; it is made if it does not exist.

    Raises:
        UnreadableInputError: the file is no state store, or has a newer version.
    """

    def __init__(self, path: Path) -> None:
        Store.__init__(self, path, SCHEMA)
        States.__init__(self, self._store)

    @property
    def states(self) -> States:
        """Itself, as other stores have their states."""
        return self
