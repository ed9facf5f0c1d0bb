"""The scorer's store: the information of every toss at the newest parameters, stored before it is announced."""

import json
import sqlite3
from collections.abc import Iterator
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from contact_curation.errors import InvalidValueError
from contact_curation.information.record import ParameterBlock, TossInformation
from contact_curation.storage.stores.record_table import Added, Row, SequencedTable, arrays_from_blob, arrays_to_blob
from contact_curation.storage.stores.sqlite import Store, StoreSchema, sealed_by
from contact_curation.storage.stores.state import SEAL_STATES, STATES_TABLE, States, StateStore


def _with_states(connection: sqlite3.Connection, path: Path) -> None:
    """Moves the states of version 1, which were in a second file, into the store."""
    connection.execute(STATES_TABLE)
    beside = path.with_name(f"{path.name}.state")
    if beside.exists():
        with StateStore(beside) as older:
            connection.executemany("INSERT INTO states (key, value) VALUES (?, ?)", older.all())


def _with_checksums(connection: sqlite3.Connection, _: Path) -> None:
    sealed_by(connection, SequencedTable.sealing("information"), SEAL_STATES)


SCHEMA = StoreSchema(
    what="an information store",
    application_id=0x696E666F,  # "info"
    version=3,
    statements=(
        SequencedTable.statement("information"),
        "CREATE INDEX by_version ON information (version, sequence)",
        STATES_TABLE,
    ),
    upgrades={1: _with_states, 2: _with_checksums},
)
METHOD = ("model", "estimator", "influence_bound", "blocks")
"""Fields that must agree between records at the same parameters, so that they can be compared."""
PAGE = 256
"""Number of records that are read at a time."""


class StoredInformation(NamedTuple):
    """A record of the store with its sequence number, from 1."""

    sequence: int
    information: TossInformation


class InformationStore(Store):
    """TossInformation by toss and parameters version, in one SQLite file. Use it as a context manager.

    Args:
        path: path of the file; it is made if it does not exist.

    Attributes:
        states: further values that its node stores.

    Raises:
        UnreadableInputError: the file is no information store, or has a newer version.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path, SCHEMA)
        self._table = SequencedTable(self._store, "information")
        self.states = States(self._store)

    def add(self, information: TossInformation) -> Added:
        """Stores a record; a stored record of the same toss and parameters stays as it is.

        A second scoring may differ in the last digits; the first one counts, because it was announced.

        Raises:
            InvalidValueError: stored records at these parameters were scored in another way (model, estimator, bound, blocks).
        """
        toss_id, version = information.toss_id, information.parameters_version
        text, arrays = packed_information(information)
        with self._store.transaction():
            known = self._table.find(toss_id, version)
            for like in [known] if known else self._table.after(0, 1, version):
                self._check_method(toss_id, json.loads(text), json.loads(like.head))
            if known:
                return Added(known.sequence, False)
            return Added(self._table.insert(toss_id, version, text, arrays, ""), True)

    def get(self, toss_id: str, parameters_version: str) -> StoredInformation | None:
        row = self._table.find(toss_id, parameters_version)
        return None if row is None else _stored(row)

    def after(self, sequence: int, limit: int) -> tuple[StoredInformation, ...]:
        """The next `limit` records after the number `sequence`, of all versions."""
        return tuple(_stored(row) for row in self._table.after(sequence, limit))

    def all_of(self, parameters_version: str) -> Iterator[StoredInformation]:
        """All records of a version in the order of their numbers, one page in memory at a time."""
        sequence = 0
        while rows := self._table.after(sequence, PAGE, parameters_version):
            yield from (_stored(row) for row in rows)
            sequence = rows[-1].sequence

    def count(self, parameters_version: str) -> int:
        """Number of records of a version."""
        return self._table.count(parameters_version)

    @property
    def last_sequence(self) -> int:
        """The newest sequence number; 0 if there is none."""
        return self._table.last_sequence

    @property
    def versions(self) -> tuple[str, ...]:
        """The versions of the parameters, in the order of their first record."""
        return tuple(self._table.versions())

    def drop_version(self, parameters_version: str) -> None:
        """Deletes the records of a version, which can be scored again."""
        self._table.drop_version(parameters_version)

    def keep_newest_versions(self, count: int = 2) -> tuple[str, ...]:
        """Deletes the records of all but the newest `count` versions; they can be scored again.

        Returns:
            The deleted versions.

        Raises:
            InvalidValueError: `count` is below 1.
        """
        if count < 1:
            raise InvalidValueError("versions to keep", count, "at least 1")
        with self._store.transaction():
            dropped = self._table.versions()[:-count]
            for version in dropped:
                self._table.drop_version(version)
        return tuple(dropped)

    @staticmethod
    def _check_method(toss_id: str, new: dict[str, Any], known: dict[str, Any]) -> None:
        for name in METHOD:
            if new[name] != known[name]:
                expected = f"{known[name]}, as stored for these parameters, or another store"
                raise InvalidValueError(f"{name} of toss {toss_id}", new[name], expected)


def packed_information(information: TossInformation) -> tuple[str, bytes]:
    """Packs a record without toss id and version: its plain fields as JSON, its arrays as a blob."""
    values = {field.name: getattr(information, field.name) for field in fields(information)}
    arrays = {name: value for name, value in values.items() if isinstance(value, np.ndarray)}
    head = {name: value for name, value in values.items() if name not in (*arrays, "toss_id", "parameters_version")}
    blocks = [asdict(block) for block in information.blocks]
    return json.dumps({**head, "blocks": blocks}, default=_number), arrays_to_blob(arrays)


def unpacked_information(toss_id: str, version: str, head: str, arrays: bytes) -> TossInformation:
    """Restores the record that `packed_information` packed."""
    known = json.loads(head)
    known["blocks"] = tuple(ParameterBlock(**block) for block in known["blocks"])
    return TossInformation(toss_id=toss_id, parameters_version=version, **known, **arrays_from_blob(arrays))


def _number(value: object) -> object:
    """Converts NumPy's scalars to numbers for JSON."""
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{value!r} is no number")


def _stored(row: Row) -> StoredInformation:
    return StoredInformation(row.sequence, unpacked_information(row.id, row.version, row.head, row.arrays))
