"""Selected tosses as a LeRobot dataset v3.0: the files, types and numbers that LeRobot's own writer makes and its reader wants.

`test/packaging/test_lerobot_reader.py` reads one with LeRobot itself.
"""

import json
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.storage.export.lerobot import (
    EVIDENCE,
    FEATURES,
    episode_columns,
    feature_stats,
    uneven_lines,
    write_lerobot,
)
from contact_curation.storage.export.selected import SelectedToss
from contact_curation.storage.manifest.manifest import ManifestRow
from contact_curation.storage.provenance import TossProvenance
from test.storage.datasets.test_tagslam_bag import synthetic_toss
from test.storage.selected_rows import row

HEIGHTS = (0.25, 0.2, 0.18)
EPISODES = "meta/episodes/chunk-000/file-000.parquet"
DATA = "data/chunk-000/file-000.parquet"


def selected_tosses() -> list[SelectedToss]:
    tosses = [replace(synthetic_toss(height), toss_id=f"toss-{place}") for place, height in enumerate(HEIGHTS)]
    return [
        SelectedToss(toss, row(toss.toss_id, rank=place + 1, score=None if place else 0.5), TossProvenance("a.mcap"))
        for place, toss in enumerate(tosses)
    ]


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dataset")
    write_lerobot(selected_tosses(), "cube", folder)
    return folder


def loaded(path: Path) -> Any:
    return json.loads(path.read_text())


def test_the_files_lie_where_info_says(dataset: Path) -> None:
    info = loaded(dataset / "meta" / "info.json")
    files = sorted(str(path.relative_to(dataset)) for path in dataset.rglob("*") if path.is_file())
    assert files == sorted([DATA, EPISODES, "meta/info.json", "meta/stats.json", "meta/tasks.parquet"])
    assert info["data_path"].format(chunk_index=0, file_index=0) == DATA
    assert (info["codebase_version"], info["fps"], info["video_path"]) == ("v3.0", 148, None)
    frames = sum(one.toss.frames for one in selected_tosses())
    assert (info["total_episodes"], info["total_frames"], info["total_tasks"]) == (3, frames, 1)
    assert info["splits"] == {"train": "0:3"}
    assert info["features"] == FEATURES


def test_frames_are_poses_and_twists_with_lerobots_columns_a_row_group_per_toss(dataset: Path) -> None:
    file, tosses = pq.ParquetFile(dataset / DATA), [one.toss for one in selected_tosses()]
    assert file.schema_arrow.field("observation.state").type == pa.list_(pa.float32(), 13)
    assert [file.schema_arrow.field(name).type for name in ("timestamp", "index")] == [pa.float32(), pa.int64()]
    assert [file.metadata.row_group(place).num_rows for place in range(file.num_row_groups)] == [one.frames for one in tosses]
    first = 0
    for episode, toss in enumerate(tosses):
        table = file.read_row_group(episode)
        state = np.array(table["observation.state"].to_pylist())
        wanted = [toss.positions, toss.orientations_wxyz, toss.linear_velocities, toss.angular_velocities]
        np.testing.assert_array_equal(state, np.concatenate(wanted, axis=1).astype(np.float32))
        np.testing.assert_array_equal(table["stamp_ns"].to_numpy(), toss.stamps_ns)
        np.testing.assert_array_equal(table["timestamp"].to_numpy(), (np.arange(toss.frames) / 148).astype(np.float32))
        assert table["frame_index"].to_pylist() == list(range(toss.frames))
        assert table["index"].to_pylist() == list(range(first, first + toss.frames))
        assert set(table["episode_index"].to_pylist()) == {episode}
        assert set(table["task_index"].to_pylist()) == {0}
        first += toss.frames


def test_orientations_do_not_flip_their_sign_where_a_tracker_does() -> None:
    toss = synthetic_toss(0.25)
    signs = np.where(np.arange(toss.frames) % 3 == 0, -1.0, 1.0)[:, None]
    flipped = replace(toss, orientations_wxyz=signs * toss.orientations_wxyz)
    wanted, found = (episode_columns(one, 0, 0, 148)["observation.state"][:, 3:7] for one in (toss, flipped))
    np.testing.assert_array_equal(found, wanted)
    assert found[0, 0] >= 0.0
    assert (np.einsum("ti,ti->t", found[1:], found[:-1]) > 0.0).all()


def test_episodes_say_where_their_frames_are_and_what_the_ranking_says_of_them(dataset: Path) -> None:
    rows = pq.read_table(dataset / EPISODES).to_pylist()
    ends = np.cumsum([one.toss.frames for one in selected_tosses()]).tolist()
    assert [one["dataset_to_index"] for one in rows] == ends
    assert [one["dataset_from_index"] for one in rows] == [0, *ends[:-1]]
    assert [one["length"] for one in rows] == np.diff([0, *ends]).tolist()
    assert [one["tasks"] for one in rows] == [["toss the cube"]] * 3
    assert {(one["data/chunk_index"], one["data/file_index"], one["meta/episodes/file_index"]) for one in rows} == {(0, 0, 0)}
    assert [one["curation/toss_id"] for one in rows] == ["toss-0", "toss-1", "toss-2"]
    assert [one["curation/rank"] for one in rows] == [1, 2, 3]
    assert [one["curation/score"] for one in rows] == [0.5, None, None]
    assert rows[0]["curation/last_stamp_ns"] == 2**63 - 1
    left_out = {field.name for field in fields(ManifestRow)} - {field.name for field in EVIDENCE}
    assert left_out == {"selected", "rejected", "reasons", "frames"}


def test_statistics_are_those_of_the_frames_per_episode_and_over_all(dataset: Path) -> None:
    table, stats = pq.read_table(dataset / DATA), loaded(dataset / "meta" / "stats.json")
    assert set(stats) == set(FEATURES)
    state = np.array(table["observation.state"].to_pylist())
    np.testing.assert_allclose(stats["observation.state"]["mean"], state.mean(axis=0))
    np.testing.assert_allclose(stats["observation.state"]["q90"], np.quantile(state, 0.9, axis=0))
    assert stats["index"]["max"] == [len(state) - 1]
    episode = pq.read_table(dataset / EPISODES).to_pylist()[1]
    own = state[episode["dataset_from_index"] : episode["dataset_to_index"]]
    np.testing.assert_allclose(episode["stats/observation.state/std"], own.std(axis=0))
    assert episode["stats/observation.state/count"] == [len(own)]
    assert episode["stats/frame_index/max"] == [len(own) - 1]


def test_of_a_scalar_there_is_one_number_and_of_a_vector_one_each() -> None:
    assert feature_stats(np.array([3, 1, 2]))["q50"] == [2.0]
    stats = feature_stats(np.array([[0.0, 5.0], [2.0, 5.0]]))
    assert (stats["mean"], stats["std"], stats["count"]) == ([1.0, 5.0], [1.0, 0.0], [2])


def test_tasks_are_indexed_by_their_names_as_pandas_has_it(dataset: Path) -> None:
    table = pq.read_table(dataset / "meta" / "tasks.parquet")
    assert table.to_pydict() == {"task_index": [0], "task": ["toss the cube"]}
    assert json.loads(table.schema.metadata[b"pandas"])["index_columns"] == ["task"]


def test_where_frames_are_missing_a_line_says_how_far_timestamps_are_off() -> None:
    whole = synthetic_toss(0.25)
    stamps = whole.stamps_ns + np.where(np.arange(whole.frames) < 5, 0, round(1e9 / 148.0))
    assert uneven_lines([whole]) == ()
    (line,) = uneven_lines([whole, replace(whole, stamps_ns=stamps)])
    assert "in 1 of 2 tosses" in line
    assert "off by up to 0.0068 s" in line


def test_tosses_of_different_frame_rates_are_no_dataset(tmp_path: Path) -> None:
    first, second, _ = selected_tosses()
    slow = SelectedToss(replace(second.toss, frame_period=1.0 / 60.0), second.row, second.origin)
    with pytest.raises(InvalidValueError, match="frame rate of toss toss-1: found 60 Hz, expected about 148 Hz, one for all"):
        write_lerobot([first, slow], "cube", tmp_path)
    slowest = SelectedToss(replace(first.toss, frame_period=10.0), first.row, first.origin)
    with pytest.raises(InvalidValueError, match=r"found 0\.1 Hz"):
        write_lerobot([slowest], "cube", tmp_path)
