"""Throw, look, plan again: what was learned is known, and what was planned is held against it."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.design.designer import AdaptiveDesign, Realised, overall_ratio
from contact_curation.design.execution_noise import ExecutionNoise
from contact_curation.design.greedy_batch import gains
from contact_curation.design.planner import Planner
from contact_curation.design.throw import Throw
from contact_curation.errors import InvalidValueError
from contact_curation.information.record import TossInformation
from contact_curation.simulation.thrown_toss import executed_throw, thrown_toss
from test.design.cases import CUBE, PARTICLE, SMALL, other_theta


@pytest.fixture(scope="module")
def planner() -> Planner:
    return Planner([PARTICLE], config=SMALL)


def information(throw: Throw) -> TossInformation:
    found = PARTICLE.scorer.score([thrown_toss(CUBE, throw)])[0]
    assert isinstance(found, TossInformation)
    return found


def test_a_loop_of_throws_gains_less_and_less_and_about_what_was_planned(planner: Planner) -> None:
    rng = np.random.default_rng(0)
    design = AdaptiveDesign(planner)
    realised: list[Realised] = []
    for number in range(4):
        throw = design.plan([f"throw-{number}"], number).throws[0]
        executed = executed_throw(throw, ExecutionNoise.expected(), rng)
        design.made(throw, executed)
        realised.append(design.add(throw, [information(executed)]))
    assert [one.throw_id for one in realised] == [f"throw-{number}" for number in range(4)]
    planned = [one.planned for one in realised]
    assert planned == sorted(planned, reverse=True)
    assert 0.5 < overall_ratio(realised) < 1.5
    assert design.noise.throws == 4


def test_realised_gains_add_up_to_what_is_known(planner: Planner) -> None:
    design = AdaptiveDesign(planner)
    throws = design.plan(["a", "b"], 0).throws
    infos = [information(throw) for throw in throws]
    total = sum(design.add(throw, [info]).realised for throw, info in zip(throws, infos))
    together = gains(planner.known(), [(infos[0].fisher() + infos[1].fisher())[None]])[0]
    assert total == pytest.approx(together, rel=1e-6)


def test_a_thrower_that_is_always_too_fast_is_noticed(planner: Planner) -> None:
    design = AdaptiveDesign(planner)
    throw = design.plan(["a"], 0).throws[0]
    for _ in range(20):
        design.made(throw, replace(throw, linear_velocity=1.1 * throw.linear_velocity))
    along = design.noise.bias[6]
    units = design.noise.config.units(throw.release[None])[0, 6]
    assert along * units == pytest.approx(0.1 * np.linalg.norm(throw.linear_velocity[:2]), rel=0.25)


def test_information_at_another_theta_is_refused_and_changes_nothing(planner: Planner) -> None:
    design = AdaptiveDesign(planner)
    throw = design.plan(["a"], 0).throws[0]
    elsewhere = other_theta().scorer.score([thrown_toss(CUBE, throw)])[0]
    assert isinstance(elsewhere, TossInformation)
    with pytest.raises(InvalidValueError, match="parameters_version of toss"):
        design.add(throw, [elsewhere])
    assert design.add(throw, [information(throw)]).realised > 0.5 * throw.expected_information


def test_a_ratio_to_nothing_is_no_number() -> None:
    assert np.isnan(Realised("a", "b", 0.0, 1.0).ratio)
    assert np.isnan(overall_ratio([]))
    assert overall_ratio([Realised("a", "b", 2.0, 1.0), Realised("c", "d", 2.0, 2.0)]) == 0.75
