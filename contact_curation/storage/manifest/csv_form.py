"""Manifests as CSV: comment lines `# name: JSON` with all that is not about one toss, then the table, a toss per line.

Empty cells are values that are not there; reasons are a JSON list.
"""

import csv
import json
from collections.abc import Callable
from dataclasses import fields
from io import StringIO
from typing import Any

from contact_curation.storage.manifest.json_form import ROWS, head_of, manifest_of, row_of
from contact_curation.storage.manifest.manifest import Manifest, ManifestRow

COMMENT = "# "
COLUMNS = tuple(field.name for field in fields(ManifestRow))
BOOLEANS = {"true": True, "false": False}
READERS: dict[object, Callable[[str], Any]] = {
    str: str,
    bool: BOOLEANS.__getitem__,
    int: int,
    float: float,
    int | None: lambda text: int(text) if text else None,
    float | None: lambda text: float(text) if text else None,
    tuple[str, ...]: json.loads,
}
"""By the type of the row's field."""


def to_csv(manifest: Manifest) -> bytes:
    """The same manifest always gives the same bytes."""
    out = StringIO(newline="")
    for name, value in {**head_of(manifest), ROWS: len(manifest.rows)}.items():
        out.write(f"{COMMENT}{name}: {json.dumps(value, ensure_ascii=False)}\n")
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows([_cell(getattr(row, name)) for name in COLUMNS] for row in manifest.rows)
    return out.getvalue().encode()


def from_csv(data: bytes) -> Manifest:
    """Reads what `to_csv` wrote.

    Raises:
        ValueError, KeyError, TypeError: it is something else.
    """
    lines = data.decode().split("\n")
    comments = 0
    while lines[comments].startswith(COMMENT):
        comments += 1
    parts = (line.removeprefix(COMMENT).partition(": ") for line in lines[:comments])
    head = {name: json.loads(value) for name, _, value in parts}
    table = csv.DictReader(StringIO("\n".join(lines[comments:]), newline=""), strict=True)
    try:
        rows = tuple(_row(cells) for cells in table)
    except csv.Error as error:
        raise ValueError(f"its table is malformed: {error}") from error
    if len(rows) != head[ROWS] or lines[-1]:
        raise ValueError(f"it was cut: {head[ROWS]} tosses are announced")
    return manifest_of(head, rows)


def _row(cells: dict[str, str]) -> ManifestRow:
    if set(cells) != set(COLUMNS) or None in cells.values():
        raise ValueError(f"its columns are {', '.join(map(str, cells))}")
    return row_of({field.name: READERS[field.type](cells[field.name]) for field in fields(ManifestRow)})


def _cell(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    return json.dumps(value, ensure_ascii=False) if isinstance(value, tuple) else str(value)
