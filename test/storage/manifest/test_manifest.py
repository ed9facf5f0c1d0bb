"""Manifests say the same in every format, in the same bytes every time, and are there whole or not at all."""

import copy
import csv
import json
import math
import os
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from contact_curation.errors import InvalidValueError, UnreadableInputError
from contact_curation.files import write_atomically
from contact_curation.storage.manifest import file
from contact_curation.storage.manifest.file import (
    FORMATS,
    joined_csv,
    manifest_of,
    provenance_bytes,
    read_manifest,
    write_manifest,
)
from contact_curation.storage.manifest.manifest import Manifest, ManifestRow
from contact_curation.storage.provenance import InputProvenance, RunProvenance

RUN = RunProvenance(
    criterion="log-det",
    estimator="empirical",
    influence_bound=math.inf,
    model="polytope",
    parameters="nominal",
    parameters_version="0a1b",
    seed=7,
    package_version="0.1.0",
    command=("rank", "a bag.mcap", "--top", "2"),
    inputs=(InputProvenance("a bag.mcap", "ab" * 32, ("cut short at byte 7",)), InputProvenance("b.mcap", "cd" * 32)),
    settings=("gates.depth=0.01", "poses.topic=/cube"),
)
RANKED = ManifestRow(
    toss_id="cube-1-ab",
    selected=True,
    rejected=False,
    reasons=(),
    rank=1,
    score=0.1 + 0.2,
    marginal_gain=1e-300,
    trace=12.5,
    mean_loss=math.nan,
    transitions=80,
    not_scored=0,
    frames=81,
    duration=80 / 148,
    input="a bag.mcap",
    input_sha256="ab" * 32,
    topic="/tagslam/odom/body_cube",
    first_stamp_ns=1_700_000_000_123_456_789,
    last_stamp_ns=2**63 - 1,
)
GATED = replace(
    RANKED,
    toss_id="cube-2-ab",
    selected=False,
    rejected=True,
    reasons=('jump: found 0.3 m, expected less, "really"', "flips;\nµ"),
    **dict.fromkeys(("rank", "score", "marginal_gain", "trace", "mean_loss", "transitions", "not_scored")),  # type: ignore[arg-type]
)
BESIDES = replace(RANKED, toss_id="cube-3-ab", selected=False, rank=2, score=-math.inf, mean_loss=math.inf, topic="")
DIAGNOSTICS: dict[str, Any] = {
    "epsilon": 0.25,
    "bound": math.inf,
    "smallest_sufficient_k": 3,
    "efficiency": {"kiefer_wolfowitz": 0.5, "subset": 0.75},
    "block_shares": {"vertices": 0.9, "normal": 0.1},
    "notes": ["one", None, True],
}
MANIFEST = Manifest(RUN, (RANKED, GATED, BESIDES), DIAGNOSTICS)
ENDINGS = sorted(FORMATS)


def assert_equal(found: Manifest, expected: Manifest) -> None:
    """NaN is NaN here: dataclasses say it is not."""
    assert repr(found.rows) == repr(expected.rows)
    assert (found.run, found.diagnostics) == (expected.run, expected.diagnostics)


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_manifest_comes_back_as_it_was_written(tmp_path: Path, ending: str) -> None:
    write_manifest(MANIFEST, tmp_path / f"m{ending}")
    assert_equal(read_manifest(tmp_path / f"m{ending}"), MANIFEST)


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_manifest_without_tosses_comes_back(tmp_path: Path, ending: str) -> None:
    write_manifest(Manifest(RUN, ()), tmp_path / f"m{ending}")
    assert_equal(read_manifest(tmp_path / f"m{ending}"), Manifest(RUN, ()))


TEXT = st.text(st.characters(exclude_categories=["Cs"]), max_size=8)
NUMBER = st.none() | st.floats()


@given(TEXT, TEXT, st.lists(TEXT, min_size=1, max_size=3), NUMBER, NUMBER, st.integers(-(2**63), 2**63 - 1))
def test_any_text_and_number_comes_back_from_every_format(
    toss_id: str, topic: str, reasons: list[str], score: float | None, loss: float | None, stamp: int
) -> None:
    row = replace(
        RANKED, toss_id=toss_id, topic=topic, reasons=tuple(reasons), score=score, mean_loss=loss, first_stamp_ns=stamp
    )
    manifest = Manifest(replace(RUN, command=(topic, toss_id)), (row,), {"note": topic.replace("N", "n").replace("I", "i")})
    for ending, kind in FORMATS.items():
        data = kind.write(manifest)
        data = joined_csv(provenance_bytes(manifest, data), data) if ending == ".csv" else data
        assert_equal(manifest_of(*kind.read(data)), manifest)


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("word", ["NaN", "Infinity", "-Infinity", "null", "nan", "true", ""])
def test_words_that_mean_numbers_elsewhere_stay_text(tmp_path: Path, ending: str, word: str) -> None:
    row = replace(RANKED, toss_id=word, topic=word, input=word, mean_loss=None, selected=False, reasons=(word,))
    manifest = Manifest(replace(RUN, model=word, command=(word,)), (row,))
    write_manifest(manifest, tmp_path / f"m{ending}")
    assert_equal(read_manifest(tmp_path / f"m{ending}"), manifest)


@pytest.mark.parametrize("ending", ENDINGS)
def test_the_same_manifest_gives_the_same_bytes(tmp_path: Path, ending: str) -> None:
    paths = [tmp_path / f"{name}{ending}" for name in "ab"]
    for path in paths:
        write_manifest(MANIFEST, path)
    assert paths[0].read_bytes() == paths[1].read_bytes()


def test_a_writer_that_dies_between_a_table_and_its_provenance_leaves_one_manifest_or_the_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, newer = tmp_path / "m.csv", Manifest(replace(RUN, criterion="trace"), (BESIDES, RANKED), DIAGNOSTICS)
    write_manifest(MANIFEST, path)
    found = []
    for writes in range(1, 4):
        write_manifest(MANIFEST, path)
        left = iter(range(writes))

        def write(target: Path, data: bytes, left: Iterator[int] = left) -> None:
            if next(left, None) is None:
                raise KeyboardInterrupt
            write_atomically(target, data)

        with monkeypatch.context() as patch, suppress(KeyboardInterrupt):
            patch.setattr(file, "write_atomically", write)
            write_manifest(newer, path)
        found.append(read_manifest(path))
    for one, expected in zip(found, (MANIFEST, newer, newer), strict=True):
        assert_equal(one, expected)


def test_other_tools_read_the_three_formats(tmp_path: Path) -> None:
    for ending in ENDINGS:
        write_manifest(MANIFEST, tmp_path / f"m{ending}")
    ids = [row.toss_id for row in MANIFEST.rows]
    assert pq.read_table(tmp_path / "m.parquet")["toss_id"].to_pylist() == ids
    assert pq.read_table(tmp_path / "m.parquet")["mean_loss"].null_count == 1
    with (tmp_path / "m.csv").open(newline="") as file:
        assert [row["toss_id"] for row in csv.DictReader(file)] == ids
    assert json.loads((tmp_path / "m.provenance.json").read_text())["criterion"] == "log-det"
    strict = json.loads((tmp_path / "m.json").read_text(), parse_constant=lambda name: pytest.fail(f"{name} is not JSON"))
    assert [row["toss_id"] for row in strict["tosses"]] == ids
    assert strict["influence_bound"] == "Infinity"


def test_a_table_that_lost_its_provenance_is_refused_with_the_remedy_and_an_older_file_has_it_inside(tmp_path: Path) -> None:
    write_manifest(MANIFEST, tmp_path / "m.csv")
    older = joined_csv((tmp_path / "m.provenance.json").read_bytes(), (tmp_path / "m.csv").read_bytes())
    (tmp_path / "older.csv").write_bytes(older)
    assert_equal(read_manifest(tmp_path / "older.csv"), MANIFEST)
    (tmp_path / "m.provenance.json").unlink()
    with pytest.raises(UnreadableInputError, match=r"found no m\.provenance\.json beside it: keep the two together, or rank"):
        read_manifest(tmp_path / "m.csv")


def test_kept_tosses_come_best_first() -> None:
    second = replace(RANKED, toss_id="cube-4-ab", rank=2)
    assert [row.rank for row in Manifest(RUN, (second, GATED, RANKED)).selected] == [1, 2]


@pytest.mark.parametrize(
    "changes",
    [{"rejected": True}, {"rank": None}, {"selected": False, "rejected": True}, {"selected": False, "rank": None}],
    ids=["selected though rejected", "selected without rank", "rejected without reason", "not ranked without reason"],
)
def test_rows_that_contradict_themselves_are_refused(changes: dict[str, Any]) -> None:
    with pytest.raises(InvalidValueError):
        replace(RANKED, **changes)


def test_a_toss_is_listed_only_once() -> None:
    with pytest.raises(InvalidValueError, match="cube-1-ab twice"):
        Manifest(RUN, (RANKED, GATED, RANKED))


def test_an_unknown_ending_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidValueError, match=r"\.parquet"):
        write_manifest(MANIFEST, tmp_path / "m.txt")


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("content", [b"", b"{}", b"# a: 1\n", b"[1, 2]", b"PAR1 and nothing else"])
def test_files_that_are_no_manifests_are_refused_in_one_line(tmp_path: Path, ending: str, content: bytes) -> None:
    path = tmp_path / f"m{ending}"
    path.write_bytes(content)
    with pytest.raises(UnreadableInputError, match="is no manifest of `contact-curation rank`: ") as caught:
        read_manifest(path)
    assert "\n" not in str(caught.value)
    assert "Error(" not in str(caught.value)  # nothing of Python's


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_cut_manifest_is_refused_wherever_it_is_cut(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"m{ending}"
    write_manifest(MANIFEST, path)
    whole = path.read_bytes().rstrip() if ending == ".json" else path.read_bytes()
    for length in (*range(0, len(whole) - 200, 41), *range(len(whole) - 200, len(whole))):
        path.write_bytes(whole[:length])
        with pytest.raises(UnreadableInputError):
            read_manifest(path)


def test_a_manifest_of_a_newer_version_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "m.json"
    write_manifest(MANIFEST, path)
    path.write_text(path.read_text().replace('"contact_curation_manifest": 2', '"contact_curation_manifest": 3'))
    with pytest.raises(UnreadableInputError, match="version 3"):
        read_manifest(path)


def test_a_missing_manifest_is_a_clear_error(tmp_path: Path) -> None:
    with pytest.raises(UnreadableInputError, match="No such file"):
        read_manifest(tmp_path / "m.json")


def test_a_failed_write_leaves_the_old_manifest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "m.json"
    write_manifest(MANIFEST, path)
    before = path.read_bytes()

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(InvalidValueError, match="No space left"):
        write_manifest(Manifest(RUN, ()), path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_a_path_that_is_not_unicode_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    row = replace(RANKED, input="bag\udcff.mcap")
    for ending in ENDINGS:
        with pytest.raises(InvalidValueError, match=r"found '.{,60}bag.udcff\.mcap.{,60}' in it, .* Unicode"):
            write_manifest(Manifest(RUN, (row,)), tmp_path / f"m{ending}")
        with pytest.raises(InvalidValueError, match="Unicode"):
            write_manifest(Manifest(replace(RUN, command=("rank", "bag\udcff.mcap")), ()), tmp_path / f"m{ending}")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "text",
    [
        "[" * 100_000,
        '{"a":' * 50_000,
        "null",
        "3",
        '[{"contact_curation_manifest": 1}]',
        '{"contact_curation_manifest": 1, "tosses": 3}',
        '{"contact_curation_manifest": 1, "tosses": [3], "inputs": [[]], "diagnostics": []}',
        '{"contact_curation_manifest": {}}',
    ],
)
def test_what_is_json_and_no_manifest_is_one_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "manifest.json"
    path.write_text(text)
    with pytest.raises(UnreadableInputError, match=r"manifest\.json"):
        read_manifest(path)


def test_rows_of_other_types_are_one_line(tmp_path: Path) -> None:
    path = tmp_path / "manifest.json"
    write_manifest(MANIFEST, path)
    whole = json.loads(path.read_text())
    (rows,) = (name for name, value in whole.items() if isinstance(value, list) and value and "toss_id" in value[0])
    for name in whole[rows][0]:
        for wrong in ([1], {"a": 1}, "words", 10**400):
            changed = copy.deepcopy(whole)
            changed[rows][0][name] = wrong
            path.write_text(json.dumps(changed))
            if wrong == "words" and name in ("toss_id", "input", "input_sha256", "topic"):
                read_manifest(path)
                continue
            with pytest.raises(UnreadableInputError, match=f"manifest.json: is no manifest .*: (reasons|{name}): found "):
                read_manifest(path)


@pytest.mark.parametrize("body", [True, -1, 1e308, ["a"], "cube"])
def test_a_body_of_another_type_is_one_line(tmp_path: Path, body: object) -> None:
    path = tmp_path / "manifest.json"
    write_manifest(MANIFEST, path)
    path.write_text(json.dumps(json.loads(path.read_text()) | {"body": body}))
    with pytest.raises(UnreadableInputError, match=r"manifest\.json: .*body: found .*, expected the values of a body"):
        read_manifest(path)


def test_a_table_that_claims_a_billion_rows_is_refused_before_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "manifest.parquet"
    rows = pa.table({"toss_id": pa.array(np.zeros(10_000_001, dtype=np.int8))})
    pq.write_table(rows, path, compression="zstd")
    assert path.stat().st_size < 100_000
    with pytest.raises(UnreadableInputError, match="found 10000001 rows, expected at most"):
        read_manifest(path)


def written_with(path: Path, column: str, values: pa.Array) -> Path:
    """A manifest whose first toss is repeated for the values of a column."""
    write_manifest(MANIFEST, path)
    table = pq.read_table(path).take([0] * len(values))
    place = table.schema.get_field_index(column)
    changed = table.set_column(place, column, values).replace_schema_metadata(pq.read_schema(path).metadata)
    pq.write_table(changed, path, compression="zstd")
    return path


def test_a_row_with_millions_of_reasons_is_refused_before_it_is_read(tmp_path: Path) -> None:
    reasons = pa.ListArray.from_arrays(pa.array([0, 3_000_000], pa.int32()), pa.repeat("gap", 3_000_000))
    path = written_with(tmp_path / "manifest.parquet", "reasons", reasons)
    assert path.stat().st_size < 100_000
    with pytest.raises(UnreadableInputError, match="found 3000000 rows, expected at most"):
        read_manifest(path)


def test_a_long_text_that_is_stored_once_and_stands_in_many_rows_is_refused(tmp_path: Path) -> None:
    inputs = pa.DictionaryArray.from_arrays(pa.array([0] * 3000, pa.int32()), pa.array(["a" * 1_000_000]))
    path = written_with(tmp_path / "manifest.parquet", "input", inputs)
    assert path.stat().st_size < 100_000
    with pytest.raises(UnreadableInputError, match="its text has more than 2147483648 bytes"):
        read_manifest(path)


def test_a_table_that_another_program_saved_without_its_metadata_says_so(tmp_path: Path) -> None:
    path = tmp_path / "manifest.parquet"
    write_manifest(MANIFEST, path)
    pq.write_table(pq.read_table(path).replace_schema_metadata(None), path)
    with pytest.raises(UnreadableInputError, match="has no metadata contact_curation, which other programs leave out"):
        read_manifest(path)


@pytest.mark.parametrize(("written", "rewritten", "name"), [("true", "TRUE", "selected"), ("81", "8.1E+1", "frames")])
def test_a_value_that_a_spreadsheet_rewrote_is_named(tmp_path: Path, written: str, rewritten: str, name: str) -> None:
    path = tmp_path / "manifest.csv"
    write_manifest(MANIFEST, path)
    path.write_text(path.read_text().replace(f",{written},", f",{rewritten},", 1))
    with pytest.raises(UnreadableInputError, match=re.escape(f"{name}: found '{rewritten}'; if a spreadsheet wrote it")):
        read_manifest(path)


def test_the_last_of_many_tosses_that_is_there_twice_is_named_at_once() -> None:
    rows = [replace(RANKED, toss_id=str(number)) for number in (*range(200_000), 199_999)]
    began = process_time()
    with pytest.raises(InvalidValueError, match="toss 199999 twice"):
        Manifest(RUN, tuple(rows), {})
    assert process_time() - began < 10.0


def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "manifest.csv")
    with pytest.raises(UnreadableInputError, match="is no regular file"):
        read_manifest(tmp_path / "manifest.csv")
