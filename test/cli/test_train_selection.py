"""`train` on some of the tosses: those that a manifest keeps, the longest, those that a criterion chooses as it goes."""

import json
from pathlib import Path

import pytest

import contact_curation as cc
from test.cli.commands import Cli
from test.cli.trainings import SHORT, events
from test.storage.datasets.test_tagslam_bag import save_contactnets, synthetic_toss


@pytest.fixture
def manifest(cli: Cli, folder: Path, tmp_path: Path) -> Path:
    """Keeps four of the seven tosses."""
    out = tmp_path / "manifest.json"
    assert cli("rank", folder, "--top", 4, "--out", out, "--no-figure").status == 0
    return out


def selected_ids(manifest: Path) -> list[str]:
    return [row["toss_id"] for row in json.loads(manifest.read_text())["tosses"] if row["selected"]]


def test_the_kept_tosses_of_a_manifest_are_trained_on(cli: Cli, folder: Path, tmp_path: Path, manifest: Path) -> None:
    done = cli("train", folder, "--manifest", manifest, "--out", tmp_path / "a.safetensors", "--steps", 2, "--json")
    kept = selected_ids(manifest)
    assert done.json["training_tosses"] == sorted(kept)
    assert not set(done.json["held_out_tosses"]) & set(kept)
    assert done.err == ""


def test_what_is_held_out_wins_over_a_manifest_and_is_said(cli: Cli, folder: Path, tmp_path: Path, manifest: Path) -> None:
    kept = selected_ids(manifest)
    options = ("--manifest", manifest, "--out", tmp_path / "a.safetensors", "--steps", 2, "--held-out", kept[0], "--json")
    done = cli("train", folder, *options)
    assert done.json["training_tosses"] == sorted(kept[1:])
    assert done.err_lines == [f"contact-curation: warning: {manifest}: 1 of 4 selected tosses are held out: {kept[0]}"]


def test_kept_tosses_that_are_not_in_the_inputs_are_one_line(cli: Cli, folder: Path, tmp_path: Path, manifest: Path) -> None:
    kept = selected_ids(manifest)
    options = ("--manifest", manifest, "--held-out", "none", "--steps", 2, "--json")
    some = [folder / f"{toss_id}.pt" for toss_id in kept[1:]]
    done = cli("train", *some, *options, "--out", tmp_path / "a.safetensors")
    assert done.json["training_tosses"] == sorted(kept[1:])
    line = f"contact-curation: warning: {manifest}: 1 of 4 selected tosses are not in the inputs: {kept[0]}"
    assert done.err_lines == [line]
    others = [path for path in folder.iterdir() if path.stem not in kept]
    refused = cli("train", *others, *options, "--out", tmp_path / "b.safetensors")
    assert (refused.status, len(refused.err_lines)) == (1, 1)
    assert f"{manifest} was made from {folder.name}; you gave " in refused.err


def test_of_tosses_with_one_id_the_ranked_one_is_learned_from_and_another_in_its_place_is_said(
    cli: Cli, tmp_path: Path
) -> None:
    ranked, other, manifest = tmp_path / "ranked", tmp_path / "other", tmp_path / "m.json"
    for folder, height in ((ranked, 0.25), (other, 0.2)):
        folder.mkdir()
        save_contactnets(folder, 17, synthetic_toss(height))
    cli("rank", ranked, "--out", manifest, "--no-figure")
    trained = {}
    for name, inputs in (("alone", [ranked]), ("behind", [other, ranked]), ("replaced", [other])):
        out = tmp_path / f"{name}.safetensors"
        done = cli("train", *inputs, "--manifest", manifest, "--held-out", "none", "--steps", 2, "--out", out)
        assert done.status == 0, done.err
        trained[name] = out.read_bytes()
        line = f"{other / '17.pt'}: holds selected tosses, but its bytes are not those that were ranked"
        assert (line in done.err) == (name == "replaced")
    assert trained["alone"] == trained["behind"] != trained["replaced"]


def test_tosses_that_are_there_again_under_another_id_are_said(cli: Cli, tmp_path: Path) -> None:
    for number, height in ((16, 0.2), (17, 0.25), (18, 0.25)):
        save_contactnets(tmp_path, number, synthetic_toss(height))
    known, out = tmp_path / "m.safetensors", ("--out", tmp_path / "next.json")
    verbs = (
        ("train", tmp_path, "--held-out", "none", "--steps", 1, "--out", known),
        ("evaluate", known, tmp_path),
        ("design", "--known", tmp_path, "--exploration-throws", "--throws", 1, "--set", "design.pool=16", *out),
    )
    line = "1 toss is a copy under another id, 18 of 17: they count twice; give each recording once"
    for words in verbs:
        assert line in cli(*words).err
    apart = cli("train", tmp_path, "--held-out", 17, "--steps", 1, "--out", tmp_path / "n.safetensors")
    assert (apart.status, "count twice" in apart.err) == (0, False)
    assert line in cc.train(tmp_path, steps=1).warnings


def test_the_longest_are_the_baseline_of_any_model(cli: Cli, folder: Path, tmp_path: Path) -> None:
    ranked = cli("rank", folder, "--criterion", "longest", "--json").json["tosses"]
    longest = [row["toss_id"] for row in ranked if row["toss_id"] not in ("5", "6")][:2]
    for model in ("polytope", "end_to_end"):
        options = ("--model", model, "--top", 2, "--criterion", "longest", "--steps", 1, "--held-out", "5,6", "--json")
        done = cli("train", folder, *options, "--out", tmp_path / f"{model}.safetensors")
        assert done.json["training_tosses"] == sorted(longest)
        assert [one["trigger"] for one in done.json["selections"]] == ["first"]


def test_what_was_selected_is_told(cli: Cli, folder: Path, tmp_path: Path) -> None:
    options = (*SHORT, "--top", 2, "--criterion", "trace", "--rerank-every", 1)
    done = cli("train", folder, "--out", tmp_path / "a.safetensors", *options)
    assert "polytope trained on 2 of 5 tosses, " in done.out
    assert "2 tosses selected before the first step" in done.out
    assert ", after so many epochs (Spearman " in done.out
    told = [one for one in events(tmp_path / "a.jsonl") if one["event"] == "selection"]
    assert [one["trigger"] for one in told] == ["first"] + ["epochs"] * (len(told) - 1)
    assert len(told) > 2
    assert all(len(one["toss_ids"]) == 2 and set(one["toss_ids"]) <= set("01234") for one in told)


@pytest.mark.slow
def test_an_exact_training_selects_again_at_its_optimum_and_learns_from_the_last_set_alone(
    cli: Cli, folder: Path, tmp_path: Path
) -> None:
    exact = ("--protocol", "exact", "--held-out", "5,6", "--json")
    done = cli("train", folder, "--out", tmp_path / "a.safetensors", *exact, "--top", 2).json
    triggers = [one["trigger"] for one in done["selections"]]
    assert triggers[:2] == ["first", "optimum"]
    assert 2 <= len(triggers) <= 3
    assert done["training_tosses"] == sorted(done["selections"][-1]["toss_ids"])
    for option in (("--rerank-when-stale",), ("--rerank-every", 2)):
        refused = cli("train", folder, "--out", tmp_path / "c.safetensors", *exact, "--top", 2, *option)
        assert refused.status == 1
        assert f"{option[0]}: found --protocol exact, which selects again at each optimum" in refused.err
