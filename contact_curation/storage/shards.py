"""A shard: a Parquet file with records of one recording, written once, whole or not at all.

A row is a record: its id, its plain fields as JSON, its arrays as a blob (`stores.record_table`). The file's metadata contain
what is common to all records, as JSON after its checksum. Pages have checksums, too, and no statistics, which would have none.
A damaged shard counts as missing.
"""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import batched
from pathlib import Path
from typing import Any, NamedTuple
from zlib import crc32

from contact_curation.files import replacing

NOTE = b"contact_curation.note"
ROWS = 64
"""Number of rows of a row group, which are in memory at a time."""


class ShardRow(NamedTuple):
    """A record: its id, its plain fields as JSON, its arrays as a blob."""

    id: str
    head: str
    arrays: bytes


@contextmanager
def writing_shard(path: Path) -> Iterator["ShardWriter"]:
    """Opens a shard for writing; it gets its name when the block ends without an error.

    Raises:
        UnwritableOutputError: it cannot be written there.
    """
    import pyarrow as pa
    from pyarrow import parquet

    schema = pa.schema([("id", pa.string()), ("head", pa.string()), ("arrays", pa.binary())])
    with (
        replacing(path) as file,
        parquet.ParquetWriter(
            file, schema, compression="zstd", use_dictionary=False, write_page_checksum=True, write_statistics=False
        ) as writer,
    ):
        shard = ShardWriter(writer, schema)
        yield shard
        shard.flush()
        note = json.dumps(shard.note).encode()
        writer.add_key_value_metadata({NOTE: b"%08x " % crc32(note) + note})


class ShardWriter:
    """Writes the rows of a shard.

    Attributes:
        note: what is common to all rows; set it before the end of the block.
    """

    def __init__(self, writer: Any, schema: Any) -> None:
        self.note: Mapping[str, Any] = {}
        self._writer, self._schema = writer, schema
        self._rows: list[ShardRow] = []

    def add(self, row: ShardRow) -> None:
        self._rows.append(row)
        if len(self._rows) == ROWS:
            self.flush()

    def flush(self) -> None:
        """Writes the rows that were added."""
        import pyarrow as pa

        if self._rows:
            columns = [list(column) for column in zip(*self._rows, strict=True)]
            self._writer.write_table(pa.table(dict(zip(self._schema.names, columns, strict=True)), self._schema))
            self._rows.clear()


class Shard:
    """An existing shard.

    Attributes:
        note: what is common to all its rows.
    """

    def __init__(self, path: Path) -> None:
        from pyarrow import parquet

        self._file = parquet.ParquetFile(path, page_checksum_verification=True)
        checksum, _, note = (self._file.metadata.metadata or {})[NOTE].partition(b" ")
        if int(checksum, 16) != crc32(note):
            raise ValueError("damaged note")
        self.note: dict[str, Any] = json.loads(note)

    def rows(self) -> Iterator[ShardRow]:
        """The rows in their order, one row group in memory at a time."""
        for group in range(self._file.num_row_groups):
            table = self._file.read_row_group(group)
            yield from (ShardRow(*row) for row in zip(*(column.to_pylist() for column in table.columns), strict=True))


def shard_at(path: Path) -> Shard | None:
    """Opens the shard at a path; None if it does not exist or is damaged."""
    from pyarrow import ArrowException

    try:
        shard = Shard(path)
        for _ in batched(shard.rows(), ROWS):  # reads all pages and checks their checksums
            pass
    except (OSError, KeyError, ValueError, ArrowException):
        return None
    return shard
