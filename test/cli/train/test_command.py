"""`train`: what it learns from and what it never sees, what it says, one line for what is wrong."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

import contact_curation as cc
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.motion.gate_config import GateConfig
from contact_curation.motion.toss import Toss
from contact_curation.storage.checkpoint_file import read_model
from contact_curation.storage.inputs.inputs import InputsConfig, open_inputs
from test.cli.commands import ASSUMES_THE_CUBE, Cli, write_parameters
from test.cli.simulated_files import write_simulated
from test.cli.trainings import SHORT, events, numbers


def test_a_bag_is_trained_on_and_its_held_out_loss_falls(cli: Cli, golden: Path, tmp_path: Path) -> None:
    out = tmp_path / "cube.safetensors"
    done = cli("train", golden, "--out", out, "--steps", 60, "--set", "training.evaluation_steps=30")
    assert done.status == 0
    lines = done.out.splitlines()
    assert lines[0].startswith("polytope trained on 18 tosses, ")
    assert {"rejected: 1 (gap)", f"checkpoint: {out}", f"metrics: {tmp_path / 'cube.jsonl'}"} <= set(lines)
    assert lines[-1] == f"next: contact-curation evaluate {out} {golden}"
    told = events(tmp_path / "cube.jsonl")
    assert [one["event"] for one in told] == ["start", "evaluation", "evaluation", "end"]
    assert told[-1]["held_out_loss"] < 0.3 * told[0]["held_out_loss"]
    assert f"held-out loss {told[0]['held_out_loss']:.4g} before, {told[-1]['held_out_loss']:.4g} after" in done.out
    assert read_model(out, CONTACTNETS_CUBE).kind == "polytope"
    assert done.err_lines == [ASSUMES_THE_CUBE]


def test_it_is_said_where_too_few_tosses_are_held_out_to_judge_by(cli: Cli, golden: Path, tmp_path: Path) -> None:
    out = tmp_path / "cube.safetensors"
    few = ", too few to judge by: hold out more, by --held-out"
    for share, said in ((0.1, True), (0.3, False)):
        done = cli("train", golden, "--out", out, "--overwrite", "--steps", 1, "--held-out", share)
        assert (few in done.out) == said


def test_contactnets_is_the_polytope_in_its_published_form(cli: Cli, folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "theirs.safetensors"
    assert cli("train", folder, "--model", "contactnets", "--out", out, *SHORT).status == 0
    model = read_model(out, CONTACTNETS_CUBE)
    assert (model.kind, sum(value.numel() for value in model.parameters())) == ("polytope", 57)


def test_json_is_one_object_and_says_all(cli: Cli, folder: Path, tmp_path: Path) -> None:
    done = cli("train", folder, "--out", tmp_path / "a.safetensors", *SHORT, "--json")
    assert done.out.count("\n") == 1
    report = done.json
    assert report["training_tosses"] == ["0", "1", "2", "3", "4"]
    assert report["held_out_tosses"] == ["5", "6"]
    assert (report["gradient_steps"], report["state"]) == (12, "spent")
    assert report["held_out_loss_after"] < report["held_out_loss_before"]


def test_the_same_seed_gives_the_same_numbers_and_another_one_others(cli: Cli, folder: Path, tmp_path: Path) -> None:
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        cli("train", folder, "--out", tmp_path / f"{name}.safetensors", *SHORT, "--seed", seed)
    a, b, c = (numbers(tmp_path / f"{name}.safetensors") for name in "abc")
    assert a == b
    assert a != c


@pytest.mark.slow
def test_exactly_a_polytope_is_trained_at_once_and_a_network_is_refused(cli: Cli, folder: Path, tmp_path: Path) -> None:
    how = ("--protocol", "exact", "--held-out", "5,6")
    done = cli("train", folder, "--out", tmp_path / "a.safetensors", *how, "--json")
    assert done.json["state"] == "converged"
    assert done.json["held_out_loss_after"] < 0.1 * done.json["held_out_loss_before"]
    assert done.json["bounce"]["tosses"] == 5
    assert done.json["more_throws"]["throws"] == 5
    judged = cli("evaluate", tmp_path / "a.safetensors", folder)
    of_evaluation = cli("evaluate", tmp_path / "a.safetensors", folder, "--json").json["more_throws"]
    assert of_evaluation == done.json["more_throws"]
    assert judged.out.splitlines()[-1].startswith(("5 more throws like these", "what more throws like these would change"))
    assert cli("evaluate", tmp_path / "a.safetensors", folder, "--more", 2, "--json").json["more_throws"]["throws"] == 2
    refused = cli("train", folder, "--out", tmp_path / "b.safetensors", *how, "--model", "deep")
    assert refused.status == 1
    assert "model to train exactly: found a deep, expected a polytope in the physical or the rigid form" in refused.err


@pytest.mark.slow
def test_corners_that_are_not_where_they_are_known_to_be_are_said(cli: Cli, tmp_path: Path) -> None:
    cube = ContactGeometry.of_body(CONTACTNETS_CUBE).rigid()
    smaller = replace(cube, vertices_normal=0.92 * cube.vertices_normal, vertices_tangent=0.92 * cube.vertices_tangent)
    tosses = write_simulated(tmp_path, 8, smaller)
    how = ("train", tosses, "--no-gate", "--shape-known-to", 0.0005)
    assert "careful: corners were learned up to" in cli(*how, "--out", tmp_path / "a.safetensors").out
    warned = cli(*how, "--out", tmp_path / "b.safetensors", "--json").json["warnings"]
    assert sum(line.startswith("corners were learned up to") for line in warned) == 1


@pytest.mark.slow
def test_that_tosses_bounce_is_said_by_training_and_evaluation_until_a_restitution_is_learned(cli: Cli, tmp_path: Path) -> None:
    bouncing = replace(ContactGeometry.of_body(CONTACTNETS_CUBE).rigid(), restitution=0.3)
    tosses, out = write_simulated(tmp_path, 10, bouncing), tmp_path / "a.safetensors"
    how = ("--held-out", "8,9", "--no-gate")
    trained = cli("train", tosses, "--out", out, *how)
    assert "careful: the tosses bounce, and the model does not: their restitution is 0." in trained.out
    assert trained.out.count("learn it, too: train --set training.restitution=true") == 1
    assert "careful: the tosses bounce" in cli("evaluate", out, tosses, "--no-gate").out
    read = cc.read(tosses, config=InputsConfig(gates=GateConfig(enabled=False)))
    warned = [line for line in cc.train(read, held_out="8,9").warnings if line.startswith("the tosses bounce")]
    assert len(warned) == 1
    assert warned[0].endswith("learn it, too: restitution=True")
    again = cli("train", tosses, "--out", out, "--overwrite", *how, "--set", "training.restitution=true")
    assert "careful" not in again.out
    assert "\nrestitution 0." in again.out
    assert "restitution" not in trained.out.replace("their restitution", "").replace("training.restitution", "")
    assert "careful: the tosses bounce" not in (judged := cli("evaluate", out, tosses, "--no-gate").out)
    assert [line for line in again.out.splitlines() if "more throws like these" in line] == judged.splitlines()[-1:]
    assert not any("bounce" in line for line in cc.train(read, held_out="8,9", restitution=True).warnings)


def test_numbers_in_a_recording_count_what_was_rejected(cli: Cli, golden: Path, tmp_path: Path) -> None:
    items = list(open_inputs([golden], CONTACTNETS_CUBE))  # 24, of which 5, 12 and 19 are rejected
    in_order = [item.toss_id if isinstance(item, Toss) else "rejected" for item in items]
    held_out = cli("train", golden, "--out", tmp_path / "a.safetensors", "--steps", 1, "--held-out", "6,19-21", "--json")
    assert held_out.json["held_out_tosses"] == sorted(in_order[place] for place in (6, 20, 21))
    refused = cli("train", golden, "--out", tmp_path / "b.safetensors", "--held-out", "12")
    assert refused.err_lines == [
        "contact-curation: error: --held-out: found numbers 12, expected some of the 21 tosses that passed, from 0 to 23"
    ]


def test_a_polytope_that_is_given_is_where_it_starts(cli: Cli, folder: Path, tmp_path: Path, true_parameters: Path) -> None:
    first = cli("train", folder, "--params", true_parameters, "--out", tmp_path / "a.safetensors", *SHORT, "--json").json
    assert first["held_out_loss_before"] < 1e-4  # the tosses are simulated without noise
    options = ("--params", tmp_path / "a.safetensors", *SHORT, "--json")
    second = cli("train", folder, *options, "--out", tmp_path / "b.safetensors").json
    assert second["held_out_loss_before"] == pytest.approx(first["held_out_loss_after"], rel=1e-9)
    for model, line in (("deep", "expected deep, which is to be trained"), ("polytope", "")):
        done = cli("train", folder, *options, "--model", model, "--out", tmp_path / f"{model}.safetensors")
        assert line in done.err
    refused = cli("train", folder, "--params", true_parameters, "--model", "deep", "--out", tmp_path / "c.safetensors")
    assert "expected a checkpoint of a deep model" in refused.err


@pytest.mark.slow
def test_a_shape_that_is_known_is_where_it_begins_and_about_where_it_ends(cli: Cli, folder: Path, tmp_path: Path) -> None:
    off = {}
    for name, options in {"random": (), "known": ("--shape-known-to", "0.0005")}.items():
        out = tmp_path / f"{name}.safetensors"
        done = cli("train", folder, "--out", out, "--held-out", "5,6", *options, "--json")
        assert (done.json["more_throws"] is None) is (name == "known")
        geometry = read_model(out, CONTACTNETS_CUBE).geometry()
        assert geometry is not None
        off[name] = 52.4 * np.abs(geometry.vertices_normal - CONTACTNETS_CUBE.scaled_vertices).max()
    assert off["known"] < 2.0
    assert off["random"] > 10.0
    widths = {
        name: cli("evaluate", tmp_path / f"{name}.safetensors", folder, "--json").json["known"]["parameters"] for name in off
    }
    interval = {name: max(one["interval"] for one in rows if one["unit"] == "mm") for name, rows in widths.items()}
    assert interval["known"] < 0.2 * interval["random"]
    trained = cc.train(folder, held_out="5,6", shape_known_to=0.0005)
    trained.save(tmp_path / "python.safetensors")
    assert trained.shape_known_to == 0.0005
    said = cli("train", folder, "--out", tmp_path / "said.safetensors", "--held-out", "5,6", "--shape-known-to", "0.0005")
    assert "corners were taken as known to 0.5 mm" in said.out.splitlines()
    assert numbers(tmp_path / "python.safetensors") == numbers(tmp_path / "known.safetensors")


def test_a_tilted_ground_stays_where_it_is_when_its_pivot_moves(cli: Cli, folder: Path, tmp_path: Path) -> None:
    lean, rise = float(np.sin(0.05)), float(np.cos(0.05))
    axes = [[0.18 * rise, 0.0, -0.18 * lean], [0.0, 0.18, 0.0]]
    tilted = write_parameters(tmp_path / "tilted.json", normal=[lean, 0.0, rise], tangents=axes)
    before = []
    for form in ("physical", "contactnets"):  # only the physical one takes a pivot amid the data
        options = ("--params", tilted, *SHORT, "--steps", "1", "--set", f"training.form={form}", "--json")
        before.append(cli("train", folder, *options, "--out", tmp_path / f"{form}.safetensors").json["held_out_loss_before"])
    assert before[0] == pytest.approx(before[1], rel=1e-6)
    assert before[0] > 1e-3


def test_a_training_that_diverges_says_where(cli: Cli, folder: Path, tmp_path: Path) -> None:
    done = cli("train", folder, "--out", tmp_path / "a.safetensors", *SHORT, "--set", "training.polytope.learning_rate=1e50")
    assert done.status == 1
    assert "the training failed after 8 gradient steps: no transition was solved up to gradient step 8; " in done.err_lines[-1]
    assert events(tmp_path / "a.jsonl")[-1]["state"] == "failed"


def test_a_bad_input_is_a_line_and_the_others_are_trained_on(cli: Cli, folder: Path, tmp_path: Path) -> None:
    bad = tmp_path / "bad.mcap"
    bad.write_bytes(b"no bag")
    done = cli("train", bad, folder, "--out", tmp_path / "a.safetensors", *SHORT, "--json")
    assert done.status == 0
    assert len(done.json["training_tosses"]) == 5
    warning, assumed = done.err_lines
    assert (str(bad) in warning, assumed) == (True, ASSUMES_THE_CUBE)
    alone = cli("train", bad, "--out", tmp_path / "b.safetensors")
    assert (alone.status, len(alone.err_lines)) == (1, 1)
    assert not (tmp_path / "b.safetensors").exists()


def test_metrics_that_cannot_be_written_leave_no_checkpoint_behind(cli: Cli, folder: Path, tmp_path: Path) -> None:
    done = cli("train", folder, "--out", tmp_path / "a.safetensors", *SHORT, "--metrics", tmp_path / "no" / "a.jsonl")
    assert (done.status, len(done.err_lines)) == (1, 1)
    assert "--metrics: found" in done.err
    assert list(tmp_path.iterdir()) == []


def test_a_file_where_the_metrics_go_is_not_overwritten(cli: Cli, folder: Path, tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text("my notes\n")
    done = cli("train", folder, "--out", tmp_path / "a.safetensors", *SHORT)
    assert (done.status, len(done.err_lines)) == (1, 1)
    assert f"--metrics: found a file at {tmp_path / 'a.jsonl'}, expected a new name" in done.err
    assert (tmp_path / "a.jsonl").read_text() == "my notes\n"
    assert cli("train", folder, "--out", tmp_path / "a.safetensors", *SHORT, "--overwrite").status == 0


def test_a_held_out_motion_under_another_heading_is_not_trained_on(cli: Cli, folder: Path, tmp_path: Path) -> None:
    rows = torch.load(folder / "5.pt", weights_only=True)
    half_turn = torch.tensor([-1.0, -1.0, 1.0])  # about the vertical: x and y change their signs
    rows[..., 0:3] *= half_turn
    rows[..., 7:10] *= half_turn
    rows[..., 3:7] = torch.stack([-rows[..., 6], -rows[..., 5], rows[..., 4], rows[..., 3]], dim=-1)
    torch.save(rows, tmp_path / "7.pt")
    inputs = (folder, tmp_path / "7.pt")
    done = cli("train", *inputs, "--out", tmp_path / "a.safetensors", *SHORT, "--json")
    assert done.json["duplicates"] == [["7", "5"]]
    assert done.json["training_tosses"] == ["0", "1", "2", "3", "4"]
    said = cli("train", *inputs, "--out", tmp_path / "b.safetensors", *SHORT)
    assert "left out: 1 toss whose motion is held out under another id, e.g. 7 as 5" in said.out
    kept = cli("train", *inputs, "--out", tmp_path / "c.safetensors", *SHORT, "--keep-duplicates", "--json")
    assert kept.json["training_tosses"] == ["0", "1", "2", "3", "4", "7"]


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (("--criterion", "trace"), "--criterion: found no --top"),
        (("--rerank-when-stale",), "--rerank-when-stale: found no --top"),
        (("--rerank-every", "2"), "--rerank-every: found no --top"),
        (("--held-out", "90-99"), "--held-out: found numbers 90-99, expected some of the 7"),
        (("--held-out", "0-99"), "tosses to learn from: found none of 7: 7 are held out"),
        (("--held-out", "none", "--protocol", "published"), "held-out transitions: found none"),
        (("--params", "nowhere.json"), "nowhere.json: cannot be read"),
        (("--manifest", "nowhere.json"), "nowhere.json: cannot be read"),
        (("--set", "training.batch=0"), "batch: found 0"),
        (("--shape-known-to", "1"), "shape_known_to: found 1.0, expected metres, less than the body's length scale of 0.0524"),
        (("--shape-known-to", "0.001", "--steps", "5"), "shape_known_to: found 0.001, expected none, or the exact protocol"),
        (("--set", "training.shape_known_to=-1"), "shape_known_to: found -1.0, expected a positive number of metres"),
    ],
)
def test_what_cannot_be_done_is_one_line(cli: Cli, folder: Path, tmp_path: Path, options: tuple[str, ...], line: str) -> None:
    done = cli("train", folder, "--out", tmp_path / "a.safetensors", *options)
    assert (done.status, done.out, len(done.err_lines)) == (1, "", 1)
    assert line in done.err


@pytest.mark.parametrize(
    "words",
    [
        (),
        ("a.mcap",),
        ("a.mcap", "--out", "a.pt"),
        ("a.mcap", "--out", "a.safetensors", "--model", "sphere"),
        ("a.mcap", "--out", "a.safetensors", "--steps", "0"),
        ("a.mcap", "--out", "a.safetensors", "--top", "3", "--manifest", "m.csv"),
        ("a.mcap", "--out", "a.safetensors", "--resume", "--overwrite"),
        ("a.mcap", "--out", "a.safetensors", "--top", "3", "--rerank-when-stale", "--rerank-every", "2"),
        ("a.mcap", "--out", "a.safetensors", "--metrics", "a.csv"),
    ],
)
def test_bad_usage_is_said_by_the_parser(cli: Cli, words: tuple[str, ...]) -> None:
    assert cli("train", *words).status == 2


def test_it_explains_itself_without_waiting_for_torch() -> None:
    code = "import sys\nfrom contact_curation.cli.main import main\ntry: main(['train', '--help'])\nexcept SystemExit: pass\n"
    code += "print('torch' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "usage: contact-curation train" in done.stdout
    assert "--held-out SPEC" in done.stdout
    assert done.stdout.splitlines()[-1] == "False"
