"""Reads rosbag2's sqlite3 storage: one table of topics, one of messages, read by a cursor."""

import shutil
import sqlite3
from collections.abc import Collection, Iterator, Mapping
from contextlib import ExitStack
from itertools import batched
from pathlib import Path

from rosbags.typesys.msg import normalize_msgtype

from contact_curation.errors import UnreadableInputError
from contact_curation.files import temporary_folder
from contact_curation.storage.addresses import Address
from contact_curation.storage.bags.file import BagFile, Losses
from contact_curation.storage.bags.records import Channel, StoredMessage, qos_from

SQLITE_MAGIC = b"SQLite format 3\0"
LARGEST_ROW = 1_000_000_000
"""Largest row that SQLite supports [bytes]."""
ROWS = 512
"""Messages returned at a time."""
TABLES = ("topics", "messages")
DEFINITIONS = "message_definitions"
"""Table that databases of older releases lack."""
COMPUTED = """SELECT (SELECT count(*) FROM sqlite_master WHERE name = :table AND type IN ('table', 'view') AND rootpage = 0)
                   + (SELECT count(*) FROM pragma_table_xinfo(:table) WHERE hidden)"""
"""Counts views, virtual tables and generated columns of that name."""
SQLITE_ERRORS = (sqlite3.Error, UnicodeDecodeError, MemoryError)
"""Errors of damaged files: even SQLite's error messages may not be valid text, and a row may declare a wrong size."""
JOURNAL = "-journal"
UNFINISHED = ("-wal", JOURNAL)
"""Endings of files that SQLite leaves beside a database whose writer was killed; they contain part of the messages."""
JOURNAL_END = bytes(16)
"""Behind a journal, so that SQLite sees no super-journal named at its end: it would delete the file of that name."""


class SqliteStorage:
    """Messages of one database file, which is never written to.

    Args:
        file: the open file.
        losses: receives reports of damage.

    Raises:
        UnreadableInputError: the database is not a bag, or its table of topics is damaged.
    """

    def __init__(self, file: BagFile, losses: Losses) -> None:
        self._file = file
        self._losses = losses
        self._stack = ExitStack()
        try:
            self._connection = self._opened(file.path)
            self._check_tables()
            self._channels = self._declared()
        except SQLITE_ERRORS as error:
            self._stack.close()
            raise UnreadableInputError(file.path, f"is no readable rosbag2 database: {error}") from error

    @property
    def name(self) -> str:
        return self._file.path.name

    @property
    def channels(self) -> tuple[Channel, ...]:
        return tuple(self._channels.values())

    @property
    def extent_ns(self) -> tuple[int, int]:
        """First and last log time [ns]; zeros if the table is damaged."""
        try:
            first, last = self._connection.execute("SELECT min(timestamp), max(timestamp) FROM messages").fetchone()
        except SQLITE_ERRORS:
            return 0, 0
        return (first, last) if isinstance(first, int) and isinstance(last, int) else (0, 0)

    def counts(self) -> Mapping[Channel, int] | None:
        """Messages per channel; None if the table is damaged."""
        try:
            rows = dict(self._connection.execute("SELECT topic_id, count(*) FROM messages GROUP BY topic_id").fetchall())
        except SQLITE_ERRORS:
            return None
        undeclared = sum(count for number, count in rows.items() if number not in self._channels)
        if undeclared:
            line = f"{self.name}: {undeclared} messages are of no declared topic and were left out"
            self._losses.say((self.name, "undeclared"), line)
        return {channel: rows.get(number, 0) for number, channel in self._channels.items()}

    def runs(self, topics: Collection[str] | None) -> Iterator[list[StoredMessage]]:
        """Messages of `topics` (None: all) in order of log time, those of one time in the order they were written."""
        for rows in batched(self._messages(topics), ROWS):
            yield list(rows)

    def _messages(self, topics: Collection[str] | None) -> Iterator[StoredMessage]:
        wanted = [number for number, channel in self._channels.items() if topics is None or channel.topic in topics]
        marks = ",".join("?" * len(wanted))
        query = f"SELECT timestamp, topic_id, data FROM messages WHERE topic_id IN ({marks}) ORDER BY timestamp, rowid"
        read, malformed = 0, 0
        try:
            for time_ns, number, data in self._connection.execute(query, wanted):
                if isinstance(time_ns, int) and isinstance(data, bytes):
                    read += 1
                    yield StoredMessage(time_ns, time_ns, self._channels[number], data)
                else:
                    malformed += 1
        except SQLITE_ERRORS as error:
            line = f"{self.name}: damaged behind {read} messages, the rest is lost: {error}"
            self._losses.say((self.name, "damaged"), line)
        if malformed:
            line = f"{self.name}: {malformed} rows are no messages (a time or bytes are missing) and were left out"
            self._losses.say((self.name, "malformed"), line)

    def close(self) -> None:
        self._stack.close()
        self._file.close()

    def _opened(self, path: Path) -> sqlite3.Connection:
        """A connection that does not change the folder; a database with an unfinished transaction is copied first."""
        immutable = "?immutable=1"
        if len(stored_parts(path)) > 1:
            path = self._copy(path)
            immutable = ""
        connection = sqlite3.connect(f"{path.absolute().as_uri()}{immutable}", uri=True, check_same_thread=False)
        self._stack.callback(connection.close)
        connection.text_factory = lambda text: text.decode(errors="replace")
        size = sum(_beside(path, ending).stat().st_size for ending in ("", *UNFINISHED) if _beside(path, ending).exists())
        connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, min(size, LARGEST_ROW))  # no row is larger than its file
        return connection

    def _check_tables(self) -> None:
        """Checks that topics and messages are tables, and that all tables are plain; one that is cut short is opened, too.

        What is computed (views, virtual tables, generated columns) can have any size. SQLite refuses a file that is too short,
        unless writable_schema is set.
        """
        query = "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name IN (?, ?)"
        self._connection.execute("PRAGMA trusted_schema = OFF")
        try:
            (tables,) = self._connection.execute(query, TABLES).fetchone()
        except SQLITE_ERRORS as error:
            self._connection.execute("PRAGMA writable_schema = ON")
            (tables,) = self._connection.execute(query, TABLES).fetchone()
            self._losses.say((self.name, "cut"), f"{self.name}: damaged or cut short, read as far as it goes: {error}")
        if tables != len(TABLES):
            raise sqlite3.DatabaseError(f"it has no tables {' and '.join(TABLES)}")
        for table in (*TABLES, DEFINITIONS):
            (computed,) = self._connection.execute(COMPUTED, {"table": table}).fetchone()
            if computed:
                raise sqlite3.DatabaseError(f"its {table} are computed, expected a table with what was recorded")

    def _copy(self, path: Path) -> Path:
        folder = self._stack.enter_context(temporary_folder("bag"))
        for ending in ("", *UNFINISHED):
            if (source := _beside(path, ending)).is_file():  # a device has no end
                shutil.copyfile(source, folder / source.name)
        if (journal := _beside(folder / path.name, JOURNAL)).exists():
            with journal.open("ab") as file:
                file.write(JOURNAL_END)
        return folder / path.name

    def _declared(self) -> dict[int, Channel]:
        """Channels by topic id; older databases lack the columns of QoS and type hash, and the definitions."""
        definitions = self._definitions()
        columns = {row[1] for row in self._connection.execute("PRAGMA table_info(topics)")}
        qos = "offered_qos_profiles" if "offered_qos_profiles" in columns else "''"
        type_hash = "type_description_hash" if "type_description_hash" in columns else "''"
        query = f"SELECT id, name, type, serialization_format, {qos}, {type_hash} FROM topics ORDER BY id"
        return {
            number: Channel(
                str(name),
                _type_name(str(kind)),
                str(form),
                *definitions.get(str(kind), ("", "")),
                str(digest),
                qos_from(offered),
            )
            for number, name, kind, form, offered, digest in self._connection.execute(query)
        }

    def _definitions(self) -> dict[str, tuple[str, str]]:
        """Schema and its encoding by type name."""
        if not self._connection.execute(f"PRAGMA table_info({DEFINITIONS})").fetchall():
            return {}
        query = f"SELECT topic_type, encoded_message_definition, encoding FROM {DEFINITIONS}"
        return {str(kind): (str(text), str(encoding)) for kind, text, encoding in self._connection.execute(query)}


def _type_name(kind: str) -> str:
    """The full type name, such as `nav_msgs/msg/Odometry`; some recorders leave out `/msg/`."""
    return str(normalize_msgtype(kind)) if kind.count("/") == 1 else kind


def stored_parts(path: Path) -> list[Path]:
    """A storage file, and what SQLite left beside it that belongs to its content; of a file on a server it alone is read."""
    beside = [] if isinstance(path, Address) else [_beside(path, ending) for ending in UNFINISHED]
    return [path, *(one for one in beside if _has_bytes(one))]


def _beside(path: Path, ending: str) -> Path:
    return path.with_name(path.name + ending)


def _has_bytes(path: Path) -> bool:
    return path.is_file() and path.stat().st_size > 0
