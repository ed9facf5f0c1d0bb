"""A table of numbered records, one per key, with arrays as blobs: the core of the toss and information stores.

A blob is a JSON list of its content, followed by the raw little-endian numbers. Reading it executes no code.

    uint32 length of the list | [[name, dtype, shape], ...] as JSON | the arrays, one behind the other
"""

import json
import math
import struct
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contact_curation.errors import InvalidValueError
from contact_curation.storage.stores.seal import seal, unsealed
from contact_curation.storage.stores.sqlite import SqliteStore

LENGTH = struct.Struct("<I")
DTYPES = ("<f8", "<i8", "<f4")
"""The accepted dtypes: float64, int64 and float32."""


def arrays_to_blob(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """Packs arrays into a blob; equal arrays in equal order give equal bytes.

    Raises:
        InvalidValueError: an array has a dtype that is not in `DTYPES`.
    """
    listed, parts = [], []
    for name, array in arrays.items():
        dtype = array.dtype.newbyteorder("<").str
        if dtype not in DTYPES:
            raise InvalidValueError(f"dtype of {name}", array.dtype, "float64, int64 or float32")
        listed.append([name, dtype, list(array.shape)])
        parts.append(np.ascontiguousarray(array, dtype=dtype).tobytes())
    head = json.dumps(listed, separators=(",", ":")).encode()
    return b"".join([LENGTH.pack(len(head)), head, *parts])


def arrays_from_blob(blob: bytes) -> dict[str, Any]:
    """Unpacks the arrays of a blob, writable and in the machine's byte order.

    Raises:
        InvalidValueError: `blob` was not made by `arrays_to_blob`.
    """
    arrays: dict[str, Any] = {}
    try:
        (length,) = LENGTH.unpack_from(blob)
        position = LENGTH.size + length
        for name, dtype, shape in json.loads(blob[LENGTH.size : position]):
            if dtype not in DTYPES or any(size < 0 for size in shape):
                raise ValueError(f"{name} of type {dtype} and shape {shape}")
            count = math.prod(shape)
            values = np.frombuffer(blob, dtype, count, position)
            arrays[name] = values.astype(values.dtype.newbyteorder("=")).reshape(shape)
            position += values.nbytes
    except (struct.error, ValueError, TypeError) as error:
        raise InvalidValueError("array blob", error, "a list of arrays and their numbers") from error
    if position != len(blob):
        raise InvalidValueError("array blob", f"{len(blob)} bytes", f"{position} bytes")
    return arrays


COLUMNS = "sequence, id, version, head, arrays, extra"
MOST_VALUES = 500
"""Largest number of values in one query; older releases of SQLite accept 999."""

LARGEST_SEQUENCE = (1 << 63) - 1
"""Largest number in SQLite; a request may contain a larger one."""


class Added(NamedTuple):
    """Result of `add`: the record's sequence number, from 1, and whether the record is new."""

    sequence: int
    added: bool


class Row(NamedTuple):
    """One record.

    Attributes:
        sequence: its number, from 1.
        id: first part of its key.
        version: second part of its key; empty if one part is enough.
        head: its plain fields as JSON.
        arrays: its arrays as a blob.
        extra: additional notes as JSON.
    """

    sequence: int
    id: str
    version: str
    head: str
    arrays: bytes
    extra: str


class SequencedTable:
    """Records of one kind in the table `name` of `store`."""

    def __init__(self, store: SqliteStore, name: str) -> None:
        self._store = store
        self._name = name

    @staticmethod
    def statement(name: str) -> str:
        """The statement that creates the table; AUTOINCREMENT never uses a number twice, so that followers miss no record."""
        return (
            f"CREATE TABLE {name} (sequence INTEGER PRIMARY KEY AUTOINCREMENT, id TEXT NOT NULL, version TEXT NOT NULL,"
            " head TEXT NOT NULL, arrays BLOB NOT NULL, extra TEXT NOT NULL, UNIQUE (id, version))"
        )

    @staticmethod
    def sealing(name: str) -> str:
        """The statement that adds checksums to rows of an older release."""
        return f"UPDATE {name} SET arrays = seal(arrays, id, version, head, extra)"

    @property
    def last_sequence(self) -> int:
        """The newest sequence number; 0 if there is none."""
        return self._store.last_sequence(self._name)

    def find(self, key: str, version: str = "") -> Row | None:
        rows = self._select("WHERE id = ? AND version = ?", (key, version))
        return rows[0] if rows else None

    def insert(self, key: str, version: str, head: str, arrays: bytes, extra: str) -> int:
        """Adds a record whose key is not in the table; returns its sequence number."""
        statement = f"INSERT INTO {self._name} (id, version, head, arrays, extra) VALUES (?, ?, ?, ?, ?)"
        return self._store.execute(statement, (key, version, head, seal(arrays, key, version, head, extra), extra))

    def get(self, keys: Sequence[str]) -> list[Row]:
        """The stored records with these ids, in the order of their numbers."""
        unique = list(dict.fromkeys(keys))
        rows: list[Row] = []
        for start in range(0, len(unique), MOST_VALUES):
            part = unique[start : start + MOST_VALUES]
            rows += self._select(f"WHERE id IN ({','.join('?' * len(part))})", part)
        return sorted(rows, key=lambda row: row.sequence)

    def after(self, sequence: int, limit: int, version: str | None = None) -> list[Row]:
        """The next `limit` records after the number `sequence`, of `version` or of all versions."""
        sequence = min(sequence, LARGEST_SEQUENCE)
        if version is None:
            return self._select("WHERE sequence > ? ORDER BY sequence LIMIT ?", (sequence, limit))
        return self._select("WHERE sequence > ? AND version = ? ORDER BY sequence LIMIT ?", (sequence, version, limit))

    def versions(self) -> list[str]:
        """The versions, in the order of their first record."""
        query = f"SELECT version FROM {self._name} GROUP BY version ORDER BY min(sequence)"
        return [version for (version,) in self._store.rows(query)]

    def count(self, version: str) -> int:
        """Number of records of a version."""
        return int(self._store.rows(f"SELECT count(*) FROM {self._name} WHERE version = ?", (version,))[0][0])

    def drop_version(self, version: str) -> None:
        self._store.execute(f"DELETE FROM {self._name} WHERE version = ?", (version,))

    def _select(self, clause: str, values: Sequence[object]) -> list[Row]:
        return [self._row(*row) for row in self._store.rows(f"SELECT {COLUMNS} FROM {self._name} {clause}", values)]

    def _row(self, sequence: int, key: str, version: str, head: str, arrays: bytes, extra: str) -> Row:
        where = f"row {sequence} of {self._name}"
        return Row(sequence, key, version, head, unsealed(self._store.path, where, arrays, key, version, head, extra), extra)
