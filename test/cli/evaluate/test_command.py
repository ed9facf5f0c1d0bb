"""`evaluate`: the floor on real tosses, which tosses judge, what is known, two models, and one line for what is wrong."""

import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.models.model import Rows
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.models.registry import model_class
from contact_curation.contact.parameter_form import Form
from contact_curation.learning.checkpoints.stored_model import model_bytes, notes_of_bytes
from contact_curation.motion.transitions import transitions_of
from contact_curation.pipeline.learned_model import load_model
from contact_curation.storage.checkpoint_file import read_model, save_model
from test.cli.commands import Cli, write_parameters
from test.simulated import simulated_tosses

QUICK = ("--set", "bootstrap.resamples=100", "--set", "loss.threads=1")


@pytest.fixture(scope="module")
def checkpoint(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A polytope that was trained a little, 5 and 6 held out."""
    from contact_curation.cli.main import main

    out = tmp_path_factory.mktemp("model") / "cube.safetensors"
    words = ("train", folder, "--out", out, "--steps", 30, "--held-out", "5,6", "--set", "training.evaluation_steps=30")
    assert main([str(word) for word in words]) == 0
    return out


def means(report: dict[str, dict[str, dict[str, dict[str, float]]]], name: str) -> list[float]:
    return [report[name][measure]["mean"]["value"] for measure in ("position", "rotation", "penetration")]


@pytest.mark.slow
def test_the_true_cube_reaches_its_floor_on_all_real_tosses(cli: Cli, contactnets_folder: Path, true_parameters: Path) -> None:
    done = cli("evaluate", true_parameters, contactnets_folder, *QUICK, "--json")
    position, rotation, penetration = means(done.json["summaries"], str(true_parameters))
    assert done.json["tosses"] == 570
    assert position == pytest.approx(14.4, abs=0.3)
    assert rotation == pytest.approx(18.3, abs=0.5)
    assert penetration < 0.01
    assert done.json["models"][0]["mean_loss"] == pytest.approx(0.0189, abs=0.0002)
    assert done.json["models"][0]["not_finite"] == []


def test_a_judge_that_was_fitted_to_under_another_id_is_told(
    cli: Cli, folder: Path, true_parameters: Path, tmp_path: Path
) -> None:
    for name, source in (("0", "0"), ("1", "1"), ("2", "2"), ("3", "1")):
        (tmp_path / f"{name}.pt").write_bytes((folder / f"{source}.pt").read_bytes())
    report = cli("evaluate", true_parameters, tmp_path, *QUICK, "--held-out", "2-3", "--json").json
    assert report["duplicates"] == ["3"]
    everything, others = report["summaries"].values()
    rows = {row["toss_id"]: row["position"] for row in report["models"][0]["per_toss"]}
    assert everything["position"]["mean"]["value"] == pytest.approx(np.mean([rows["2"], rows["3"]]))
    assert others["position"]["mean"]["value"] == pytest.approx(rows["2"])


@pytest.mark.slow
def test_held_out_real_tosses_with_a_duplicate_among_the_others_are_told_and_left_out_of_a_table_of_their_own(
    cli: Cli, contactnets_folder: Path, true_parameters: Path
) -> None:
    done = cli("evaluate", true_parameters, contactnets_folder, *QUICK, "--held-out", "400-569", "--json")
    report = done.json
    duplicates = [413, 414, 415, 416, 436, 453, 454, 455, 456, 457, 528, 529, 530, 531, 532, 546, 547]
    assert sorted(map(int, report["duplicates"])) == duplicates  # docs/explanation/data.md
    assert report["tosses"] == 170
    rows = {int(row["toss_id"]): row["position"] for row in report["models"][0]["per_toss"]}
    assert sorted(rows) == list(range(400, 570))
    everything, others = report["summaries"].values()
    assert everything["position"]["mean"]["value"] == pytest.approx(np.mean(list(rows.values())))
    assert others["position"]["mean"]["value"] == pytest.approx(np.mean([rows[k] for k in rows if k not in duplicates]))
    assert report["known"]["tosses"] == 400


def test_a_checkpoint_is_judged_by_what_it_held_out_and_known_by_what_it_learned_from(
    cli: Cli, folder: Path, checkpoint: Path
) -> None:
    done = cli("evaluate", checkpoint, folder, *QUICK, "--json")
    assert done.err == ""
    assert done.json["chosen"] == f"held out by {checkpoint}"
    assert [row["toss_id"] for row in done.json["models"][0]["per_toss"]] == ["5", "6"]
    assert done.json["known"]["tosses"] == 5
    assert len(done.json["known"]["parameters"]) == 52
    assert len(done.json["known"]["vertices"]) == 8


def test_what_neither_judges_nor_was_learned_from_is_left_alone(
    cli: Cli, folder: Path, checkpoint: Path, tmp_path: Path
) -> None:
    assert cli("evaluate", checkpoint, folder, *QUICK, "--held-out", "5", "--json").json["known"]["tosses"] == 5
    out = tmp_path / "best.safetensors"
    trained = cli("train", folder, "--out", out, "--steps", 1, "--held-out", "5,6", "--top", 3, "--criterion", "longest")
    assert trained.status == 0
    assert cli("evaluate", out, folder, *QUICK, "--json").json["known"]["tosses"] == 3


def test_where_nothing_was_held_out_tosses_that_it_did_not_learn_from_judge(cli: Cli, folder: Path, tmp_path: Path) -> None:
    out, some = tmp_path / "all.safetensors", [folder / f"{number}.pt" for number in range(5)]
    assert cli("train", *some, "--out", out, "--steps", 1, "--held-out", "none").status == 0
    done = cli("evaluate", out, folder, *QUICK, "--json")
    assert done.json["chosen"] == f"{out} did not learn from them"
    assert [row["toss_id"] for row in done.json["models"][0]["per_toss"]] == ["5", "6"]
    assert done.json["known"]["tosses"] == 5
    assert cli("evaluate", out, *some, *QUICK, "--json").json["tosses"] == 5


def test_tosses_that_it_learned_from_are_no_judges_without_a_word(cli: Cli, folder: Path, checkpoint: Path) -> None:
    done = cli("evaluate", checkpoint, folder, *QUICK, "--held-out", "0,5")
    assert done.status == 0
    assert done.err_lines == [f"contact-curation: warning: {checkpoint}: it learned from 1 of the 2 tosses it is evaluated on"]


def test_every_set_that_was_learned_from_in_turn_is_no_judge_and_the_last_one_says_what_is_known(
    cli: Cli, folder: Path, tmp_path: Path
) -> None:
    out = tmp_path / "reranked.safetensors"
    options = ("--steps", 40, "--held-out", "5,6", "--top", 2, "--criterion", "trace", "--rerank-every", 1, "--json")
    selections = cli("train", folder, "--out", out, *options).json["selections"]
    ever, last = {toss for one in selections for toss in one["toss_ids"]}, set(selections[-1]["toss_ids"])
    assert len(ever) > len(last) == 2
    judged = cli("evaluate", out, folder, *QUICK, "--held-out", ",".join(sorted(ever)))
    line = f"{out}: it learned from {len(ever)} of the {len(ever)} tosses it is evaluated on"
    assert judged.err_lines == [f"contact-curation: warning: {line}"]
    assert cli("evaluate", out, folder, *QUICK, "--json").json["known"]["tosses"] == 2


def test_the_report_for_people_has_tables_of_errors_and_of_what_is_known(cli: Cli, folder: Path, checkpoint: Path) -> None:
    lines = cli("evaluate", checkpoint, folder, *QUICK).out.splitlines()
    assert lines[0] == f"evaluated on 2 of 7 tosses (5 not chosen): held out by {checkpoint}"
    words = [line.split() for line in lines]
    table = next(k for k, line in enumerate(lines) if "95 % interval" in line)
    assert [line[0] for line in words[table + 1 : table + 4]] == ["position", "rotation", "penetration"]
    known = [line for line in words if line[:1] in (["vertex"], ["friction"], ["tilt[0]"], ["tilt[1]"], ["height"])]
    assert len(known) == 28
    assert "what is known from the 5 others" in "\n".join(lines)
    assert "fewer tosses than parameters" in lines[-1]


def test_a_model_no_better_than_none_is_said_to_be_and_its_deviations_are_marked(
    cli: Cli, folder: Path, checkpoint: Path, tmp_path: Path
) -> None:
    """With hardly any friction the cube slides away."""
    report = cli("evaluate", checkpoint, folder, *QUICK, "--json").json
    plain = report["without_a_model"]
    assert set(plain) == {"stays where it was released", "lies from the start where it ends"}
    assert all(errors["position"] > 0.0 and errors["rotation"] > 0.0 for errors in plain.values())
    model = load_model(checkpoint).model
    assert isinstance(model, PolytopeModel)
    wrong = replace(model.geometry(), tangents=1e-4 * model.geometry().tangents)
    slippery = tmp_path / "slippery.safetensors"
    notes = notes_of_bytes(checkpoint.read_bytes(), checkpoint)
    slippery.write_bytes(model_bytes(PolytopeModel(wrong, model.body, model.form), notes))
    lines = cli("evaluate", slippery, folder, *QUICK).out.splitlines()
    assert any(line.startswith("without a model") for line in lines)
    doubts = [line for line in lines if "the model does not describe these motions: position is off by" in line]
    assert len(doubts) == 1
    assert any(line.startswith("careful: these are deviations of a model that does not describe") for line in lines)


def test_two_models_are_compared_toss_by_toss(cli: Cli, folder: Path, tmp_path: Path) -> None:
    good = write_parameters(tmp_path / "good.json")
    bad = write_parameters(tmp_path / "bad.json", tangents=(0.3 * np.eye(2, 3)).tolist())
    report = cli("evaluate", bad, folder, "--against", good, *QUICK, "--json").json
    ours, theirs, paired = (means(report["summaries"], name) for name in (str(bad), str(good), f"{bad} - {good}, toss by toss"))
    assert theirs[0] < 0.01 < 3.0 < ours[0]
    assert paired[0] == pytest.approx(ours[0] - theirs[0])
    assert report["summaries"][f"{bad} - {good}, toss by toss"]["position"]["mean"]["low"] > 0.0


def test_a_polytope_that_has_own_friction_vertices_than_it_touches_is_judged_as_a_rigid_body_too(
    cli: Cli, folder: Path, checkpoint: Path, tmp_path: Path
) -> None:
    summaries = cli("evaluate", checkpoint, folder, *QUICK, "--json").json["summaries"]
    own, rigid = summaries
    assert rigid == f"{own}, friction at the vertices of the gaps"
    model = read_model(checkpoint, CONTACTNETS_CUBE)
    assert isinstance(model, PolytopeModel)
    save_model(tmp_path / "rigid.safetensors", model.with_shared_vertices())
    words = ("evaluate", tmp_path / "rigid.safetensors", folder, *QUICK, "--held-out", "5,6", "--json")
    alone = cli(*words).json["summaries"]
    assert list(alone.values()) == [summaries[rigid]]  # it has nothing to add about itself
    assert means(alone, str(tmp_path / "rigid.safetensors")) != means(summaries, own)


def test_a_seed_moves_intervals_and_nothing_else(cli: Cli, folder: Path, tmp_path: Path) -> None:
    bad = write_parameters(tmp_path / "bad.json", tangents=(0.3 * np.eye(2, 3)).tolist())
    one, again, other = (
        cli("evaluate", bad, folder, *QUICK, "--seed", seed, "--json").json["summaries"][str(bad)]["position"]["mean"]
        for seed in (1, 1, 2)
    )
    assert one == again
    assert one["value"] == other["value"]
    assert one["low"] != other["low"]


def test_a_network_is_judged_and_what_is_known_of_it_is_said_in_a_line(cli: Cli, folder: Path, tmp_path: Path) -> None:
    rows = transitions_of(simulated_tosses(2, seed=3), CONTACTNETS_CUBE.length_scale)
    data = Rows(rows.before, rows.after, rows.dt)
    model = model_class("end_to_end").initial(CONTACTNETS_CUBE, Form.PHYSICAL, data, np.random.default_rng(1))
    save_model(tmp_path / "e2e.safetensors", model)
    done = cli("evaluate", tmp_path / "e2e.safetensors", folder / "3.pt", *QUICK)
    assert done.status == 0
    assert done.out.splitlines()[0] == "evaluated on 1 toss"
    assert "a network of end_to_end has none with units" in done.out
    assert "of so few: none" in done.out


def test_a_theta_with_a_scale_of_its_own_is_judged_and_what_is_known_of_it_is_said_in_a_line(
    cli: Cli, folder: Path, tmp_path: Path
) -> None:
    path = write_parameters(tmp_path / "scaled.json", normal=[0.0, 0.0, 0.9])
    done = cli("evaluate", path, folder, *QUICK, "--held-out", "5-6")
    assert done.status == 0
    assert "what is known is told of the physical form" in done.out


@pytest.mark.slow
def test_the_figure_is_drawn_for_one_and_two_models(cli: Cli, folder: Path, checkpoint: Path, tmp_path: Path) -> None:
    figure, true = tmp_path / "motion.png", write_parameters(tmp_path / "true.json")
    done = cli("evaluate", checkpoint, folder, "--against", true, "--held-out", "1-6", *QUICK, "--figure", figure)
    assert done.out.splitlines()[-1] == f"figure: {figure}"
    data = figure.read_bytes()
    assert data.startswith(b"\x89PNG")
    assert struct.unpack(">II", data[16:24])[0] == 1600


@pytest.mark.parametrize(
    ("words", "found"),
    [
        (("MISSING.safetensors", "FOLDER"), "cannot be read"),
        (("MISSING.json", "FOLDER"), "cannot be read"),
        (
            ("CHECKPOINT", "FOLDER", "--held-out", "99"),
            "found numbers 99, expected some of the 7 tosses that passed",
        ),
        (("CHECKPOINT", "FOLDER/0.pt"), "none of the 2 that"),
        (("CHECKPOINT", "FOLDER", "--against", "MISSING.json"), "cannot be read"),
        (("CHECKPOINT", "FOLDER", "--figure", "FOLDER/none/such.png"), "a path that can be written"),
        (("CHECKPOINT", "FOLDER", "--set", "bootstrap.confidence=2"), "bootstrap.confidence"),
        (("CHECKPOINT", "FOLDER", "--set", "known.tilt=0"), "known.tilt"),
    ],
)
def test_what_cannot_be_done_is_one_line(cli: Cli, folder: Path, checkpoint: Path, words: tuple[str, ...], found: str) -> None:
    places = {"FOLDER": str(folder), "CHECKPOINT": str(checkpoint)}
    given = [places.get(word, word.replace("FOLDER", str(folder))) for word in words]
    done = cli("evaluate", *given, "--set", "bootstrap.resamples=50") if "--set" not in words else cli("evaluate", *given)
    assert done.status == 1
    assert found in done.err_lines[-1]
    assert sum("error" in line for line in done.err_lines) == 1


@pytest.mark.slow
def test_what_was_left_out_is_said_and_a_fit_to_the_optimum_is_not_called_badly_trained(
    cli: Cli, golden: Path, tmp_path: Path
) -> None:
    checkpoint = tmp_path / "exact.safetensors"
    assert cli("train", golden, "--protocol", "exact", "--held-out", "0-2", "--out", checkpoint).status == 0
    judged = cli("evaluate", checkpoint, golden, *QUICK)
    assert judged.out.startswith(
        "evaluated on 3 of 24 tosses (3 rejected: displacement beside the velocity, gap, lowest corner of the toss; "
        f"18 not chosen): held out by {checkpoint}\n"
    )
    assert "Newton step" in judged.out
    assert "the training ended at its optimum" in judged.out
    assert "not to the end" not in judged.out
