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
        "--center-of-mass=3.25e-05,-0.0,0.0",
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


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["rank", "--variant", "literal"], "--variant: found literal with criterion representative, expected --criterion"),
        (["train", "--set", "ranking.whiten=true"], "--set ranking.whiten=true: found no --top, expected --top K"),
        (["train", "--top", 3, "--variant", "literal"], "--variant: found literal with criterion representative, expected"),
        (["train", "--top", 3, "--set", "staleness.steps=5"], "--set staleness.steps=5: found no --rerank-when-stale"),
        (["score", "--set", "gates.depth=0.01"], "unknown stage in --set gates: expected one of loss, poses, segmenter"),
        (["score", "--set", "rig.scale=1.01"], "unknown stage in --set rig: expected one of loss, poses, segmenter"),
        (["rig", "--set", "gates.depth=0.01"], "unknown stage in --set gates: expected one of poses, rig, segmenter"),
    ],
)
def test_an_option_that_would_change_nothing_is_refused(
    cli: Cli, golden: Path, true_parameters: Path, tmp_path: Path, words: list[object], why: str
) -> None:
    verb, *options = words
    score = ("--params", true_parameters, "--out", tmp_path / "s.npz")
    needed = {"train": ("--out", tmp_path / "m.safetensors"), "score": score}
    done = cli(verb, golden, *options, *needed.get(str(verb), ()))
    assert (done.status, done.out, len(done.err_lines)) == (1, "", 1)
    assert done.err.startswith(f"contact-curation: error: {why}")
    assert not {one.suffix for one in tmp_path.iterdir()} & {".safetensors", ".npz"}


@pytest.mark.slow
def test_tosses_that_are_read_otherwise_than_they_were_ranked_are_said(cli: Cli, golden: Path, tmp_path: Path) -> None:
    corrected, manifest, model = ["--set", "rig.scale=1.017"], tmp_path / "manifest.json", tmp_path / "model.safetensors"
    ahead = ("--set", "poses.transforms_ahead=0.01", *corrected)
    assert cli("rank", golden, *corrected, "--top", 4, "--out", manifest, "--no-figure").status == 0
    told = f"{manifest}: its tosses were ranked with --set rig.scale=1.017, and are read here with no such setting"
    small = ("--throws", 1, "--exploration-throws", "--set", "design.pool=16", "--out", tmp_path / "throws.json")
    for verb, *words in (
        ("train", golden, "--steps", 1, "--overwrite", "--out", model),
        ("design", "--known", golden, *small),
        ("export", golden, "--format", "contactnets", "--out", tmp_path / "files"),
        ("export", golden, "--format", "lerobot", "--out", tmp_path / "dataset"),
    ):
        otherwise = cli(verb, *words, "--manifest", manifest)
        assert otherwise.status == 0, otherwise.err
        assert told in otherwise.err
    alike = cli("train", golden, "--steps", 1, "--overwrite", "--out", model, "--manifest", manifest, *corrected)
    assert (alike.status, "were ranked with" in alike.err) == (0, False)
    moved = cli("train", golden, "--steps", 1, "--overwrite", "--out", model, "--manifest", manifest, *ahead)
    assert "and are read here with --set poses.transforms_ahead=0.01 --set rig.scale=1.017" in moved.err
