"""Kept tosses as a LeRobot dataset, format v3.0, written with pyarrow; LeRobot itself is not needed.

    meta/info.json                              features, frame rate, counts, where the files are
    meta/stats.json                             of each feature over all frames
    meta/tasks.parquet                          one task
    meta/episodes/chunk-000/file-000.parquet    an episode per toss, best first, with what the ranking says of it
    meta/curation.json                          the ranking itself: the manifest of these tosses
    data/chunk-000/file-000.parquet             frames, a row group per episode

Read and checked against LeRobot 0.6.1 (lerobot/datasets: dataset_writer, dataset_metadata, io_utils).
"""

import json
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from contact_curation.errors import InvalidValueError
from contact_curation.motion.toss import Toss
from contact_curation.storage.export.lerobot_features import FEATURES, Columns, episode_columns, frames_table
from contact_curation.storage.export.lerobot_stats import dataset_stats
from contact_curation.storage.export.selected import KeptToss
from contact_curation.storage.manifest.manifest import ManifestRow
from contact_curation.storage.manifest.parquet_form import TYPES

VERSION = "v3.0"
FILE = "chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
FIRST_FILE = FILE.format(chunk_index=0, file_index=0)
CHUNKS_SIZE, DATA_FILES_MB, VIDEO_FILES_MB = 1000, 100, 200
"""LeRobot's own limits, for those who append; here all tosses are in the first file, at some 11 kB each."""

LARGEST_RATE_ERROR = 0.01

PREFIX = "curation/"
SAID_OTHERWISE = ("kept", "gated", "reasons", "frames")
"""Of a manifest's row: of kept tosses alike, or LeRobot's `length`."""

EVIDENCE = tuple(field for field in fields(ManifestRow) if field.name not in SAID_OTHERWISE)


def write_lerobot(tosses: Sequence[KeptToss], body: str, folder: Path) -> None:
    """Writes the dataset.

    Args:
        tosses: best first, at least one.
        body: what was tossed.
        folder: to be filled.

    Raises:
        InvalidValueError: the tosses differ in their frame rates.
    """
    fps = common_rate([kept.toss for kept in tosses])
    task = f"toss the {body}"
    episodes: list[dict[str, Any]] = []
    data: list[Columns] = []
    for number, kept in enumerate(tosses):
        first = episodes[-1]["dataset_to_index"] if episodes else 0
        data.append(episode_columns(kept.toss, number, first, fps))
        episodes.append(_episode(kept, number, first, task, data[-1]))
    _write_row_groups([frames_table(columns) for columns in data], folder / "data" / FIRST_FILE)
    _write_row_groups([_episodes_table(episodes)], folder / "meta" / "episodes" / FIRST_FILE)
    _write_row_groups([_tasks_table(task)], folder / "meta" / "tasks.parquet")
    together = {name: np.concatenate([columns[name] for columns in data]) for name in FEATURES}
    _write_json(dataset_stats(together), folder / "meta" / "stats.json")
    _write_json(_info(len(episodes), episodes[-1]["dataset_to_index"], fps), folder / "meta" / "info.json")


def common_rate(tosses: Sequence[Toss]) -> int:
    """Frames a second.

    Raises:
        InvalidValueError: the tosses differ, or it is no whole number.
    """
    fps = round(1.0 / tosses[0].frame_period)
    for toss in tosses:
        if fps < 1 or abs(fps * toss.frame_period - 1.0) > LARGEST_RATE_ERROR:
            found = f"{1.0 / toss.frame_period:.4g} Hz"
            raise InvalidValueError(f"frame rate of toss {toss.toss_id}", found, f"about {max(fps, 1)} Hz, one for all tosses")
    return fps


def _episode(kept: KeptToss, number: int, first: int, task: str, columns: Columns) -> dict[str, Any]:
    stats = {
        f"stats/{feature}/{name}": value for feature, found in dataset_stats(columns).items() for name, value in found.items()
    }
    return {
        "episode_index": number,
        "tasks": [task],
        "length": kept.toss.frames,
        "data/chunk_index": 0,
        "data/file_index": 0,
        "dataset_from_index": first,
        "dataset_to_index": first + kept.toss.frames,
        **stats,
        "meta/episodes/chunk_index": 0,
        "meta/episodes/file_index": 0,
        **{f"{PREFIX}{field.name}": getattr(kept.row, field.name) for field in EVIDENCE},
    }


def _episodes_table(episodes: Sequence[dict[str, Any]]) -> pa.Table:
    evidence = {f"{PREFIX}{field.name}": TYPES[field.type] for field in EVIDENCE}
    arrays = {name: pa.array([episode[name] for episode in episodes], evidence.get(name)) for name in episodes[0]}
    return pa.table(arrays)


def _tasks_table(task: str) -> pa.Table:
    """As pandas writes a frame whose index is the task: LeRobot looks a task's name up there."""
    table = pa.table({"task_index": pa.array([0], pa.int64()), "task": pa.array([task])})
    columns = [("task_index", "int64", "int64"), ("task", "unicode", "object")]
    about = {
        "index_columns": ["task"],
        "column_indexes": [{"name": None, "field_name": None, "pandas_type": "unicode", "numpy_type": "object",
                            "metadata": {"encoding": "UTF-8"}}],
        "columns": [{"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy_kind, "metadata": None}
                    for name, kind, numpy_kind in columns],
        "creator": {"library": "pyarrow", "version": pa.__version__},
        "pandas_version": "2.3.3",
    }  # fmt: skip
    return table.replace_schema_metadata({"pandas": json.dumps(about)})


def _info(episodes: int, frames: int, fps: int) -> dict[str, Any]:
    return {
        "codebase_version": VERSION,
        "fps": fps,
        "features": FEATURES,
        "total_episodes": episodes,
        "total_frames": frames,
        "total_tasks": 1,
        "chunks_size": CHUNKS_SIZE,
        "data_files_size_in_mb": DATA_FILES_MB,
        "video_files_size_in_mb": VIDEO_FILES_MB,
        "data_path": f"data/{FILE}",
        "video_path": None,
        "robot_type": None,
        "splits": {"train": f"0:{episodes}"},
    }


def _write_row_groups(tables: Sequence[pa.Table], path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with pq.ParquetWriter(path, tables[0].schema, compression="snappy") as writer:
        for table in tables:
            writer.write_table(table)


def _write_json(content: Any, path: Path) -> None:
    path.write_text(json.dumps(content, indent=4, ensure_ascii=False) + "\n")
