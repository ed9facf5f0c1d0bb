"""Fitters recover a body from throws without noise in their own engine, and a failure of one is a row."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contact_curation.contact.body import Body
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.rollout import rollout
from contact_curation.design.throw import throw_of_state
from contact_curation.errors import InvalidValueError
from contact_curation.experiments import bodies
from contact_curation.experiments.against_sysid import run
from contact_curation.experiments.against_sysid.fitters import FITTERS, RULES, Learned, Task
from contact_curation.experiments.against_sysid.run import Against, against_row
from contact_curation.experiments.cell_run import Bench
from contact_curation.geometry.polytopes import box
from contact_curation.learning.evaluation.evaluation import shape_errors
from contact_curation.motion.gate_config import GateConfig
from contact_curation.motion.toss import NANOSECONDS, Toss, toss_identity
from contact_curation.simulation.thrown_toss import ThrownTossConfig, thrown_toss
from contact_curation.simulation.world import WorldConfig
from test.cli.commands import Cli

HALF = np.array([0.06, 0.045, 0.03])
PERIOD = 1.0 / 148.0


def body_of(half: np.ndarray, friction: float) -> Body:
    inertia = 0.4 / 3.0 * np.diag([HALF[1] ** 2 + HALF[2] ** 2, HALF[0] ** 2 + HALF[2] ** 2, HALF[0] ** 2 + HALF[1] ** 2])
    return Body("box", box(half).vertices, 0.4, inertia, friction, 0.05)


TRUTH = body_of(HALF, 0.25)
DESCRIBED = body_of(HALF * np.array([1.08, 0.94, 1.05]), 0.4)
"""Where the fitters begin."""


def releases(count: int) -> list[np.ndarray]:
    rng = np.random.default_rng(3)
    return [bodies._release(TRUTH, rng) for _ in range(count)]


def task_of(tosses: list[Toss]) -> Task:
    return Task(Bench(DESCRIBED, tuple(tosses), tuple(tosses[:1]), GateConfig()), tuple(tosses), 0, bounces=False)


def by_mujoco(count: int) -> list[Toss]:
    config = ThrownTossConfig(world=WorldConfig(contact_time=0.009))
    return [thrown_toss(TRUTH, throw_of_state(f"t{k}", "box", release), config) for k, release in enumerate(releases(count))]


def by_our_rollouts(count: int) -> list[Toss]:
    scale, tosses = TRUTH.length_scale, list[Toss]()
    units = np.array([scale] * 3 + [1.0] * 4 + [scale] * 3 + [1.0] * 3)
    begun = np.stack(releases(count)) / units
    states = rollout(ContactGeometry.of_body(TRUTH).rigid(), TRUTH, begun, 100, PERIOD).states.reshape(count, 100, 13) * units
    stamps = np.rint(np.arange(100) * PERIOD * NANOSECONDS).astype(np.int64)
    for k, each in enumerate(states):
        columns = each[:, :3], each[:, 3:7], each[:, 7:10], each[:, 10:]
        tosses.append(Toss(toss_identity("box", f"t{k}", 0), "box", f"t{k}", PERIOD, stamps, *columns))
    return tosses


@pytest.mark.slow
def test_least_squares_of_sysid_recover_a_box_and_its_contacts() -> None:
    found = FITTERS["sysid"](task_of(by_mujoco(3)), False)
    assert found.contact is not None
    np.testing.assert_allclose(0.05 * np.abs(found.model.geometry().vertices_normal).max(axis=0), HALF, rtol=0.01)
    assert np.linalg.norm(found.model.geometry().tangents[0]) == pytest.approx(0.25, rel=0.02)
    assert found.contact[0] == pytest.approx(0.009, rel=0.05)
    said = found.said()
    assert 0.0 < float(said["shape_half_width"]) < 1.0


@pytest.mark.slow
def test_an_evolution_strategy_recovers_it_too() -> None:
    found = FITTERS["cmaes"](task_of(by_mujoco(2)), False)
    np.testing.assert_allclose(0.05 * np.abs(found.model.geometry().vertices_normal).max(axis=0), HALF, rtol=0.03)
    assert np.linalg.norm(found.model.geometry().tangents[0]) == pytest.approx(0.25, rel=0.06)
    assert found.said() == {}


def test_ours_recovers_it_from_our_motions() -> None:
    found = FITTERS["ours"](task_of(by_our_rollouts(8)), False)
    shape = shape_errors(found.model)
    assert shape is not None
    off = 0.05 * found.model.geometry().vertices_normal - TRUTH.vertices
    assert 1e3 * float(np.sqrt(np.square(off).sum(axis=1).mean())) < 1.2
    assert shape.friction == pytest.approx(0.25, rel=0.03)
    assert {"shape_held", "friction_held"} < found.said().keys()


def test_what_is_no_box_is_said() -> None:
    bench = task_of(by_mujoco(1)).bench
    odd = replace(DESCRIBED, vertices=DESCRIBED.vertices + np.array([0.0, 0.0, 0.01]))
    with pytest.raises(InvalidValueError, match=r"shape of box: found 8 vertices, expected the 8 corners of a box"):
        FITTERS["sysid"](Task(replace(bench, body=odd), bench.training, 0, bounces=False), False)


@pytest.mark.slow
def test_a_fitter_that_fails_is_a_row_and_the_others_go_on(cli: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(task: Task, cold: bool) -> Learned:
        raise np.linalg.LinAlgError("no inverse")

    monkeypatch.setattr(bodies, "SIMULATED", 9)
    monkeypatch.setitem(FITTERS, "sysid", broken)
    words = ("reproduce", "against-sysid", "--bodies", "slab", "--quick", "--rules", "ours", "ours-cold", "sysid", "cmaes")
    report = cli(*words, "--json", "--out", tmp_path).json
    assert (report["cells"], report["failed"]) == (4, 0)
    rows = {line.split(",")[1]: line for line in (tmp_path / "rows.csv").read_text().splitlines()[1:]}
    assert "no inverse" in rows["sysid"]
    assert (tmp_path / "differences.csv").read_text().count("cmaes") > 0
    assert cli(*words, "--json", "--out", tmp_path).json["run"] == 0
    failed = cli(*words[:5], "--rules", "sysid", "--out", tmp_path / "failed")
    assert failed.status == 1
    assert "fits: found all 1 failed, expected at least one that did not (no inverse)" in failed.err


@pytest.mark.slow
@pytest.mark.parametrize("rule", RULES)
def test_every_fitter_learns_from_two_tosses(rule: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bodies, "SIMULATED", 9)
    run._bench.cache_clear()
    row = against_row(Against("slab", rule, 2, 0))
    assert row["failed"] == ""
    assert np.isfinite([float(value) for value in str(row["mujoco_position"]).split()]).all()
    assert float(row["fit_seconds"]) > 0.0
    assert float(row["memory"]) >= 0.0  # a later fit may need no more than an earlier one had
