"""`score`: the .npz holds what the loss says of every transition, in the order and under the names of the outside contract."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.data.check_faults import raised, simulated_session, write
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.evaluation import LOSS_TERMS, Cone, SolveStatus, evaluate
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form
from contact_curation.motion.gate_config import GateConfig
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import transitions_of
from contact_curation.storage.checkpoint_file import save_model
from contact_curation.storage.datasets.contactnets import read_contactnets
from contact_curation.storage.inputs.inputs import InputsConfig, open_inputs
from test.cli.commands import Cli, write_parameters


def arrays(path: Path) -> Mapping[str, Any]:
    with np.load(path, allow_pickle=False) as file:
        return dict(file)


def tosses_of(bag: Path) -> list[Toss]:
    """Those that the segmenter cuts, before any gate."""
    ungated = InputsConfig(gates=GateConfig(enabled=False))
    return [item for item in open_inputs([bag], CONTACTNETS_CUBE, ungated) if isinstance(item, Toss)]


@pytest.mark.parametrize("cone", ["circular", "polyhedral"])
def test_every_transition_of_every_toss_is_there_without_a_gate(
    cli: Cli, golden: Path, true_parameters: Path, tmp_path: Path, cone: str
) -> None:
    done = cli("score", golden, "--params", true_parameters, "--cone", cone, "--out", tmp_path / "s.npz", "--json")
    read = arrays(tmp_path / "s.npz")
    tosses = tosses_of(golden)
    rows = transitions_of(tosses, CONTACTNETS_CUBE.length_scale)
    config = LossConfig(cone=Cone(cone))
    expected = evaluate(ContactGeometry.of_body(CONTACTNETS_CUBE), CONTACTNETS_CUBE, rows.before, rows.after, rows.dt, config)
    count = len(rows.before)
    assert done.json["transitions"] == count > 2000
    assert done.json["tosses"] == len(tosses) == 22  # 2 of 24 are no motions to rest; a gate would reject one more
    assert done.json["mean_loss"] == pytest.approx(expected.losses.mean())
    assert {name: array.shape for name, array in read.items()} == {
        **dict.fromkeys(("toss_id", "index", "loss", "status", "kkt_residual", *LOSS_TERMS), (count,)),
        "impulse": (count, 8, 3),
        "score": (count, 57),
        "parameter_names": (57,),
        "format_version": (),
    }
    np.testing.assert_array_equal(read["toss_id"], np.array(rows.toss_ids)[rows.toss_index])
    np.testing.assert_array_equal(read["index"], rows.index_in_toss)
    np.testing.assert_allclose(read["loss"], sum(read[name] for name in LOSS_TERMS), rtol=1e-12)
    np.testing.assert_allclose(read["loss"], expected.losses, rtol=1e-9)
    np.testing.assert_allclose(read["impulse"], expected.impulses, atol=1e-9)
    np.testing.assert_allclose(read["score"], expected.scores[:, :57], rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(read["status"], SolveStatus.SOLVED)


def test_parameter_names_are_in_the_order_of_the_contract(
    cli: Cli, golden: Path, true_parameters: Path, tmp_path: Path
) -> None:
    cli("score", golden, "--params", true_parameters, "--out", tmp_path / "s.npz")
    names = arrays(tmp_path / "s.npz")["parameter_names"].tolist()
    assert [name.partition("[")[0] for name in names] == [
        *["vertices_normal"] * 24, *["normal"] * 3, *["vertices_tangent"] * 24, *["tangents"] * 6,
    ]  # fmt: skip
    assert (names[4], names[25], names[56]) == ("vertices_normal[1][1]", "normal[1]", "tangents[1][2]")


def test_a_theta_with_a_restitution_has_the_scores_of_it_and_of_the_height_too(cli: Cli, golden: Path, tmp_path: Path) -> None:
    bouncing = replace(ContactGeometry.of_body(CONTACTNETS_CUBE).rigid(), restitution=0.2)
    save_model(tmp_path / "theta.safetensors", PolytopeModel(bouncing, CONTACTNETS_CUBE, Form.RIGID))
    cli("score", golden, "--params", tmp_path / "theta.safetensors", "--out", tmp_path / "s.npz")
    read, rows = arrays(tmp_path / "s.npz"), transitions_of(tosses_of(golden), CONTACTNETS_CUBE.length_scale)
    expected = evaluate(bouncing, CONTACTNETS_CUBE, rows.before, rows.after, rows.dt)
    assert read["parameter_names"].tolist()[57:] == ["height", "restitution"]
    np.testing.assert_allclose(read["score"], expected.scores, rtol=1e-9, atol=1e-12)


def test_a_score_is_half_the_loss_slope_downwards(cli: Cli, golden: Path, tmp_path: Path) -> None:
    step = 1e-6
    corners = ContactGeometry.of_body(CONTACTNETS_CUBE).vertices_normal
    losses = []
    for sign in (-1.0, 0.0, 1.0):
        moved = corners.copy()
        moved[2, 1] += sign * step
        path = write_parameters(tmp_path / "moved.json", vertices_normal=moved.tolist())
        cli("score", golden, "--params", path, "--out", tmp_path / "s.npz")
        read = arrays(tmp_path / "s.npz")
        losses.append(read["loss"])
        if sign == 0.0:
            column = read["parameter_names"].tolist().index("vertices_normal[2][1]")
            score = read["score"][:, column]
    slope = (losses[2] - losses[0]) / (2.0 * step)
    assert np.abs(score).max() > 0.01
    assert np.abs(score + 0.5 * slope).max() < 1e-4 * np.abs(score).max()


def test_units_are_those_of_the_length_scale_in_the_file(cli: Cli, golden: Path, tmp_path: Path) -> None:
    corners = ContactGeometry.of_body(CONTACTNETS_CUBE).vertices_normal
    metres = {name: (corners * 0.0524).tolist() for name in ("vertices_normal", "vertices_tangent")}
    path = write_parameters(tmp_path / "metres.json", **metres, length_scale=1.0)
    done = cli("score", golden, "--params", path, "--out", tmp_path / "s.npz")
    assert done.status == 0
    read = arrays(tmp_path / "s.npz")
    # The same motion in metres: a gap of the cube at rest is 1.2 mm or so, not 0.02.
    penetrating = read["penetration"].max()
    cli("score", golden, "--params", write_parameters(tmp_path / "t.json"), "--out", tmp_path / "s.npz")
    assert penetrating == pytest.approx(arrays(tmp_path / "s.npz")["penetration"].max() * 0.0524**2, rel=0.5)


def test_what_was_not_solved_is_written_with_its_status_and_counted(
    cli: Cli, golden: Path, true_parameters: Path, tmp_path: Path
) -> None:
    options = ("--params", true_parameters, "--set", "loss.max_iterations=3", "--out", tmp_path / "s.npz")
    done = cli("score", golden, *options, "--json")
    read = arrays(tmp_path / "s.npz")
    missed = int((read["status"] != SolveStatus.SOLVED).sum())
    assert done.status == 0
    assert done.json["not_solved"] == missed > 0
    assert np.isfinite(read["loss"]).all()
    assert (read["kkt_residual"][read["status"] != SolveStatus.SOLVED] > 1e-7).all()
    assert f"not solved: {missed} transitions" in cli("score", golden, *options).out


@pytest.mark.slow
def test_real_tosses_have_the_loss_and_the_ids_of_the_public_data(
    cli: Cli, contactnets_folder: Path, true_parameters: Path, tmp_path: Path
) -> None:
    done = cli(
        "score", contactnets_folder, "--params", true_parameters, "--cone", "polyhedral", "--out", tmp_path / "s.npz", "--json"
    )
    read = arrays(tmp_path / "s.npz")
    assert (done.json["tosses"], done.json["transitions"], done.json["not_solved"]) == (570, 59_383, 0)
    first = next(iter(read_contactnets(contactnets_folder / "7.pt")))
    assert isinstance(first, Toss)
    assert (read["toss_id"] == "7").sum() == first.frames - 1
    means = [read["loss"][read["toss_id"] == name].mean() for name in dict.fromkeys(read["toss_id"].tolist())]
    assert np.mean(means) == pytest.approx(0.0191, abs=0.0003)  # method.md 1.13


@pytest.mark.slow
def test_where_nothing_can_be_scored_it_says_what_check_says(cli: Cli, true_parameters: Path, tmp_path: Path) -> None:
    bag = tmp_path / "low.mcap"
    write(bag, raised(-0.06)(simulated_session(tosses=9), np.random.default_rng(0)))
    words = ("score", bag, "--params", true_parameters, "--out", tmp_path / "s.npz", "--json")
    done = cli(*words)
    assert (done.status, done.out) == (1, "")
    assert cli("check", bag, "--json").json["verdict"] in done.err
    assert not (tmp_path / "s.npz").exists()
