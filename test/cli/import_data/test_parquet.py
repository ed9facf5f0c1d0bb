"""`import poses` reads tables in Parquet, as pandas and polars write them."""

from contextlib import suppress
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from contact_curation.errors import UnreadableInputError
from contact_curation.storage.datasets.parquet_lines import parquet_lines
from contact_curation.storage.datasets.pose_table import PoseTable
from test.cli.commands import Cli

ROWS = 10_000
STAMPS_NS = 1_795_910_398_123_456_789 + 6_757_001 * np.arange(ROWS)
POSITIONS = np.random.default_rng(0).standard_normal((ROWS, 3))
UPRIGHT = np.tile([0.0, 0.0, 0.0, 1.0], (ROWS, 1))
FLAT = dict(zip(("x", "y", "z", "qx", "qy", "qz", "qw"), np.hstack([POSITIONS, UPRIGHT]).T, strict=True))


def struct(names: str, values: np.ndarray) -> pa.StructArray:
    return pa.StructArray.from_arrays([pa.array(column) for column in values.T], list(names))


TABLES = {
    "an index of times without a name": FLAT | {"__index_level_0__": pa.array(STAMPS_NS, pa.timestamp("ns"))},
    "times in a zone": {"stamp": pa.array(STAMPS_NS, pa.timestamp("ns", "Europe/Berlin"))} | FLAT,
    "durations": {"time": pa.array(STAMPS_NS, pa.duration("ns"))} | FLAT,
    "durations of a column that was numbers": {"time_s": pa.array(STAMPS_NS, pa.duration("ns"))} | FLAT,
    "whole nanoseconds": {"t_ns": STAMPS_NS} | FLAT,
    "text": {"time": pa.array([str(stamp) for stamp in STAMPS_NS])} | FLAT,
    "columns with points": {"time": STAMPS_NS} | {f"{'q.' if name[0] == 'q' else 'p.'}{name[-1]}": FLAT[name] for name in FLAT},
    "structs, lists and bytes": {
        "header": pa.StructArray.from_arrays([pa.array(STAMPS_NS), pa.array(["map"] * ROWS)], ["stamp", "frame_id"]),
        "image": pa.array([b"1"] * ROWS),
        "covariance": pa.array([[0.0, 1.0]] * ROWS),
        "pose": pa.StructArray.from_arrays([struct("xyz", POSITIONS), struct("xyzw", UPRIGHT)], ["position", "orientation"]),
    },
}  # fmt: skip


@pytest.mark.parametrize("kind", TABLES)
def test_poses_are_those_of_the_table(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "poses.parquet"
    pq.write_table(pa.table(TABLES[kind]), path, row_group_size=3000)
    stamps, poses = zip(*PoseTable(path), strict=True)
    np.testing.assert_array_equal(stamps, STAMPS_NS)
    np.testing.assert_array_equal([pose.position for pose in poses], POSITIONS)


def test_times_of_day_go_with_days_and_keep_their_nanoseconds(tmp_path: Path) -> None:
    day = pa.array(["2026-11-28"] * ROWS).cast(pa.date32())
    of_day = pa.array([stamp_ns - STAMPS_NS[0] + 1 for stamp_ns in STAMPS_NS], pa.time64("ns"))
    pq.write_table(pa.table({"date": day, "time": of_day, **FLAT}), tmp_path / "poses.parquet")
    stamps = [stamp_ns for stamp_ns, _ in PoseTable(tmp_path / "poses.parquet")]
    assert stamps[0] == 1_795_824_000_000_000_001
    np.testing.assert_array_equal(np.diff(stamps), np.diff(STAMPS_NS))


def test_rows_without_a_pose_are_counted(cli: Cli, tmp_path: Path) -> None:
    x = pa.array([None if row % 4 == 0 else 0.1 for row in range(ROWS)])
    pq.write_table(pa.table({"time": STAMPS_NS, **FLAT, "x": x}), tmp_path / "poses.parquet")
    done = cli("import", "poses", tmp_path / "poses.parquet", "--out", tmp_path / "poses.mcap")
    assert f"left out {ROWS // 4} rows without a pose (line 2: found '', expected a number)" in done.err


def test_a_damaged_file_gives_one_line(tmp_path: Path) -> None:
    path = tmp_path / "poses.parquet"
    pq.write_table(pa.table({"time": STAMPS_NS, **FLAT}), path)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(UnreadableInputError, match="is damaged, expected a table in Parquet"):
        PoseTable(path)


@pytest.mark.slow
def test_a_damaged_description_of_the_columns_is_refused_or_read(tmp_path: Path) -> None:
    """Of two bytes in a column's statistics pyarrow 26 ends the process, if it is asked for the column."""
    path = tmp_path / "poses.parquet"
    few = {"time": STAMPS_NS[:20], **{name: column[:20] for name, column in FLAT.items()}}
    pq.write_table(pa.table(few), path, store_schema=False)
    whole = path.read_bytes()
    footer = len(whole) - 8 - int.from_bytes(whole[-8:-4], "little")
    for place in range(footer, len(whole)):
        for change in (0x01, 0x10):
            path.write_bytes(whole[:place] + bytes([whole[place] ^ change]) + whole[place + 1 :])
            with suppress(UnreadableInputError):
                list(parquet_lines(path))


def test_text_that_repeats_is_counted_before_it_is_repeated(tmp_path: Path) -> None:
    path = tmp_path / "poses.parquet"
    text = pa.DictionaryArray.from_arrays(pa.array(np.zeros(ROWS, np.int32)), pa.array(["x" * 10_000_000]))
    pq.write_table(pa.table({"frame": text, **FLAT}), path)
    assert path.stat().st_size < 2_000_000
    with pytest.raises(UnreadableInputError, match="more than 1024 bytes of text in a row"):
        list(parquet_lines(path))


def test_rows_that_a_file_cannot_have_are_not_read(tmp_path: Path) -> None:
    path = tmp_path / "poses.parquet"
    pq.write_table(pa.table({"x": np.zeros(5_000_000)}), path)
    assert path.stat().st_size < 100_000
    with pytest.raises(UnreadableInputError, match="8 rows a byte"):
        list(parquet_lines(path))
