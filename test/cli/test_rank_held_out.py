"""`rank --held-out`: what is held out is counted and named, and changes no number of the others."""

from pathlib import Path
from typing import Any

import pytest
import torch

from contact_curation.pipeline.reading import InputReader
from test.cli.commands import ASSUMES_THE_CUBE, Cli
from test.storage.datasets.test_tagslam_bag import save_contactnets, synthetic_toss


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Four tosses and, in another folder, the third of them under another heading."""
    (tmp_path / "files").mkdir()
    (tmp_path / "more").mkdir()
    for number, height in enumerate((0.2, 0.18, 0.25, 0.22)):
        save_contactnets(tmp_path / "files", number, synthetic_toss(height))
    rows = torch.load(tmp_path / "files" / "2.pt", weights_only=True)
    half_turn = torch.tensor([-1.0, -1.0, 1.0])
    rows[..., 0:3] *= half_turn
    rows[..., 7:10] *= half_turn
    rows[..., 3:7] = torch.stack([-rows[..., 6], -rows[..., 5], rows[..., 4], rows[..., 3]], dim=-1)
    torch.save(rows, tmp_path / "more" / "7.pt")
    return tmp_path


def ranked(report: Any) -> dict[str, tuple[int, float]]:
    return {row["toss_id"]: (row["rank"], row["score"]) for row in report["tosses"] if row["rank"] is not None}


def test_held_out_tosses_and_their_duplicates_are_not_in_the_pool(cli: Cli, folder: Path) -> None:
    inputs = (folder / "more", folder / "files")  # the duplicate comes before what is held out
    words = ("--no-figure", "--json", "--bound-influence", "--no-gate", "--jobs", "1")
    report = cli("rank", *inputs, "--held-out", "2-3", *words).json
    (folder / "fewer").mkdir()
    for number in (0, 1):
        (folder / "fewer" / f"{number}.pt").symlink_to(folder / "files" / f"{number}.pt")
    alone = cli("rank", folder / "fewer", *words).json
    assert ranked(report) == ranked(alone)
    assert (report["influence_bound"], report["diagnostics"]) == (alone["influence_bound"], alone["diagnostics"])
    others = {row["toss_id"]: row for row in report["tosses"] if row["rank"] is None}
    assert {toss_id: row["reasons"] for toss_id, row in others.items()} == {
        "2": ["held out"], "3": ["held out"], "7": ["duplicate of a held-out toss: 2"],
    }  # fmt: skip
    assert not any(row["selected"] or row["trace"] for row in others.values())
    assert report["outcomes"] == {"selected": 2, "not selected": 0, "held out": 2, "duplicate of a held-out toss": 1}


@pytest.mark.parametrize("bound", [(), ("--bound-influence",)])
def test_an_index_holds_out_the_same_and_another_held_out_set_reads_nothing(
    cli: Cli, folder: Path, monkeypatch: pytest.MonkeyPatch, bound: tuple[str, ...]
) -> None:
    opened: list[str] = []
    outcomes = InputReader.outcomes

    def heard(reader: Any) -> Any:
        opened.append(reader._path.name)
        return outcomes(reader)

    monkeypatch.setattr(InputReader, "outcomes", heard)

    inputs = (folder / "more", folder / "files")  # the duplicate comes before what is held out

    def manifest(spec: str, *words: object) -> Any:
        outcome = cli("rank", *inputs, "--held-out", spec, "--no-figure", "--json", "--no-gate", *bound, *words)
        assert outcome.status == 0, outcome.err
        return outcome.json

    index = ("--index", folder / "index")
    cold = manifest("2", *index)
    assert opened == ["more", "files"]
    assert cold["rejected"] == [
        {"input": str(folder / "more"), "reasons": {"duplicate of a held-out toss": 1}},
        {"input": str(folder / "files"), "reasons": {"held out": 1}},
    ]
    opened.clear()
    assert [manifest(spec, *index) for spec in ("2", "7", "0,3")] == [cold, manifest("7"), manifest("0,3")]
    assert len(opened) == 2 * 2 + (0 if bound else 2)  # those without an index, and both again for a possible duplicate


def test_recordings_that_lost_half_of_their_tosses_are_named_with_an_index_as_without(cli: Cli, folder: Path) -> None:
    words = ("rank", folder / "more", folder / "files", "--held-out", "2-3", "--no-figure", "--no-gate")
    said = [cli(*words, *index).out for index in ((), *[("--index", folder / "index")] * 2)]
    assert f"rejected of {folder / 'files'}: 2 of 4 (2 held out)" in said[0].splitlines()
    assert said[1:] == [said[0]] * 2


def test_a_toss_is_held_out_by_its_place_in_a_recording_and_kept_back_ones_count(cli: Cli, golden: Path) -> None:
    whole = cli("rank", golden, "--no-figure", "--json").json
    some = cli("rank", golden, "--no-figure", "--json", "--held-out", "0-9").json
    rows = sorted(some["tosses"], key=lambda row: row["first_stamp_ns"])
    rejected = {row["toss_id"] for row in whole["tosses"] if row["rejected"]}
    for row in rows[:10]:
        assert row["toss_id"] in rejected or row["reasons"] == ["held out"]
    assert all(row["rank"] or row["toss_id"] in rejected for row in rows[10:])
    said = cli("rank", golden, "--no-figure", "--held-out", "0-9").out
    assert f"rejected: {some['outcomes']['held out']} (held out)" in said


@pytest.mark.slow
def test_what_holds_out_nothing_or_everything_is_one_line(cli: Cli, golden: Path, tmp_path: Path) -> None:
    none = cli("rank", golden, "--held-out", "400-569")
    said = "--held-out: found numbers 400-569, expected some of the 21 tosses that passed, from 0 to 23"
    assert (none.status, none.err_lines[-1]) == (1, f"contact-curation: error: {said}")
    everything = cli("rank", golden, "--held-out", "0-99")
    assert everything.status == 1
    assert "21 held out" in everything.err
    (tmp_path / "ids.txt").write_text("nobody\n" + cli("rank", golden, "--json", "--no-figure").json["tosses"][0]["toss_id"])
    unknown = cli("rank", golden, "--no-figure", "--held-out", tmp_path / "ids.txt")
    assert (unknown.status, unknown.err_lines[1:]) == (0, [ASSUMES_THE_CUBE])
    assert "1 of 2 ids are not among the tosses: nobody" in unknown.err
