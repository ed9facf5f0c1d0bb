"""Throws of the simulated arm that a learner learns from: chosen by its theta or by chance, judged by tosses nobody threw."""

from dataclasses import replace

import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form
from contact_curation.design.designer import Designer, DesignerConfig
from contact_curation.design.readiness import ReadinessConfig
from contact_curation.errors import InvalidValueError
from contact_curation.experiments.cell_run import Bench, Row
from contact_curation.experiments.thrown.cell import ThrowsCell
from contact_curation.experiments.thrown.choice import DesignedThrows
from contact_curation.experiments.thrown.designed_throws import judged, throws_rows
from contact_curation.information.record import TossInformation
from contact_curation.motion.gate_config import GateConfig
from test.design.cases import LOSS, SMALL, TRUE, other_theta
from test.simulated import simulated_tosses

CONFIG = DesignerConfig(SMALL, ReadinessConfig(enabled=False), LOSS)


@pytest.fixture(scope="module")
def bench() -> Bench:
    return Bench(CONTACTNETS_CUBE, tuple(simulated_tosses(14, seed=8)), (), GateConfig())


@pytest.fixture(scope="module")
def designed(bench: Bench) -> tuple[Row, ...]:
    return throws_rows(ThrowsCell("designed", (1, 3), 0), bench, CONFIG)


@pytest.mark.slow
def test_throws_are_designed_from_the_first_theta_on_and_teach_about_as_planned(designed: tuple[Row, ...]) -> None:
    assert [(row["throws"], row["designed"], row["toss"]) for row in designed] == [
        (1.0, 0.0, 1.0),
        (2.0, 0.0, 1.0),
        (3.0, 1.0, 1.0),
    ]
    assert [row["reason"] for row in designed] == 2 * ["parameters: found none, expected some"] + [""]
    assert ["planned" in row for row in designed] == [False, False, True]
    assert 0.2 < float(designed[2]["realised"]) / float(designed[2]["planned"]) < 3.0


@pytest.mark.slow
def test_held_out_motion_judges_after_the_throws_that_were_named(designed: tuple[Row, ...]) -> None:
    assert ["position" in row for row in designed] == [True, False, True]
    assert float(designed[2]["rotation"]) < float(designed[0]["rotation"])
    assert float(designed[2]["vertices"]) < float(designed[0]["vertices"])


def test_the_body_as_described_is_right_about_itself(bench: Bench) -> None:
    row = judged(PolytopeModel(TRUE, CONTACTNETS_CUBE, Form.PHYSICAL), bench.divided(0))
    assert row["vertices"] == 0.0
    assert row["friction_from_described"] == pytest.approx(0.0, abs=1e-12)
    assert float(row["rotation"]) < 1.0


def test_the_readiness_check_uses_the_loss_of_a_toss_before_any_training_on_it() -> None:
    readiness = ReadinessConfig(least_tosses=1, largest_loss=1e-9)
    begun, better, toss = other_theta(1.5, 0.4).geometry, TRUE, simulated_tosses(1, seed=2)[0]
    designer = Designer(CONTACTNETS_CUBE, DesignerConfig(SMALL, readiness, LOSS))
    chooser = DesignedThrows(designer, begun, seed=0)
    assert chooser.came(toss) is None
    chooser.learned(better, [toss])
    scored = designer.particle(begun).scorer.score([toss])[0]
    assert isinstance(scored, TossInformation)
    assert chooser.choose(2).reason == f"loss: found a median of {scored.mean_loss:.3g}, expected at most 1e-09"


def test_a_theta_is_compared_with_another_one_however_often_it_is_asked_about() -> None:
    readiness = ReadinessConfig(least_tosses=1, largest_loss=1e9, least_agreement=1.0)
    designer = Designer(CONTACTNETS_CUBE, DesignerConfig(SMALL, readiness, LOSS))
    tosses = simulated_tosses(5, seed=2)
    chooser = DesignedThrows(designer, TRUE, seed=0)
    for toss in tosses:
        chooser.came(toss)
    reasons = []
    for geometry, asked in ((TRUE, 1), (other_theta(1.5, 0.4).geometry, 2)):
        chooser.learned(geometry, tosses)
        reasons += [chooser.choose(number).reason for number in range(asked)]
    assert reasons[1] == reasons[2]
    assert "rank correlation" in str(reasons[1])


def test_without_enough_releases_there_is_no_prior(bench: Bench) -> None:
    with pytest.raises(InvalidValueError, match="releases to fit a prior to"):
        throws_rows(ThrowsCell("designed", (1,), 0), replace(bench, training=bench.training[:3]))


@pytest.mark.slow
def test_a_world_that_bounces_is_learned_from_and_judged_there(bench: Bench) -> None:
    cells = [ThrowsCell("random", (8,), 0, world=world, restitution=world != "firm") for world in ("firm", "springy")]
    firm, springy = (throws_rows(cell, bench, CONFIG)[-1] for cell in cells)
    assert {"landed", "world_position"} <= firm.keys() & springy.keys()
    assert firm["seconds"] != springy["seconds"]
    assert float(springy["world_rotation"]) < 40.0
    without = throws_rows(replace(cells[1], restitution=False), bench, CONFIG)[-1]
    assert float(springy["world_position"]) < float(without["world_position"])
