"""`import contactnets`: the bag gives the tosses back."""

from pathlib import Path

import numpy as np
import pytest

from test.cli.commands import Cli


@pytest.fixture
def folder(contactnets_folder: Path, tmp_path: Path) -> Path:
    """Three real tosses, and a file that is none."""
    own = tmp_path / "few"
    own.mkdir()
    for number in (0, 1, 2):
        (own / f"{number}.pt").write_bytes((contactnets_folder / f"{number}.pt").read_bytes())
    (own / "3.pt").write_bytes(b"no tensor")
    return own


def test_the_bag_holds_the_tosses_and_says_what_was_skipped(cli: Cli, folder: Path, tmp_path: Path) -> None:
    done = cli("import", "contactnets", folder, "--out", tmp_path / "few.mcap", "--json")
    assert done.status == 0
    assert done.json["tosses"] == 3
    assert len(done.json["skipped"]) == 1
    assert [line for line in done.err_lines if "3.pt" in line and "warning" in line]
    ranked = cli("rank", tmp_path / "few.mcap", "--json").json
    assert ranked["outcomes"]["selected"] == 3
    lengths = sorted(row["frames"] for row in ranked["tosses"])
    direct = sorted(row["frames"] for row in cli("rank", folder, "--json").json["tosses"])
    assert np.abs(np.subtract(lengths, direct)).max() <= 25  # the rest at the end is cut off earlier, method.md 3


def test_people_are_told_in_one_line(cli: Cli, folder: Path, tmp_path: Path) -> None:
    done = cli("import", "contactnets", folder, "--out", tmp_path / "few.mcap")
    assert done.out.startswith(f"{tmp_path / 'few.mcap'}: 3 tosses")
    assert done.out.count("\n") == 1


def test_a_folder_without_tosses_is_one_clear_error_and_leaves_no_bag(cli: Cli, tmp_path: Path) -> None:
    done = cli("import", "contactnets", tmp_path, "--out", tmp_path / "none.mcap")
    assert (done.status, done.out) == (1, "")
    assert done.err == f"contact-curation: error: {tmp_path}: found no .pt files, expected ContactNets' N.pt\n"
    assert list(tmp_path.iterdir()) == []


def test_a_bag_of_some_files_keeps_their_numbers(cli: Cli, folder: Path, tmp_path: Path) -> None:
    done = cli("import", "contactnets", folder, "--tosses", "1-2", "--out", tmp_path / "some.mcap", "--json")
    assert (done.status, done.json["tosses"], done.json["skipped"]) == (0, 2, [])
    report = cli("rank", tmp_path / "some.mcap", "--no-figure", "--json", "--held-out", "2,400-569").json
    rows = sorted(report["tosses"], key=lambda row: row["first_stamp_ns"])
    assert [row["reasons"] for row in rows] == [[], ["held out"]]
    nothing = cli("rank", tmp_path / "some.mcap", "--held-out", "0")
    assert (nothing.status, "found numbers 0, expected some of the 2 tosses that passed" in nothing.err) == (
        1,
        True,
    )


def test_numbers_that_are_none_or_of_no_file_are_one_line(cli: Cli, folder: Path, tmp_path: Path) -> None:
    for words, line in (("seven", "--tosses: found seven"), ("400-569", "numbers to import: found none among the files")):
        done = cli("import", "contactnets", folder, "--tosses", words, "--out", tmp_path / "none.mcap")
        assert (done.status, len(done.err_lines), line in done.err) == (1, 1, True)
    assert not (tmp_path / "none.mcap").exists()
