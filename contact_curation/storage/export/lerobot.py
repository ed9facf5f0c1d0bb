"""Exports selected tosses as a LeRobot dataset, format v3.0, with pyarrow; LeRobot itself is not needed.

    meta/info.json                              features, frame rate, counts, where the files are
    meta/stats.json                             statistics of each feature over all frames, by which LeRobot normalises data
    meta/tasks.parquet                          one task
    meta/episodes/chunk-000/file-000.parquet    an episode per toss, best first, with its row of the ranking
    meta/curation.json                          the ranking itself: the manifest of these tosses
    data/chunk-000/file-000.parquet             frames, a row group per episode

Columns of a frame, in addition to those of every LeRobot dataset:

    observation.state   position (3) [m], orientation wxyz (4), linear velocity (3) [m/s] in the board's frame, angular velocity
                        (3) [rad/s] in the body's; position and velocity are those of the centre of mass; of q and -q it has
                        the one that is nearer to the frame before, and at first the one with w >= 0
    stamp_ns            the frame's own stamp: LeRobot's `timestamp` is frame_index / fps

Read and checked against LeRobot 0.6.1 (lerobot/datasets: dataset_writer, dataset_metadata, io_utils).
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.toss import NANOSECONDS, Toss
from contact_curation.motion.transitions import periods_of, states_of
from contact_curation.storage.export.selected import SelectedToss
from contact_curation.storage.manifest.file import TYPES
from contact_curation.storage.manifest.manifest import ManifestRow

METRES = 1.0

STATE_NAMES = ("x", "y", "z", "qw", "qx", "qy", "qz", "vx", "vy", "vz", "wx", "wy", "wz")

FEATURES: dict[str, dict[str, Any]] = {
    "observation.state": {"dtype": "float32", "shape": [len(STATE_NAMES)], "names": list(STATE_NAMES)},
    "stamp_ns": {"dtype": "int64", "shape": [1], "names": None},
    "timestamp": {"dtype": "float32", "shape": [1], "names": None},
    "frame_index": {"dtype": "int64", "shape": [1], "names": None},
    "episode_index": {"dtype": "int64", "shape": [1], "names": None},
    "index": {"dtype": "int64", "shape": [1], "names": None},
    "task_index": {"dtype": "int64", "shape": [1], "names": None},
}
"""Features as in meta/info.json; every LeRobot dataset has the last five."""

Columns = dict[str, NDArray[Any]]


def episode_columns(toss: Toss, episode: int, first_index: int, fps: int) -> Columns:
    """The columns of a toss's frames, each (T,) or (T, 13).

    Args:
        toss: toss of T frames.
        episode: number of its episode.
        first_index: index of its first frame among all frames.
        fps: frame rate of the dataset [Hz].
    """
    frames = np.arange(toss.frames, dtype=np.int64)
    steady = replace(toss, orientations_wxyz=without_sign_flips(toss.orientations_wxyz))
    return {
        "observation.state": states_of(steady, METRES).astype(np.float32),
        "stamp_ns": toss.stamps_ns,
        "timestamp": (frames / fps).astype(np.float32),
        "frame_index": frames,
        "episode_index": np.full(toss.frames, episode, dtype=np.int64),
        "index": first_index + frames,
        "task_index": np.zeros(toss.frames, dtype=np.int64),
    }


def without_sign_flips(orientations_wxyz: Array) -> Array:
    """The same orientations (T, 4), each as q or -q so that numbers change from frame to frame only as far as the body turns.

    Trackers publish either sign at random, which rotations do not notice; but a policy and the statistics see the numbers.
    """
    first = np.array([1.0, 0.0, 0.0, 0.0])
    before = np.concatenate([first[np.newaxis], orientations_wxyz[:-1]])
    flips = np.where((before * orientations_wxyz).sum(axis=1) < 0.0, -1.0, 1.0)
    return np.asarray(np.cumprod(flips)[:, np.newaxis] * orientations_wxyz)


def frames_table(columns: Mapping[str, NDArray[Any]]) -> pa.Table:
    """Makes a table of the columns, with the types of `FEATURES`."""
    return pa.table([_array(columns[name], about) for name, about in FEATURES.items()], names=list(FEATURES))


def _array(values: NDArray[Any], about: Mapping[str, Any]) -> pa.Array:
    flat = pa.array(values.ravel(), type=pa.from_numpy_dtype(about["dtype"]))
    width = about["shape"][0]
    return flat if width == 1 else pa.FixedSizeListArray.from_arrays(flat, width)


QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}

Stats = dict[str, list[float] | list[int]]


def feature_stats(values: NDArray[Any]) -> Stats:
    """Computes the statistics of one feature over its frames.

    Args:
        values: (N,) or (N, D) values of N frames.

    Returns:
        Lists of D numbers (one for a scalar feature) by the name of the statistic; `count` has one number.
    """
    rows = np.asarray(values, dtype=float).reshape(len(values), -1)
    plain = {"min": rows.min(axis=0), "max": rows.max(axis=0), "mean": rows.mean(axis=0), "std": rows.std(axis=0)}
    quantiles = dict(zip(QUANTILES, np.quantile(rows, list(QUANTILES.values()), axis=0)))
    found: Stats = {name: value.tolist() for name, value in plain.items()}
    return {**found, "count": [len(rows)], **{name: value.tolist() for name, value in quantiles.items()}}


def dataset_stats(columns: Mapping[str, NDArray[Any]]) -> dict[str, Stats]:
    """Computes the statistics of all features, by their names."""
    return {name: feature_stats(values) for name, values in columns.items()}


VERSION = "v3.0"
FILE = "chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
FIRST_FILE = FILE.format(chunk_index=0, file_index=0)
CHUNKS_SIZE, DATA_FILES_MB, VIDEO_FILES_MB = 1000, 100, 200
"""LeRobot's limits for appending to a dataset; this export writes one file, with about 11 kB per toss."""

LARGEST_RATE_ERROR = 0.01

PREFIX = "curation/"
SAID_OTHERWISE = ("selected", "rejected", "reasons", "frames")
"""Columns of the manifest that are left out: those with one value for all selected tosses, and LeRobot's `length`."""

EVIDENCE = tuple(field for field in fields(ManifestRow) if field.name not in SAID_OTHERWISE)


def write_lerobot(tosses: Sequence[SelectedToss], body: str, folder: Path) -> None:
    """Writes the dataset.

    Args:
        tosses: at least one toss, best first.
        body: name of the tossed body.
        folder: folder to write to.

    Raises:
        InvalidValueError: the tosses have different frame rates.
    """
    fps = common_rate([selected.toss for selected in tosses])
    task = f"toss the {body}"
    episodes: list[dict[str, Any]] = []
    data: list[Columns] = []
    for number, selected in enumerate(tosses):
        first = episodes[-1]["dataset_to_index"] if episodes else 0
        data.append(episode_columns(selected.toss, number, first, fps))
        episodes.append(_episode(selected, number, first, task, data[-1]))
    _write_row_groups([frames_table(columns) for columns in data], folder / "data" / FIRST_FILE)
    _write_row_groups([_episodes_table(episodes)], folder / "meta" / "episodes" / FIRST_FILE)
    _write_row_groups([_tasks_table(task)], folder / "meta" / "tasks.parquet")
    together = {name: np.concatenate([columns[name] for columns in data]) for name in FEATURES}
    _write_json(dataset_stats(together), folder / "meta" / "stats.json")
    _write_json(_info(len(episodes), episodes[-1]["dataset_to_index"], fps), folder / "meta" / "info.json")


def common_rate(tosses: Sequence[Toss]) -> int:
    """The frame rate of all tosses [Hz], a whole number.

    Raises:
        InvalidValueError: the tosses have different frame rates, or the rate is not close to a whole number.
    """
    fps = round(1.0 / tosses[0].frame_period)
    for toss in tosses:
        if fps < 1 or abs(fps * toss.frame_period - 1.0) > LARGEST_RATE_ERROR:
            found = f"{1.0 / toss.frame_period:.4g} Hz"
            raise InvalidValueError(f"frame rate of toss {toss.toss_id}", found, f"about {max(fps, 1)} Hz, one for all tosses")
    return fps


def uneven_lines(tosses: Sequence[Toss]) -> tuple[str, ...]:
    """A line if frames are missing or uneven, so that LeRobot's `timestamp`, which counts frames, is not the time.

    Args:
        tosses: of the dataset.
    """
    uneven = [one for one in tosses if (periods_of(one) != np.arange(one.frames)).any()]
    if not uneven:
        return ()
    fps = common_rate(tosses)
    times = [(one.stamps_ns - one.stamps_ns[0]) / NANOSECONDS for one in uneven]
    most = max(np.abs(seconds - np.arange(len(seconds)) / fps).max() for seconds in times)
    off = f"their `timestamp`, which counts frames, is off by up to {most:.2g} s: `stamp_ns` has the times"
    return (f"frames are missing or uneven in {len(uneven)} of {len(tosses)} tosses, and {off}",)


def _episode(selected: SelectedToss, number: int, first: int, task: str, columns: Columns) -> dict[str, Any]:
    stats = {
        f"stats/{feature}/{name}": value for feature, found in dataset_stats(columns).items() for name, value in found.items()
    }
    return {
        "episode_index": number,
        "tasks": [task],
        "length": selected.toss.frames,
        "data/chunk_index": 0,
        "data/file_index": 0,
        "dataset_from_index": first,
        "dataset_to_index": first + selected.toss.frames,
        **stats,
        "meta/episodes/chunk_index": 0,
        "meta/episodes/file_index": 0,
        **{f"{PREFIX}{field.name}": getattr(selected.row, field.name) for field in EVIDENCE},
    }


def _episodes_table(episodes: Sequence[dict[str, Any]]) -> pa.Table:
    evidence = {f"{PREFIX}{field.name}": TYPES[field.type] for field in EVIDENCE}
    arrays = {name: pa.array([episode[name] for episode in episodes], evidence.get(name)) for name in episodes[0]}
    return pa.table(arrays)


def _tasks_table(task: str) -> pa.Table:
    """The table of tasks, as pandas writes a data frame whose index is the task, in which LeRobot looks up names."""
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
    path.write_text(json.dumps(content, indent=4, ensure_ascii=False) + "\n", encoding="utf-8")
