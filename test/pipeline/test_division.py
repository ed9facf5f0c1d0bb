"""`--held-out SPEC`: numbers, a share, ids of a file or a manifest, none; anything else is one line."""

from pathlib import Path

import pytest

from contact_curation.errors import ContactCurationError
from contact_curation.learning.evaluation.held_out import HeldOutRule
from contact_curation.pipeline.division import _check_something_is_held_out, held_out_rule
from test.cli.commands import Cli


@pytest.mark.parametrize(
    ("spec", "rule"),
    [
        ("400-569", HeldOutRule(spans=((400, 569),))),
        ("3", HeldOutRule(spans=((3, 3),))),
        ("3,7-9,12", HeldOutRule(spans=((3, 3), (7, 9), (12, 12)))),
        ("0.25", HeldOutRule(share=0.25)),
        (".5", HeldOutRule(share=0.5)),
        ("none", HeldOutRule()),
    ],
)
def test_a_specification_is_a_rule(spec: str, rule: HeldOutRule) -> None:
    assert held_out_rule(spec) == rule


@pytest.mark.parametrize("spec", ["569-400", "1.5", "400-", "20%", "", "nowhere.txt", "-3", "1-2-3"])
def test_anything_else_is_one_line(spec: str) -> None:
    with pytest.raises(ContactCurationError, match=r"held.out"):
        held_out_rule(spec)


def test_numbers_that_come_again_in_each_recording_are_said_to() -> None:
    for numbers, end in (([0, 1], "from 0 to 1"), ([0, 0, 1], "from 0 to 1, counted in each recording")):
        with pytest.raises(ContactCurationError, match=rf"tosses that passed, {end}$"):
            _check_something_is_held_out(HeldOutRule(spans=((5, 5),)), 0, numbers)


def test_a_message_quotes_what_was_found_and_names_the_option() -> None:
    with pytest.raises(ContactCurationError, match=r"^--held-out: found '', expected numbers such as"):
        held_out_rule("")


def test_a_file_holds_an_id_a_line(tmp_path: Path) -> None:
    (tmp_path / "ids").write_text("cube-1-aa\n\n  cube-2-bb \n")
    assert held_out_rule(tmp_path / "ids") == held_out_rule(str(tmp_path / "ids"))
    assert held_out_rule(str(tmp_path / "ids")) == HeldOutRule(ids=frozenset({"cube-1-aa", "cube-2-bb"}))


@pytest.mark.parametrize(("content", "why"), [(b"\n \n", "0 ids"), (b"\xff\xfe\x00", "holds no text")])
def test_a_file_without_ids_is_refused(tmp_path: Path, content: bytes, why: str) -> None:
    (tmp_path / "ids").write_bytes(content)
    with pytest.raises(ContactCurationError, match=why):
        held_out_rule(str(tmp_path / "ids"))
    with pytest.raises(ContactCurationError, match="cannot be read"):
        held_out_rule(str(tmp_path))


def test_a_manifest_holds_out_what_it_kept(cli: Cli, golden: Path, tmp_path: Path) -> None:
    report = cli("rank", golden, "--top", 3, "--out", tmp_path / "m.csv", "--no-figure", "--json").json
    kept = frozenset(row["toss_id"] for row in report["tosses"] if row["selected"])
    assert held_out_rule(str(tmp_path / "m.csv")) == HeldOutRule(ids=kept)
    (tmp_path / "other.csv").write_text("a,b\n1,2\n")
    with pytest.raises(ContactCurationError, match="is no manifest"):
        held_out_rule(str(tmp_path / "other.csv"))
