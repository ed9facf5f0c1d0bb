"""`export`: the selected tosses as parts of their recordings, ContactNets' files or a LeRobot dataset; or one line why not."""

import hashlib
import shutil
from pathlib import Path
from typing import Any

import pytest

from contact_curation.cli.export import KINDS
from contact_curation.cli.main import main
from contact_curation.pipeline.export import FORMATS, file_names
from contact_curation.storage.export import mcap as export_mcap
from contact_curation.storage.manifest.file import read_manifest
from test.cli.commands import Cli
from test.storage.datasets.test_tagslam_bag import save_contactnets, synthetic_toss
from test.storage.inputs.test_inputs import rosbag2_sqlite

TOP = 6


@pytest.fixture(scope="module")
def ranked(golden: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("ranked") / "manifest.csv"
    assert main(["rank", str(golden), "--top", str(TOP), "--out", str(path), "--no-figure"]) == 0
    return path


@pytest.fixture
def manifest(ranked: Path, tmp_path: Path) -> Path:
    """Of the golden bag; a copy, for tests that look whether it is left alone."""
    shutil.copy(ranked.with_suffix(".provenance.json"), tmp_path)
    return Path(shutil.copy(ranked, tmp_path / "manifest.csv"))


def digests(folder: Path) -> dict[str, str]:
    files = [folder] if folder.is_file() else [path for path in folder.rglob("*") if path.is_file()]
    return {str(path): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def evidence(report: Any) -> dict[str, tuple[float, float]]:
    return {row["toss_id"]: (row["trace"], row["mean_loss"]) for row in report["tosses"]}


def test_an_exported_part_ranks_like_the_tosses_in_the_whole(cli: Cli, golden: Path, manifest: Path, tmp_path: Path) -> None:
    before = digests(golden)
    done = cli("export", golden, "--manifest", manifest, "--format", "mcap", "--out", tmp_path / "kept")
    assert (done.status, done.out) == (0, f"{tmp_path / 'kept'}: {TOP} of 24 tosses, 3 files\n")
    whole = cli("rank", golden, "--top", TOP, "--json").json
    again = cli("rank", tmp_path / "kept" / "golden.mcap", "--top", TOP, "--json").json
    assert evidence(again) == dict(list(evidence(whole).items())[:TOP])
    listed = read_manifest(tmp_path / "kept" / "manifest.json")
    assert listed.selected == listed.rows == read_manifest(manifest).selected
    assert listed.run == read_manifest(manifest).run
    assert digests(golden) == before


@pytest.mark.parametrize(("form", "files"), [("mcap", TOP + 2), ("contactnets", TOP + 2), ("lerobot", 7)])
def test_every_format_says_where_each_toss_went(
    cli: Cli, golden: Path, manifest: Path, tmp_path: Path, form: str, files: int
) -> None:
    out = tmp_path / "out"
    per_toss = ["--per-toss"] if form == "mcap" else []
    report = cli("export", golden, "--manifest", manifest, "--format", form, "--out", out, "--json", *per_toss).json
    kept = [row.toss_id for row in read_manifest(manifest).selected]
    assert (report["out"], report["format"], report["warnings"]) == (str(out), form, [])
    assert [(one["toss_id"], one["rank"]) for one in report["tosses"]] == list(zip(kept, range(1, TOP + 1)))
    places = [one["place"] for one in report["tosses"]]
    if form == "lerobot":
        assert places == [f"episode {number}" for number in range(TOP)]
    else:
        assert all((out / place).is_file() for place in places)
        assert len(set(places)) == TOP
    assert len(digests(out)) == files


def test_what_contactnets_files_hold_ranks_like_the_recording(cli: Cli, golden: Path, manifest: Path, tmp_path: Path) -> None:
    cli("export", golden, "--manifest", manifest, "--format", "contactnets", "--out", tmp_path / "out")
    again = cli("rank", tmp_path / "out", "--top", TOP, "--json").json
    traces = sorted(row["trace"] for row in again["tosses"])
    assert traces == pytest.approx(sorted(row.trace or 0.0 for row in read_manifest(manifest).selected), rel=1e-6)


@pytest.mark.parametrize("form", ["golden", "files"])
def test_contactnets_files_of_a_rig_hold_what_is_corrected(cli: Cli, golden: Path, tmp_path: Path, form: str) -> None:
    manifest, rig, source = tmp_path / "m.csv", ("--set", "rig.scale=1.01"), golden
    if form == "files":
        cli("rank", golden, "--top", TOP, "--no-figure", "--out", manifest)
        cli("export", golden, "--manifest", manifest, "--format", "contactnets", "--out", tmp_path / "files")
        source = tmp_path / "files"
    cli("rank", source, *rig, "--top", 3, "--no-figure", "--out", manifest)
    assert cli("export", source, *rig, "--manifest", manifest, "--format", "contactnets", "--out", tmp_path / "out").status == 0
    right = cli("rank", tmp_path / "out", "--top", 3, "--json").json
    kept = read_manifest(manifest).selected
    assert sorted(row["trace"] for row in right["tosses"]) == pytest.approx(sorted(row.trace or 0.0 for row in kept), rel=1e-6)


def test_several_inputs_of_several_kinds_each_give_their_own(cli: Cli, golden: Path, tmp_path: Path) -> None:
    other, manifest = rosbag2_sqlite(tmp_path), tmp_path / "m.parquet"
    cli("rank", golden, other, "--top", 23, "--jobs", 1, "--out", manifest, "--no-figure")
    done = cli("export", golden, other, "--manifest", manifest, "--format", "mcap", "--out", tmp_path / "out", "--json")
    assert {one["place"] for one in done.json["tosses"]} == {"golden.mcap", "a.mcap"}
    assert len(done.json["tosses"]) == 23


def test_a_copy_of_an_input_gives_nothing_twice(cli: Cli, golden: Path, manifest: Path, tmp_path: Path) -> None:
    copy = shutil.copy(golden, tmp_path / "copy.mcap")
    done = cli("export", copy, golden, "--manifest", manifest, "--format", "mcap", "--out", tmp_path / "out")
    assert done.status == 0
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"README.md", "copy.mcap", "manifest.json"}


def test_of_tosses_with_one_id_the_ranked_one_is_exported_whatever_the_order_of_the_inputs(cli: Cli, tmp_path: Path) -> None:
    ranked, other, manifest = tmp_path / "ranked", tmp_path / "other", tmp_path / "m.csv"
    for folder, height in ((ranked, 0.25), (other, 0.2)):
        folder.mkdir()
        save_contactnets(folder, 17, synthetic_toss(height))
    cli("rank", ranked, "--out", manifest, "--no-figure")
    done = cli("export", other, ranked, "--manifest", manifest, "--format", "contactnets", "--out", tmp_path / "out")
    assert done.status == 0
    assert "its bytes are not those" not in done.err
    assert digests(tmp_path / "out" / "tosses_processed").popitem()[1] == digests(ranked).popitem()[1]


def test_so_it_is_where_each_input_was_ranked_for_another_toss(cli: Cli, tmp_path: Path) -> None:
    first, second, manifest = tmp_path / "first", tmp_path / "second", tmp_path / "m.csv"
    for folder, other, height in ((first, 17, 0.25), (second, 18, 0.2)):
        folder.mkdir()
        save_contactnets(folder, 16, synthetic_toss(height + 0.02))
        save_contactnets(folder, other, synthetic_toss(height))
    cli("rank", first, second, "--out", manifest, "--no-figure")
    done = cli("export", second, first, "--manifest", manifest, "--format", "contactnets", "--out", tmp_path / "out")
    assert done.status == 0
    assert "its bytes are not those" not in done.err
    exported = set(digests(tmp_path / "out" / "tosses_processed").values())
    assert exported == {*digests(first).values(), digests(second)[str(second / "18.pt")]}


def test_recordings_of_one_name_do_not_take_each_others_place(tmp_path: Path) -> None:
    (tmp_path / "c" / "run.v2").mkdir(parents=True)
    paths = [Path("a/run.mcap"), Path("b/run.bag"), Path("run.db3"), Path("run-2.mcap"), tmp_path / "c" / "run.v2"]
    assert file_names(paths) == ["run.mcap", "run-2.mcap", "run-3.mcap", "run-2-2.mcap", "run.v2.mcap"]


def refused(cli: Cli, *words: object) -> str:
    done = cli("export", *words)
    assert (done.status, done.out) == (1, "")
    (line,) = done.err_lines
    return line


@pytest.mark.parametrize("form", KINDS)
def test_tosses_that_are_not_in_the_inputs_are_one_line_and_nothing_is_written(
    cli: Cli, manifest: Path, tmp_path: Path, form: str
) -> None:
    other = rosbag2_sqlite(tmp_path)
    line = refused(cli, other, "--manifest", manifest, "--format", form, "--out", tmp_path / "out")
    assert f"{TOP} of {TOP} selected tosses of {manifest} not in them: cube-" in line
    assert "golden.mcap" in line
    assert {path.name for path in tmp_path.iterdir()} == {"manifest.csv", "manifest.provenance.json", "a"}


def test_a_folder_that_is_not_empty_is_left_alone(cli: Cli, golden: Path, manifest: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    options = ("--manifest", manifest, "--format", "lerobot", "--out")
    assert cli("export", golden, *options, out).status == 0, "an empty one will do"
    before = digests(out)
    assert "out, a folder that is not empty, expected a folder that is empty" in refused(cli, golden, *options, out)
    assert "manifest.csv, a file, expected a folder" in refused(cli, golden, *options, manifest)
    assert digests(out) == before


def test_what_else_cannot_be_done_is_one_line(cli: Cli, golden: Path, manifest: Path, tmp_path: Path) -> None:
    out = ("--out", tmp_path / "out")
    save_contactnets(tmp_path, 0, synthetic_toss())
    (tmp_path / "other.json").write_text('{"tosses": 24}')
    assert "is no manifest" in refused(cli, golden, "--manifest", tmp_path / "other.json", "--format", "mcap", *out)
    line = refused(cli, tmp_path / "0.pt", "--manifest", manifest, "--format", "mcap", *out)
    assert "0.pt, expected a recording; `contact-curation import contactnets DIR" in line
    line = refused(cli, golden, "--manifest", manifest, "--format", "lerobot", "--per-toss", *out)
    assert "found --format lerobot, expected --format mcap" in line
    missing = refused(cli, tmp_path / "none.mcap", "--manifest", manifest, "--format", "mcap", *out)
    assert "none.mcap" in missing
    assert not (tmp_path / "out").exists()


def test_a_toss_that_comes_out_otherwise_is_not_said_to_be_missing(
    cli: Cli, golden: Path, manifest: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(export_mcap, "digests_in", lambda *_: {})
    done = cli("export", golden, "--manifest", manifest, "--format", "mcap", "--out", tmp_path / "kept")
    assert done.status == 1
    assert done.err_lines[-1].startswith(f"contact-curation: error: {golden}: found toss cube-")
    assert done.err_lines[-1].endswith("poses before them): export to another --format")
    assert "not in them" not in done.err
    assert not (tmp_path / "kept").exists()


def test_every_format_has_its_writer() -> None:
    assert tuple(FORMATS) == KINDS


def test_every_export_carries_a_card_of_its_tosses_their_source_and_what_was_left_out(
    cli: Cli, golden: Path, manifest: Path, tmp_path: Path
) -> None:
    for form in KINDS:
        cli("export", golden, "--manifest", manifest, "--format", form, "--out", tmp_path / form)
        card = (tmp_path / form / "README.md").read_text()
        ranked = read_manifest(manifest)
        assert card.startswith("---\nlicense: unknown  # TO BE FILLED IN")
        assert f"| {golden} | `{ranked.run.inputs[0].sha256}` | {TOP} |" in card
        assert f"24 tosses were found and {TOP} were selected" in card
        assert "| 15 | not selected by the ranking |" in card
        assert "| 1 | not ranked: gap |" in card
        assert ("configs: " in card) == (form == "lerobot"), "by which datasets finds the frames"
        assert "criterion representative, estimator gauss-newton" in card


def test_the_card_counts_tosses_of_a_folder_and_stands_where_all_are_selected(
    cli: Cli, golden: Path, manifest: Path, tmp_path: Path
) -> None:
    cli("export", golden, "--manifest", manifest, "--format", "contactnets", "--out", tmp_path / "a|b")
    cli("rank", tmp_path / "a|b", tmp_path / "gone.mcap", "--no-figure", "--out", tmp_path / "all.csv")
    cli("export", tmp_path / "a|b", "--manifest", tmp_path / "all.csv", "--format", "lerobot", "--out", tmp_path / "out")
    card = (tmp_path / "out" / "README.md").read_text()
    rows = [line for line in card.splitlines() if line.startswith(f"| {tmp_path}")]
    digest = read_manifest(tmp_path / "all.csv").run.inputs[0].sha256
    assert rows == [f"| {tmp_path}/a\\|b | `{digest}` | {TOP} |", f"| {tmp_path}/gone.mcap | not read | 0 |"]
    assert f"{TOP} tosses were found and {TOP} were selected.\n\nA selection" in card
