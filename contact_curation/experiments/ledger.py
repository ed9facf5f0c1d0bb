"""The finished cells of an experiment: a file to which a line of JSON is added for each, and from which it goes on.

The first line says of which experiment and which tosses, lines of one name add to that; lines are never changed. What an
interruption tore is taken off.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from contact_curation.errors import InvalidValueError, UnreadableInputError
from contact_curation.experiments.cell_run import ONE_THREAD, Row
from contact_curation.version import __version__


def identity_of(experiment: str) -> dict[str, str]:
    """What must be the same for rows to stand in one table, whatever the tosses."""
    return {"experiment": experiment, "package version": __version__, "loss": ONE_THREAD.in_words}


class Ledger:
    """One file.

    Args:
        path: of the file, which need not be there yet.
        identity: what its first line says.

    Raises:
        InvalidValueError: it belongs to something else, or cannot be written.
        UnreadableInputError: it is no such file.
    """

    def __init__(self, path: Path, identity: Mapping[str, str]) -> None:
        self._path = path
        self._rows: dict[str, tuple[Row, ...]] = {}
        self._identity: dict[str, Any] = dict(identity)
        lines = _whole_lines(path)
        if not lines:
            self._append(dict(identity))
            return
        first, *others = (_document(line, path) for line in lines)
        self._identity = first
        for name, value in identity.items():
            self._expect(name, value)
        for document in others:
            if len(document) == 1:  # of `belongs_to`
                self._identity |= document
                continue
            if not {"key", "rows"} <= document.keys():
                raise UnreadableInputError(path, "a line has no key and rows, expected the file that `reproduce` wrote")
            self._rows[document["key"]] = tuple(_row(values) for values in document["rows"])

    def __contains__(self, key: str) -> bool:
        return key in self._rows

    @property
    def keys(self) -> tuple[str, ...]:
        """Of all finished cells, in the order in which they were finished."""
        return tuple(self._rows)

    def rows(self, key: str) -> tuple[Row, ...]:
        """The rows of a finished cell."""
        return self._rows[key]

    def add(self, key: str, rows: Sequence[Row], seconds: float) -> None:
        """A cell is finished."""
        self._rows[key] = tuple(rows)
        self._append({"key": key, "rows": list(rows), "seconds": round(seconds, 3)})

    def belongs_to(self, name: str, value: str) -> None:
        """What must be the same from now on, and as it was if the file says so; InvalidValueError where it is not."""
        if name in self._identity:
            self._expect(name, value)
        else:
            self._identity[name] = value
            self._append({name: value})

    def _expect(self, name: str, value: str) -> None:
        if self._identity.get(name) != value:
            found = self._identity.get(name, "none")
            raise InvalidValueError(f"{name} of {self._path}", found, f"{value}, or another --out")

    def _append(self, document: Mapping[str, Any]) -> None:
        try:
            with self._path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(document) + "\n")
        except OSError as error:
            raise InvalidValueError("--out", self._path, f"a folder that can be written ({error.strerror})") from error


def _row(values: Mapping[str, Any]) -> Row:
    """A row by its names of today: what is `selected` was `kept` in version 0.1."""
    return {f"selected{name[4:]}" if name.partition("_")[0] == "kept" else name: value for name, value in values.items()}


def _whole_lines(path: Path) -> list[str]:
    """Lines that end; the rest is taken off the file."""
    if not path.exists():
        return []
    try:
        data = path.read_bytes()
        whole = data[: data.rfind(b"\n") + 1]
        if len(whole) < len(data):
            with path.open("r+b") as file:
                file.truncate(len(whole))
        return whole.decode().splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise UnreadableInputError(path, str(error)) from error


def _document(line: str, path: Path) -> dict[str, Any]:
    try:
        document = json.loads(line)
    except ValueError as error:
        raise UnreadableInputError(path, f"a line is no JSON ({error})") from error
    if not isinstance(document, dict):
        raise UnreadableInputError(path, "a line is no JSON object")
    return document
