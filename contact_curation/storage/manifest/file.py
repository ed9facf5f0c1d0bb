"""Manifests on disk: Parquet, CSV or JSON by the file's ending, with the same content in each.

    JSON      one object: the head, and a toss per line
    CSV       the table, a toss per line, an empty cell is no value; the head of m.csv is beside it in m.provenance.json
              (format version 1 had it in comment lines `# name: JSON` before the table), with the number of
              tosses (`tosses`) and a digest of the table (`table_sha256`); while both are replaced, also the head of
              the table before
    Parquet   a row per toss; the head as JSON in the schema's metadata, under `contact_curation`

Text is UTF-8, lines end with LF, and cells with commas, quotes or line ends are quoted. The reasons in a cell are a
JSON list. JSON has no numbers that are not finite: strings "NaN", "Infinity" and "-Infinity" stand for them, in the
head, too, as for an `influence_bound` without a bound. Stamps have up to 63 bits, of which JavaScript and
spreadsheets keep 53. The head is everything that is not about a single toss. Tosses come by rank, and then those
without one. The same manifest always gives the same bytes.
"""

import csv
import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, fields
from hashlib import sha256
from io import BytesIO, StringIO
from pathlib import Path
from types import NoneType
from typing import Any, NamedTuple

import pyarrow as pa
import pyarrow.parquet as pq

from contact_curation.errors import ContactCurationError, InvalidValueError, UnreadableInputError
from contact_curation.files import check_version, read_bounded, write_atomically
from contact_curation.storage.manifest.manifest import Manifest, ManifestRow
from contact_curation.storage.outputs import CSV, PROVENANCE
from contact_curation.storage.parquet import groups_of, text_bytes, texts_of
from contact_curation.storage.provenance import InputProvenance, RunProvenance

FORMAT = "contact_curation_manifest"
VERSION = 2
FIRST_NAMES = {"kept": "selected", "gated": "rejected", "kept_gram": "selected_gram", "answer": "optimum_shift"}
"""Names of columns and diagnostics in version 1, and their present names."""

FIRST_SHIFT_NAMES = {"off": "distance", "by_chance": "at_random"}
"""Names in version 1's `answer`, and their present names."""

ROWS = "tosses"
NOT_FINITE = {"NaN": math.nan, "Infinity": math.inf, "-Infinity": -math.inf}
"""Numbers that JSON does not have, and the strings that stand for them."""
ACCEPTED: dict[object, tuple[type, ...]] = {
    str: (str,),
    bool: (bool,),
    int: (int,),
    float: (float, int),
    int | None: (int, NoneType),
    float | None: (float, int, NoneType),
    tuple[str, ...]: (list, tuple),
}
KINDS = {field.name: ACCEPTED[field.type] for field in fields(ManifestRow)}
"""Types that a value of a row may have in a file, by the row's field."""

LARGEST_BITS = 63
"""Of a whole number."""

FLOATS = {field.name for field in fields(ManifestRow) if field.type in (float, float | None)}


type Parsed = tuple[Mapping[str, Any], Iterator[ManifestRow]]
"""The head of a manifest and its rows, which are read after the head's version was checked. Bytes that are no manifest raise
ValueError, LookupError or TypeError."""


def head_of(manifest: Manifest) -> dict[str, Any]:
    """Everything in a manifest but the rows, as JSON values."""
    head = {FORMAT: VERSION, **asdict(manifest.run), "diagnostics": dict(manifest.diagnostics)}
    return {name: _with_strings(value) for name, value in head.items()}


def to_json(manifest: Manifest) -> bytes:
    """Writes a manifest as JSON; the same manifest always gives the same bytes."""
    head = json.dumps(head_of(manifest), indent=2, ensure_ascii=False, allow_nan=False)
    rows = [json.dumps(_with_strings(asdict(row)), ensure_ascii=False, allow_nan=False) for row in manifest.rows]
    listed = ",\n    ".join(rows)
    return f'{head[:-2]},\n  "{ROWS}": [\n    {listed}\n  ]\n}}\n'.encode()


def from_json(data: bytes) -> Parsed:
    """Reads what `to_json` wrote."""
    content = json.loads(data)
    return content, (row_of(_with_floats(row)) for row in content[ROWS])


def row_of(values: Mapping[str, Any]) -> ManifestRow:
    """Makes a row from its values by name; the names of version 1 are accepted, too.

    Raises:
        ValueError: a value has another type than its field.
    """
    named = _renamed(values, FIRST_NAMES)
    for name, value in named.items():
        if type(value) not in KINDS.get(name, (type(value),)) or (type(value) is int and value.bit_length() > LARGEST_BITS):
            raise ValueError(f"{name}: found {repr(value)[:40]}, expected {' or '.join(kind.__name__ for kind in KINDS[name])}")
    if not all(isinstance(reason, str) for reason in values["reasons"]):
        raise ValueError(f"reasons: found {repr(values['reasons'])[:40]}, expected lines of text")
    return ManifestRow(**{**named, "reasons": tuple(values["reasons"])})


def _renamed(values: Mapping[str, Any], names: Mapping[str, str]) -> dict[str, Any]:
    return {names.get(name, name): value for name, value in values.items()}


def _with_strings(value: Any) -> Any:
    def leaf(number: Any) -> Any:
        if isinstance(number, float) and not math.isfinite(number):
            return next(name for name, meant in NOT_FINITE.items() if str(meant) == str(number))
        return number

    return _mapped(value, leaf)


def _with_floats(row: Mapping[str, Any]) -> dict[str, Any]:
    return {name: _with_numbers(value) if name in FLOATS else value for name, value in row.items()}


def _with_numbers(value: Any) -> Any:
    return _mapped(value, lambda text: NOT_FINITE.get(text, text) if isinstance(text, str) else text)


def _mapped(value: Any, leaf: Callable[[Any], Any]) -> Any:
    """`value` with `leaf` applied to everything in it that is neither a list nor a dict."""
    if isinstance(value, Mapping):
        return {name: _mapped(part, leaf) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_mapped(part, leaf) for part in value]
    return leaf(value)


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
    """Writes the table of a manifest as CSV, without the head; the same manifest always gives the same bytes."""
    rows = [COLUMNS, *([_cell(getattr(row, name)) for name in COLUMNS] for row in manifest.rows)]
    return "".join(f"{_line(row)}\n" for row in rows).encode()


def _line(cells: Sequence[str]) -> str:
    """Writes a line. Cells with any line-end character are quoted; csv would quote only those with its own line end."""
    out = StringIO(newline="")
    csv.writer(out, lineterminator="\r\n").writerow(cells)
    return out.getvalue().removesuffix("\r\n")


def provenance_of(path: Path) -> Path:
    """The file beside a CSV manifest that contains its head."""
    return path.with_suffix(PROVENANCE)


TABLE, REPLACED = "table_sha256", "replaced"
"""Keys in the provenance of a table: its digest, and, while both files are replaced, the provenance of the previous table."""


def provenance_bytes(manifest: Manifest, table: bytes, replaced: Mapping[str, Any] | None = None) -> bytes:
    """The content of the provenance file; it contains the number of tosses, so that a table that was cut is noticed."""
    head = {**head_of(manifest), ROWS: len(manifest.rows), TABLE: sha256(table).hexdigest()}
    if replaced:
        head[REPLACED] = dict(replaced)
    return (json.dumps(head, indent=2, ensure_ascii=False, allow_nan=False) + "\n").encode()


def joined_csv(provenance: bytes, table: bytes) -> bytes:
    """Joins head and table in one text, the head in comment lines before the table, as in version 1 of the format."""
    lines = [f"{COMMENT}{name}: {json.dumps(value)}\n" for name, value in _head_of_table(provenance, table).items()]
    return "".join(lines).encode() + table


def _head_of_table(provenance: bytes, table: bytes) -> dict[str, Any]:
    """The head of the table in a provenance file: the newer one, unless a writer died before it replaced the table."""
    head = dict(json.loads(provenance))
    replaced = head.pop(REPLACED, None)
    return head if replaced is None or head[TABLE] == sha256(table).hexdigest() else dict(replaced)


def _write_csv(manifest: Manifest, path: Path, table: bytes) -> None:
    """Replaces both files. This cannot happen at once, so meanwhile the provenance contains the heads of both tables."""
    beside = provenance_of(path)
    try:
        before = _head_of_table(beside.read_bytes(), path.read_bytes())
    except (OSError, ValueError, LookupError, TypeError, RecursionError):  # there is no valid pair of files
        before = None
    write_atomically(beside, provenance_bytes(manifest, table, before))
    write_atomically(path, table)
    if before:
        write_atomically(beside, provenance_bytes(manifest, table))


def _whole(path: Path, data: bytes) -> bytes:
    """The text of a CSV manifest with its head, which is in the file beside it, or (version 1) in the table's file."""
    if data.startswith(COMMENT.encode()):
        return data
    beside = provenance_of(path)
    if not beside.is_file():
        raise ValueError(f"found no {beside.name} beside it: keep the two together, or rank again")
    return joined_csv(read_bounded(beside, LARGEST_BYTES, "the provenance of a manifest"), data)


def from_csv(data: bytes) -> Parsed:
    """Reads a table after comment lines with its head."""
    lines = data.decode().split("\n")
    comments = 0
    while lines[comments].startswith(COMMENT):
        comments += 1
    parts = (line.removeprefix(COMMENT).partition(": ") for line in lines[:comments])
    head = {name: json.loads(value) for name, _, value in parts}
    return head, _csv_rows(head, lines[comments:])


def _csv_rows(head: Mapping[str, Any], lines: list[str]) -> Iterator[ManifestRow]:
    try:
        rows = [_row(cells) for cells in csv.DictReader(StringIO("\n".join(lines), newline=""), strict=True)]
    except csv.Error as error:
        raise ValueError(f"its table is malformed: {error}") from error
    if len(rows) != head[ROWS] or lines[-1]:
        raise ValueError(f"it was cut: {head[ROWS]} tosses are announced")
    yield from rows


def _row(cells: dict[str, str]) -> ManifestRow:
    named = _renamed(cells, FIRST_NAMES)
    if set(named) != set(COLUMNS) or None in named.values():
        raise ValueError(f"its columns are {', '.join(map(str, cells))}")
    return row_of({field.name: _value(field.name, field.type, named[field.name]) for field in fields(ManifestRow)})


def _value(name: str, kind: object, text: str) -> Any:
    try:
        return READERS[kind](text)
    except (LookupError, ValueError) as error:
        raise ValueError(f"{name}: found {text[:40]!r}; if a spreadsheet wrote it, give the file that rank wrote") from error


def _cell(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    return json.dumps(value, ensure_ascii=False) if isinstance(value, tuple) else str(value)


METADATA_KEY = b"contact_curation"
TYPES: dict[object, pa.DataType] = {
    str: pa.string(),
    bool: pa.bool_(),
    int: pa.int64(),
    float: pa.float64(),
    int | None: pa.int64(),
    float | None: pa.float64(),
    tuple[str, ...]: pa.list_(pa.string()),
}
"""By the type of the row's field."""
OPTIONAL = (int | None, float | None)


def to_parquet(manifest: Manifest) -> bytes:
    """Writes a manifest as Parquet; the same manifest always gives the same bytes."""
    head = json.dumps(head_of(manifest), ensure_ascii=False).encode()
    columns = [pa.field(field.name, TYPES[field.type], field.type in OPTIONAL) for field in fields(ManifestRow)]
    schema = pa.schema(columns, metadata={METADATA_KEY: head})
    arrays = [pa.array([getattr(row, column.name) for row in manifest.rows], column.type) for column in columns]
    out = BytesIO()
    pq.write_table(pa.Table.from_arrays(arrays, schema=schema), out, compression="zstd", write_page_checksum=True)
    return out.getvalue()


def from_parquet(data: bytes) -> Parsed:
    """Reads what `to_parquet` wrote.

    Raises:
        ValueError: there are more rows, reasons or text than a manifest may have.
    """
    file = pq.ParquetFile(BytesIO(data), page_checksum_verification=True)
    held = file.metadata
    groups = groups_of(file)
    values = [sum(group.column(number).num_values for group in groups) for number in range(held.num_columns)]
    rows = max(held.num_rows, *values)  # a small file can declare any number of rows, and of reasons in a row
    most = min(MOST_ROWS, 2 * len(data))  # each row has its own name and times, even if compressed
    if rows > most:
        raise ValueError(f"found {rows} rows, expected at most {most} in {len(data)} bytes")
    head = (file.schema_arrow.metadata or {}).get(METADATA_KEY)
    if head is None:
        raise ValueError("it has no metadata contact_curation, which other programs leave out: give the file that rank wrote")
    return json.loads(head), _parquet_rows(
        pq.ParquetFile(BytesIO(data), page_checksum_verification=True, read_dictionary=texts_of(file))
    )


def _parquet_rows(file: pq.ParquetFile) -> Iterator[ManifestRow]:
    size = 0
    for batch in file.iter_batches(ROWS_AT_ONCE):
        size += sum(map(text_bytes, batch.columns))
        if size > LARGEST_BYTES:
            raise ValueError(f"its text has more than {LARGEST_BYTES} bytes")
        yield from map(row_of, batch.to_pylist())


LARGEST_BYTES = 1 << 31
"""Largest manifest file, and text in it [bytes]."""
ROWS_AT_ONCE = 4096
"""Number of rows of a Parquet file in memory as Python objects, beside those that were made of them."""
MOST_ROWS = 10_000_000
"""Largest number of rows of a manifest."""
AROUND = 20
"""Number of characters that an error message shows on each side of one that cannot be written."""


class _Format(NamedTuple):
    write: Callable[[Manifest], bytes]
    read: Callable[[bytes], Parsed]


FORMATS = {
    ".parquet": _Format(to_parquet, from_parquet),
    CSV: _Format(to_csv, from_csv),
    ".json": _Format(to_json, from_json),
}


def check_names(names: Iterable[str]) -> None:
    """Refuses names that no manifest can hold.

    Raises:
        InvalidValueError: one is not Unicode.
    """
    for name in names:
        try:
            name.encode()
        except UnicodeEncodeError as error:
            raise InvalidValueError("manifest", f"{name!r} in it", "names and paths that are Unicode") from error


def write_manifest(manifest: Manifest, path: Path) -> None:
    """Writes a manifest, whole or not at all; the same manifest always gives the same bytes.

    Raises:
        InvalidValueError: the ending of `path` is not one of `FORMATS`, it cannot be written, or a name is not Unicode.
    """
    write = _format(path).write
    try:
        data = write(manifest)
        if path.suffix == CSV:
            _write_csv(manifest, path, data)
        else:
            write_atomically(path, data)
    except UnicodeEncodeError as error:
        near = error.object[max(0, error.start - AROUND) : error.end + AROUND]
        raise InvalidValueError("manifest", f"{near!r} in it", "names and paths that are Unicode") from error


def read_manifest(path: Path) -> Manifest:
    """Reads a manifest that `write_manifest` wrote.

    Raises:
        InvalidValueError: the ending of `path` is not one of `FORMATS`.
        UnreadableInputError: the file is no manifest.
        NewerVersionError: the manifest has a newer format version.
    """
    read = _format(path).read
    try:
        data = read_bounded(path, LARGEST_BYTES, "a manifest of `contact-curation rank`")
        head, rows = read(_whole(path, data) if path.suffix == CSV else data)
        check_version(path, "a manifest", head[FORMAT], VERSION)
        return manifest_of(head, rows)
    except UnreadableInputError:
        raise
    except (
        OSError,
        ValueError,
        LookupError,
        TypeError,
        AttributeError,
        RecursionError,
        pa.ArrowException,
        ContactCurationError,
    ) as error:
        raise UnreadableInputError(path, f"is no manifest of `contact-curation rank`: {_why(error)}") from error


def manifest_of(head: Mapping[str, Any], rows: Iterable[ManifestRow]) -> Manifest:
    """Makes a manifest from a head and rows, as the readers of the formats return them."""
    run = {field.name: head[field.name] for field in fields(RunProvenance) if field.name not in ("body", "settings")}
    inputs = tuple(InputProvenance(**{**entry, "losses": tuple(entry["losses"])}) for entry in head["inputs"])
    run["body"], run["settings"] = head.get("body"), tuple(head.get("settings", ()))  # older manifests have none
    if type(run["body"]) not in (dict, NoneType):
        raise ValueError(f"body: found {repr(run['body'])[:40]}, expected the values of a body by name")
    run.update(command=tuple(head["command"]), inputs=inputs, influence_bound=_with_numbers(head["influence_bound"]))
    diagnostics = _renamed(_with_numbers(head["diagnostics"]), FIRST_NAMES)
    if "optimum_shift" in diagnostics:
        diagnostics["optimum_shift"] = _renamed(diagnostics["optimum_shift"], FIRST_SHIFT_NAMES)
    return Manifest(RunProvenance(**run), tuple(rows), diagnostics)


def _why(error: Exception) -> str:
    """Says in words what a reader's error means."""
    if isinstance(error, KeyError):
        return f"found no key {error.args[0]!r}"
    if isinstance(error, IndexError):
        return "found a row that is cut off"
    return "found a value of another type" if isinstance(error, TypeError) else str(error)


def _format(path: Path) -> _Format:
    if path.suffix not in FORMATS:
        raise InvalidValueError("manifest", path, f"a file ending in {', '.join(FORMATS)}")
    return FORMATS[path.suffix]
