"""What a node must remember beside its records: small values by name, in a SQLite file that survives a kill."""

from collections.abc import Mapping
from pathlib import Path

from contact_curation.storage.stores.sqlite import Store, StoreSchema

SCHEMA = StoreSchema(
    what="a state store",
    application_id=0x73746174,  # "stat"
    version=1,
    statements=("CREATE TABLE states (key TEXT PRIMARY KEY, value BLOB NOT NULL)",),
)


class StateStore(Store):
    """Bytes by name; use it as a context manager.

    Args:
        path: of the file; made when there is none.

    Raises:
        UnreadableInputError: the file is no state store, or one of a newer version.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path, SCHEMA)

    def save(self, values: Mapping[str, bytes]) -> None:
        """Keeps all of `values`, or none, in place of what was there under their names."""
        self._store.execute_many("INSERT OR REPLACE INTO states (key, value) VALUES (?, ?)", list(values.items()))

    def load(self, key: str) -> bytes | None:
        rows = self._store.rows("SELECT value FROM states WHERE key = ?", (key,))
        return bytes(rows[0][0]) if rows else None
