"""Manifests as Parquet: a row per toss; all that is not about one toss as JSON in the schema's metadata."""

import json
from dataclasses import fields
from io import BytesIO

import pyarrow as pa
import pyarrow.parquet as pq

from contact_curation.storage.manifest.json_form import head_of, manifest_of, row_of
from contact_curation.storage.manifest.manifest import Manifest, ManifestRow

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
    """The same manifest always gives the same bytes."""
    head = json.dumps(head_of(manifest), ensure_ascii=False).encode()
    columns = [pa.field(field.name, TYPES[field.type], field.type in OPTIONAL) for field in fields(ManifestRow)]
    schema = pa.schema(columns, metadata={METADATA_KEY: head})
    arrays = [pa.array([getattr(row, column.name) for row in manifest.rows], column.type) for column in columns]
    out = BytesIO()
    pq.write_table(pa.Table.from_arrays(arrays, schema=schema), out, compression="zstd")
    return out.getvalue()


def from_parquet(data: bytes) -> Manifest:
    """Reads what `to_parquet` wrote.

    Raises:
        ValueError, KeyError, TypeError: it is something else.
    """
    table = pq.read_table(BytesIO(data))
    head = json.loads((table.schema.metadata or {})[METADATA_KEY])
    return manifest_of(head, tuple(row_of(row) for row in table.to_pylist()))
