"""Text in Parquet: one that is stored once can stand in any number of rows, so it is counted before it is repeated."""

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq


def texts_of(file: pq.ParquetFile) -> list[str]:
    """Paths of the columns of text and bytes, to be read as dictionaries (`read_dictionary`)."""
    return [column.path for column in file.schema if column.physical_type == "BYTE_ARRAY"]


def text_bytes(column: pa.Array) -> int:
    """Bytes of the text in a column, or in its lists, with each text as often as it stands there."""
    values = column.flatten() if pa.types.is_list(column.type) or pa.types.is_large_list(column.type) else column
    if not isinstance(values, pa.DictionaryArray):
        return int(values.nbytes)
    return int(pc.sum(pc.binary_length(values.dictionary).take(values.indices)).as_py() or 0)
