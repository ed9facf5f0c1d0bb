"""What the death of a machine leaves of a store: its own file, and of its log as much as was synced."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from unittest.mock import patch

from contact_curation.storage.stores import sqlite as sqlite_store
from contact_curation.storage.stores.sqlite import sync

LOG = "-wal"
LOG_HEADER = 32
"""Bytes that a write-ahead log begins with, other ones in each log (sqlite.org/fileformat2.html#walformat)."""


class Disk:
    """Notes what files hold whenever a store syncs them."""

    def __init__(self) -> None:
        self._synced: dict[Path, bytes] = {}

    @contextmanager
    def watched(self) -> Iterator["Disk"]:
        """Within the block."""
        with patch.object(sqlite_store, "sync", self._sync):
            yield self

    def left(self, store: Path) -> dict[str, bytes]:
        """Contents by the suffix of a store's files. Its own file is changed by checkpoints alone, which sync both files."""
        log = store.with_name(store.name + LOG)
        synced = self._synced.get(log, b"")
        same = log.exists() and log.read_bytes()[:LOG_HEADER] == synced[:LOG_HEADER]  # no checkpoint began another one since
        return {"": store.read_bytes()} | ({LOG: synced} if synced and same else {})

    def _sync(self, path: Path) -> None:
        self._synced[path] = path.read_bytes()
        sync(path)
