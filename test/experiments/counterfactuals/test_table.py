"""The Parquet file of refits: every value comes back, whatever the order of the rows, and its columns have units."""

from pathlib import Path

import pyarrow.parquet as pq
import pytest

from contact_curation.errors import UnreadableInputError
from contact_curation.experiments.cell_run import Row
from contact_curation.experiments.counterfactuals.table import FORESEEN_BY, NUMBERS, SCHEMA, WHOLE, read_refits, write_refits


def row(draw: int) -> Row:
    numbers = {name: 0.5 * place + draw for place, name in enumerate(NUMBERS)}
    whole = dict.fromkeys(WHOLE, 7.0) | {"draw": float(draw)}
    said = {name: 0.25 * place - draw for place, name in enumerate(FORESEEN_BY)}
    return {"body": "cube", **whole, **numbers, **said, "converged": 1.0, "failed": "", "tosses": "toss-3 toss-5"}


def test_what_was_written_is_read(tmp_path: Path) -> None:
    path, other = tmp_path / "refits.parquet", tmp_path / "again.parquet"
    write_refits([row(2), row(0), row(1)], {"package version": "1"}, path)
    write_refits([row(0), row(1), row(2)], {"package version": "1"}, other)
    assert path.read_bytes() == other.read_bytes()
    assert read_refits(path) == [row(0), row(1), row(2)]
    schema = pq.read_schema(path)
    assert schema.names == SCHEMA.names
    assert all(field.metadata[b"description"] for field in schema)
    assert b"package version" in schema.metadata[b"counterfactuals"]


def test_other_files_are_refused_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "refits.parquet"
    path.write_bytes(b"no parquet")
    with pytest.raises(UnreadableInputError, match="cannot be read as Parquet"):
        read_refits(path)
