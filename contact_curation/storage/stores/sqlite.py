"""A SQLite file that survives a kill of its writer, and that other processes can read while it is written.

It uses a write-ahead log and one transaction per change. With synchronous=NORMAL a commit passes its bytes to the operating
system without waiting for the disk. So a killed process loses no commit; only a crash of the machine can lose the last commits,
and it leaves the file consistent (sqlite.org/pragma.html#pragma_synchronous). Data that cannot be made again are followed by
`reach_disk`, and survive that, too.
"""

import os
import sqlite3
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Self

from contact_curation.errors import UnreadableInputError
from contact_curation.files import check_version, lock, sync_folder
from contact_curation.storage.stores.seal import seal

JOURNAL_MARK = bytes.fromhex("d9d505f920a163d7")
"""The end of a journal that names a super-journal, as of transactions over several databases; SQLite deletes the file named."""

WAIT_FOR_WRITERS = 30.0
"""Longest wait for another process's transaction [s]."""


@dataclass(frozen=True)
class StoreSchema:
    """Format of a store file.

    Attributes:
        what: name in error messages, e.g. "a toss store".
        application_id: number that marks files of this kind, 31 bits.
        version: version of the tables; files with a higher one are refused.
        statements: SQL statements that create the tables.
        upgrades: by version, the function that upgrades a file to the next version, given its connection and path.
    """

    what: str
    application_id: int
    version: int
    statements: tuple[str, ...]
    upgrades: Mapping[int, Callable[[sqlite3.Connection, Path], None]] = field(default_factory=dict)


def sealed_by(connection: sqlite3.Connection, *statements: str) -> None:
    """Runs statements of an upgrade that call `seal`."""
    connection.create_function("seal", -1, seal, deterministic=True)
    for statement in statements:
        connection.execute(statement)


class SqliteStore:
    """The file of a store. Several threads may use it; transactions of different threads do not overlap.

    Args:
        path: path of the file; it is made if it does not exist.
        schema: its format.

    Raises:
        UnreadableInputError: the file has another format or a newer version, or cannot be opened.
    """

    def __init__(self, path: Path, schema: StoreSchema) -> None:
        self.path = Path(path)
        self._lock = threading.RLock()
        self._depth = 0
        self._what = schema.what
        self._claimed: BinaryIO | None = None
        self._is_named = False
        journal = Path(f"{self.path}-journal")
        if journal.is_file() and _last_bytes(journal, len(JOURNAL_MARK)) == JOURNAL_MARK:
            raise UnreadableInputError(journal, f"names another file, which {schema.what} never does: do not use the two")
        if not self.path.absolute().parent.is_dir():  # SQLite says that it is unable to open a file
            raise UnreadableInputError(self.path, f"found no folder {self.path.parent}, expected one: make it first")
        with self._clear_errors():
            self._connection = sqlite3.connect(
                self.path, timeout=WAIT_FOR_WRITERS, isolation_level=None, check_same_thread=False
            )
        try:
            with self._clear_errors():
                self._prepare(schema)
        except BaseException:
            self.close()
            raise

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """All changes in the block are committed together or not at all; blocks may be nested."""
        with self._lock, self._clear_errors():
            outermost = self._depth == 0
            self._depth += 1
            try:
                if outermost:
                    self._connection.execute("BEGIN IMMEDIATE")
                yield
                if outermost:
                    self._connection.execute("COMMIT")
            except BaseException:
                if outermost and self._connection.in_transaction:
                    self._connection.execute("ROLLBACK")
                raise
            finally:
                self._depth -= 1

    def reach_disk(self) -> None:
        """Waits until all commits are on the disk, so that they survive a crash of the machine, too.

        Commits are in the write-ahead log until a checkpoint, which syncs both files, has moved them to the store's own file.
        So syncing the log is enough, and it waits for one write where a checkpoint would wait for several. Other threads can
        use the store meanwhile.
        """
        log = Path(f"{self.path}-wal")
        try:
            sync(log if log.exists() else self.path)  # not every file system lets SQLite keep a log
        except OSError as error:
            raise UnreadableInputError(self.path, f"cannot be used as {self._what}: {error.strerror}") from error
        with self._lock:
            if not self._is_named:
                sync_folder(self.path.absolute().parent)
                self._is_named = True

    def execute(self, statement: str, values: Sequence[Any] = ()) -> int:
        """Runs a statement in a transaction; returns the id of the row that it added, if any."""
        with self.transaction():
            return self._connection.execute(statement, values).lastrowid or 0

    def execute_many(self, statement: str, rows: Sequence[Sequence[Any]]) -> None:
        """Runs a statement for every row, in one transaction."""
        with self.transaction():
            self._connection.executemany(statement, rows)

    def rows(self, query: str, values: Sequence[Any] = ()) -> list[tuple[Any, ...]]:
        """All rows of a query."""
        with self._lock, self._clear_errors():
            return self._connection.execute(query, values).fetchall()

    def last_sequence(self, table: str) -> int:
        """The highest sequence number that `table` has ever used, also of deleted rows."""
        rows = self.rows("SELECT seq FROM sqlite_sequence WHERE name = ?", (table,))
        return int(rows[0][0]) if rows else 0

    def claim(self) -> None:
        """Makes this process the only writer until `close`; others may read. Checks the structure of the whole file.

        Raises:
            UnreadableInputError: another process writes the file, or its structure is damaged.
        """
        self._claimed = self.path.open("rb")
        if not lock(self._claimed):
            why = "is written by another process, expected one that nobody writes: give each node a store of its own"
            raise UnreadableInputError(self.path, why)
        ((found,),) = self.rows("PRAGMA integrity_check(1)")
        if found != "ok":
            why = f"is damaged ({found}), expected a whole file: put back a copy, or move it away"
            raise UnreadableInputError(self.path, why)

    def close(self) -> None:
        self._connection.close()
        if self._claimed is not None:  # last, because closing a file also frees SQLite's locks on it
            self._claimed.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    @contextmanager
    def _clear_errors(self) -> Iterator[None]:
        """Turns SQLite's errors (no database, disk full, locked for too long) into ours, which name the file."""
        try:
            yield
        except sqlite3.Error as error:
            raise UnreadableInputError(self.path, f"cannot be used as {self._what}: {error}") from error

    def _prepare(self, schema: StoreSchema) -> None:
        """Checks the file before anything in it is changed, and creates the tables of a new one."""
        if self._is_new():
            with self.transaction():
                if self._is_new():  # no other process was faster
                    for statement in schema.statements:
                        self._connection.execute(statement)
                    self._connection.execute(f"PRAGMA application_id = {schema.application_id}")
                    self._connection.execute(f"PRAGMA user_version = {schema.version}")
        version = self._checked_version(schema)
        self._connection.execute("PRAGMA journal_mode = WAL")
        self._connection.execute("PRAGMA synchronous = NORMAL")
        if version < schema.version:
            with self.transaction():
                for older in range(self._checked_version(schema), schema.version):  # unless another process was faster
                    schema.upgrades[older](self._connection, self.path)
                    self._connection.execute(f"PRAGMA user_version = {older + 1}")

    def _is_new(self) -> bool:
        (tables,) = self._connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
        return int(tables) == 0

    def _checked_version(self, schema: StoreSchema) -> int:
        """The version of the file's tables, after checking that the file is of this kind and not newer than this release."""
        (application_id,) = self._connection.execute("PRAGMA application_id").fetchone()
        (version,) = self._connection.execute("PRAGMA user_version").fetchone()
        if application_id != schema.application_id:
            found = f"a database of something else (application id {application_id})"
            raise UnreadableInputError(self.path, f"is {found}, expected {schema.what}")
        check_version(self.path, schema.what, version, schema.version)
        return int(version)


def _last_bytes(path: Path, count: int) -> bytes:
    """The end of a file, which may be large."""
    with path.open("rb") as file:
        file.seek(max(path.stat().st_size - count, 0))
        return file.read()


class Store:
    """Base class of the stores, which have one SQLite file each; use them as context managers.

    Args:
        path: path of the file; it is made if it does not exist.
        schema: its format.

    Raises:
        UnreadableInputError: the file has another format or a newer version, or cannot be opened.
    """

    def __init__(self, path: Path, schema: StoreSchema) -> None:
        self._store = SqliteStore(path, schema)

    def claim(self) -> None:
        """Makes this process the only writer, as the node that owns the store; see `SqliteStore.claim`."""
        self._store.claim()

    def reach_disk(self) -> None:
        """Waits until everything stored is on the disk; must not be called inside a transaction."""
        self._store.reach_disk()

    def close(self) -> None:
        self._store.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()


def sync(path: Path) -> None:
    """Waits until a file is on the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fdatasync(handle)  # with the size, without the times
    finally:
        os.close(handle)
