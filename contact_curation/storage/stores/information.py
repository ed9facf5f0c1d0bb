"""What is known of every toss at the newest parameters: the scorer keeps it before it announces it."""

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
    """Version 1 had its states in a second file, and lost tosses where the two disagreed."""
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
"""What must agree for two records at the same parameters to be comparable."""
PAGE = 256
"""Records read at a time."""


class StoredInformation(NamedTuple):
    """A record of the store and its place in the order, from 1."""

    sequence: int
    information: TossInformation


class InformationStore(Store):
    """TossInformation by toss and parameters version, in one SQLite file. Use it as a context manager.

    Args:
        path: path of the file; made when there is none.

    Attributes:
        states: what its node must remember beside the records.

    Raises:
        UnreadableInputError: the file is no information store, or one of a newer version.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path, SCHEMA)
        self._table = SequencedTable(self._store, "information")
        self.states = States(self._store)

    def add(self, information: TossInformation) -> Added:
        """Stores a record; one of the same toss and parameters that is stored already stays as it is.

        The numbers of a second scoring may differ in their last digits; the first ones count, because they were announced.

        Raises:
            InvalidValueError: what is stored was scored at these parameters in another way (model, estimator, bound, blocks).
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
        """The next `limit` records behind `sequence`, of all versions."""
        return tuple(_stored(row) for row in self._table.after(sequence, limit))

    def all_of(self, parameters_version: str) -> Iterator[StoredInformation]:
        """Every record of a version, in the order of their sequence, a page in memory at a time."""
        sequence = 0
        while rows := self._table.after(sequence, PAGE, parameters_version):
            yield from (_stored(row) for row in rows)
            sequence = rows[-1].sequence

    def count(self, parameters_version: str) -> int:
        """How many records of a version there are."""
        return self._table.count(parameters_version)

    @property
    def last_sequence(self) -> int:
        """The newest sequence number; 0 while there is none."""
        return self._table.last_sequence

    @property
    def versions(self) -> tuple[str, ...]:
        """The parameters versions, in the order they came."""
        return tuple(self._table.versions())

    def drop_version(self, parameters_version: str) -> None:
        """Drops the records of a version, which can be scored again."""
        self._table.drop_version(parameters_version)

    def keep_newest_versions(self, count: int = 2) -> tuple[str, ...]:
        """Drops the records of all but the newest versions, which can be scored again.

        Returns:
            The versions dropped.

        Raises:
            InvalidValueError: no version would be left.
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
    """A record without its key, the toss and the version: its plain fields as JSON, its arrays as a blob."""
    values = {field.name: getattr(information, field.name) for field in fields(information)}
    arrays = {name: value for name, value in values.items() if isinstance(value, np.ndarray)}
    head = {name: value for name, value in values.items() if name not in (*arrays, "toss_id", "parameters_version")}
    blocks = [asdict(block) for block in information.blocks]
    return json.dumps({**head, "blocks": blocks}, default=_number), arrays_to_blob(arrays)


def unpacked_information(toss_id: str, version: str, head: str, arrays: bytes) -> TossInformation:
    """The record that `packed_information` packed."""
    known = json.loads(head)
    known["blocks"] = tuple(ParameterBlock(**block) for block in known["blocks"])
    return TossInformation(toss_id=toss_id, parameters_version=version, **known, **arrays_from_blob(arrays))


def _number(value: object) -> object:
    """NumPy's scalars as JSON's numbers."""
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{value!r} is no number")


def _stored(row: Row) -> StoredInformation:
    return StoredInformation(row.sequence, unpacked_information(row.id, row.version, row.head, row.arrays))
