"""Options that say nothing together are refused in one line, not passed over."""

import shlex
from pathlib import Path

import pytest

from test.cli.commands import Cli
from test.cli.test_bad_input import BRICK


@pytest.fixture
def manifest(cli: Cli, golden: Path, tmp_path: Path) -> Path:
    path = tmp_path / "manifest.csv"
    assert cli("rank", golden, "--top", "4", "--out", path, "--no-figure").status == 0
    return path


def test_a_manifest_without_the_recordings_that_it_is_of_is_refused(cli: Cli, manifest: Path, tmp_path: Path) -> None:
    done = cli("design", "--manifest", manifest, "--throws", "1", "--out", tmp_path / "throws.json")
    assert (done.status, done.out, len(done.err_lines)) == (1, "", 1)
    assert done.err.startswith(
        f"contact-curation: error: --manifest: found {manifest} and no --known, expected --known INPUT..."
    )


def test_a_number_of_gradient_steps_is_refused_by_the_protocol_that_takes_none(cli: Cli, golden: Path, tmp_path: Path) -> None:
    out = tmp_path / "model.safetensors"
    done = cli("train", golden, "--protocol", "exact", "--steps", "3", "--out", out)
    assert (done.status, done.out, len(done.err_lines)) == (1, "", 1)
    assert "--steps: found --protocol exact, which takes none, expected --protocol budgeted or published" in done.err
    assert list(tmp_path.iterdir()) == []


def test_all_tosses_judge_where_the_user_holds_out_none_whatever_the_checkpoint_held_out(
    cli: Cli, golden: Path, tmp_path: Path
) -> None:
    model = tmp_path / "model.safetensors"
    assert cli("train", golden, "--steps", "1", "--held-out", "0-2", "--out", model).status == 0
    done = cli("evaluate", model, golden, "--held-out", "none", "--json")
    assert (done.status, done.json["chosen"], done.json["tosses"]) == (0, "", 21)
    assert f"{model}: it learned from 18 of the 21 tosses it is evaluated on" in done.err


def test_the_command_that_train_proposes_reads_the_recordings_as_it_did(cli: Cli, golden: Path, tmp_path: Path) -> None:
    body = tmp_path / "brick.yaml"
    body.write_text(BRICK)
    options = [
        "--body",
        body,
        "--topic",
        "/tagslam/odom/body_cube",
        "--board-frame",
        "body_surface",
        "--set",
        "gates.depth=0.01",
    ]
    words = ["--steps", 1, "--held-out", "0-2", "--set", "training.batch=8", "--out", tmp_path / "model.safetensors"]
    trained = cli("train", golden, *options, *words)
    name, *proposed = shlex.split(trained.out.splitlines()[-1].removeprefix("next: "))
    assert name == "contact-curation"
    assert proposed[3:] == list(map(str, options))
    assert cli(*proposed).status == 0


def test_a_pool_that_is_smaller_than_what_is_to_be_kept_is_told(cli: Cli, golden: Path) -> None:
    told = "every toss that could be ranked is selected: there are no more than were asked for"
    assert told in cli("rank", golden, "--top", "1000").out
    assert told not in cli("rank", golden, "--top", "20").out
