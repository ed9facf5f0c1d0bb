"""Tables in Parquet, as pandas and polars write them, as lines of text that commas separate."""

import csv
from collections.abc import Iterator
from io import StringIO
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from contact_curation.errors import UnreadableInputError, why_unreadable
from contact_curation.storage.parquet import groups_of, text_bytes, texts_of

MAGIC = b"PAR1"
ROWS_AT_ONCE = 4096
LARGEST_GROUP = 1 << 28
"""Bytes of a row group's columns that are read."""

MOST_IN_A_BYTE = 8
"""Rows: each has a time or a position of its own, so that a file with more claims them without having them."""

LONGEST_TEXT = 1 << 10
"""Bytes of text in a row."""

BYTES, NUMBERS_IN_BYTES, TEXT = ("BYTE_ARRAY", "FIXED_LEN_BYTE_ARRAY"), ("DECIMAL", "FLOAT16"), "STRING"
"""Types of columns that are stored as bytes, and what those of them are that hold numbers or text."""

UNNAMED_INDEX = "__index_level_0__"
"""pandas' name of an index without one."""


def is_parquet(path: Path) -> bool:
    """Whether a file begins as Parquet does."""
    try:
        with path.open("rb") as file:
            return file.read(len(MAGIC)) == MAGIC
    except OSError:
        return False


def parquet_lines(path: Path) -> Iterator[str]:
    """A line with the names of columns, then one for each row; values that are missing are empty.

    Fields of structs are columns of their own, `pose.position.x`, and times become whole nanoseconds, as their names say,
    those of an index without a name in a column `time`. Columns of lists and of bytes are left out, and text in structs.

    Raises:
        UnreadableInputError: the file is damaged, or claims more rows or bytes than it can have.
    """
    try:
        with pq.ParquetFile(path, page_checksum_verification=True) as file:
            texts = texts_of(file)
        with pq.ParquetFile(path, page_checksum_verification=True, read_dictionary=texts) as file:
            yield from _lines(file, path)
    except OSError as error:  # also of pages that do not fit their checksum
        raise UnreadableInputError(path, f"cannot be read as Parquet: {why_unreadable(path, error)}") from error
    except (ValueError, LookupError, pa.ArrowException) as error:
        raise UnreadableInputError(path, f"is damaged, expected a table in Parquet: {error}") from error


def _lines(file: pq.ParquetFile, path: Path) -> Iterator[str]:
    size = path.stat().st_size
    flat = set(file.schema_arrow.names)
    wanted = {column.path: at for at, column in enumerate(file.schema) if _is_number_or_text(column, column.path in flat)}
    rows = 0
    for group in groups_of(file, [*wanted.values()]):
        needed = sum(group.column(at).total_uncompressed_size for at in wanted.values())
        rows += max([group.num_rows, *(group.column(at).num_values for at in wanted.values())])
        if needed > LARGEST_GROUP or rows > MOST_IN_A_BYTE * size:
            what = f"found {rows} rows, {needed} bytes in a row group, in a file of {size} bytes"
            expected = f"at most {LARGEST_GROUP} bytes, and {MOST_IN_A_BYTE} rows a byte"
            raise UnreadableInputError(path, f"{what}, expected {expected}")
    for number, batch in enumerate(file.iter_batches(ROWS_AT_ONCE, columns=[*wanted])):
        table = pa.Table.from_batches([batch])
        while any(pa.types.is_struct(field.type) for field in table.schema):
            table = table.flatten()
        texts = [column.combine_chunks() for column in table.columns if pa.types.is_dictionary(column.type)]
        if sum(map(text_bytes, texts)) > LONGEST_TEXT * len(batch):
            what = f"found more than {LONGEST_TEXT} bytes of text in a row"
            raise UnreadableInputError(path, f"{what}, expected numbers and names")
        if not number:
            yield _line([_name(field) for field in table.schema])
        yield from map(_line, zip(*map(_values, table.columns), strict=True))


def _is_number_or_text(column: pq.ColumnSchema, flat: bool) -> bool:
    kind = column.logical_type.type
    number = column.physical_type not in BYTES or kind in NUMBERS_IN_BYTES
    return column.max_repetition_level == 0 and (number or (flat and kind == TEXT))


def _name(field: pa.Field) -> str:
    name = "time" if field.name == UNNAMED_INDEX and pa.types.is_temporal(field.type) else str(field.name)
    return f"{name} [ns]" if pa.types.is_timestamp(field.type) or pa.types.is_duration(field.type) else name


def _values(column: pa.ChunkedArray) -> list[object]:
    """As Python has them, times in ns, those of day as text."""
    if pa.types.is_timestamp(column.type):
        column = column.cast(pa.timestamp("ns", column.type.tz)).cast(pa.int64())
    elif pa.types.is_duration(column.type):
        column = column.cast(pa.duration("ns")).cast(pa.int64())
    elif pa.types.is_time(column.type):
        column = column.cast(pa.string())
    return list(column.to_pylist())


def _line(values: object) -> str:
    text = StringIO()
    csv.writer(text, lineterminator="").writerow(values)  # type: ignore[arg-type]
    return text.getvalue()
