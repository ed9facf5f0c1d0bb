"""Refits as one Parquet file: a row per refit, with the units of its columns in the schema."""

import json
from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from contact_curation.errors import UnreadableInputError
from contact_curation.experiments.cell_run import Row
from contact_curation.files import write_atomically

OUTCOMES = {
    "position": "mean position error over the judging tosses [% of the body's width]",
    "rotation": "mean rotation error over the judging tosses [deg]",
    "penetration": "mean penetration over the judging tosses [% of the body's width]",
    "loss": "mean loss of the judging transitions over their variances at the fit to all",
    "vertices": "vertices off the described body's [mm RMS]",
    "vertices_from_all": "vertices off those of the fit to all training tosses [mm RMS]",
    "friction": "friction coefficient",
    "friction_from_all": "friction off that of the fit to all training tosses",
}
WHOLE = {"size": "tosses of the subset", "draw": "number of the draw", "evaluations": "of losses and scores in the refit"}
NUMBERS = {
    **OUTCOMES,
    "objective": "sum at its minimum",
    "not_finite": "judging motions that are not finite, left out of the means",
    "fit_seconds": "processor time of the refit [s]",
    "judge_seconds": "processor time of the judgement [s]",
}
FORESEEN = (
    *("trace", "trace-empirical", "log-det", "v-optimal", "representative", "herding", "facility-location", "influence"),
    *("influence-set", "tracin", "trak", "knn-shapley", "loss", "duration", "smoothness"),
)
"""Scores of subsets."""

FORESEEN_BY = {f"foreseen_{name}": f"how bad the model is by the score {name} (experiments/counterfactuals/scores.py)"
               for name in FORESEEN}  # fmt: skip
SCHEMA = pa.schema(
    [
        pa.field("body", pa.string(), nullable=False, metadata={"description": "see experiments/bodies.py"}),
        *(pa.field(name, pa.int32(), nullable=False, metadata={"description": text}) for name, text in WHOLE.items()),
        *(pa.field(name, pa.float32(), nullable=False, metadata={"description": text}) for name, text in NUMBERS.items()),
        *(pa.field(name, pa.float64(), nullable=False, metadata={"description": text}) for name, text in FORESEEN_BY.items()),
        pa.field("converged", pa.bool_(), nullable=False, metadata={"description": "whether the last descent converged"}),
        pa.field("failed", pa.string(), nullable=False, metadata={"description": "why it has no outcomes; empty if it has"}),
        pa.field("tosses", pa.list_(pa.string()), nullable=False, metadata={"description": "ids of the subset"}),
    ]
)


def write_refits(rows: Sequence[Row], head: Mapping[str, str], path: Path) -> None:
    """Writes the rows of refits; the same rows and head always give the same bytes."""
    ordered = sorted(rows, key=lambda row: (str(row["body"]), float(row["size"]), float(row["draw"])))
    columns = [pa.array([_value(row[field.name], field) for row in ordered], field.type) for field in SCHEMA]
    schema = SCHEMA.with_metadata({b"counterfactuals": json.dumps(dict(head), sort_keys=True).encode()})
    out = BytesIO()
    pq.write_table(pa.Table.from_arrays(columns, schema=schema), out, compression="zstd")
    write_atomically(path, out.getvalue())


def read_refits(path: Path) -> list[Row]:
    """The rows that `write_refits` wrote, with the ids of the tosses joined by blanks.

    Raises:
        UnreadableInputError: it is no such file.
    """
    try:
        table = pq.read_table(path)
    except (OSError, pa.ArrowInvalid) as error:
        raise UnreadableInputError(path, f"cannot be read as Parquet ({error})") from error
    if table.schema.names != SCHEMA.names:
        raise UnreadableInputError(path, f"has columns {table.schema.names}, expected {SCHEMA.names}")
    return [{**row, "tosses": " ".join(row["tosses"])} for row in table.to_pylist()]


def _value(value: float | str, field: pa.Field) -> object:
    if pa.types.is_list(field.type):
        return str(value).split()
    if pa.types.is_string(field.type):
        return str(value)
    if pa.types.is_boolean(field.type):
        return bool(value)
    return int(value) if pa.types.is_integer(field.type) else float(value)
