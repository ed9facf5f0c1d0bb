"""Parquet of unknown origin: what is said of columns is looked at before anything is read, and text before it is repeated.

A text that is stored once can stand in any number of rows.
"""

from collections.abc import Sequence

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq


def groups_of(file: pq.ParquetFile, columns: Sequence[int] | None = None) -> list[pq.RowGroupMetaData]:
    """The row groups, whose `column` can be asked for those with these indices, by default for all.

    Where the description of a column is damaged, pyarrow 26 ends the process if `column` is asked for it. A reader of no rows,
    which opens the same columns, fails instead.

    Raises:
        OSError: the description of a column is damaged.
    """
    numbers = range(file.metadata.num_row_groups)
    for number in numbers:
        for _ in file.reader.iter_batches(0, [number], columns, use_threads=False):
            pass
    return [file.metadata.row_group(number) for number in numbers]


def texts_of(file: pq.ParquetFile) -> list[str]:
    """Paths of the columns of text and bytes, to be read as dictionaries (`read_dictionary`)."""
    return [column.path for column in file.schema if column.physical_type == "BYTE_ARRAY"]


def text_bytes(column: pa.Array) -> int:
    """Bytes of the text in a column, or in its lists, with each text as often as it stands there."""
    values = column.flatten() if pa.types.is_list(column.type) or pa.types.is_large_list(column.type) else column
    if not isinstance(values, pa.DictionaryArray):
        return int(values.nbytes)
    return int(pc.sum(pc.binary_length(values.dictionary).take(values.indices)).as_py() or 0)
