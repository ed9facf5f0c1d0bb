"""Each limit from both sides, and how many executions may break one."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from contact_curation.design.execution_noise import ExecutionNoise, NoiseConfig
from contact_curation.design.predicted_information import PredictionConfig
from contact_curation.design.safety import DEFAULT_SAFETY, SafetyConfig, SafetySet
from contact_curation.design.throw import Throw, throw_of_state
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from test.design.cases import CUBE, PARTICLE, QUIET

LEVEL = np.array([-0.3, 0.0, 0.15, 1.0, 0.0, 0.0, 0.0, 1.1, 0.0, 0.0, 0.0, 2.0, 0.0])
"""A safe release: the cube level, its lowest corners 97.6 mm over the board."""

FEW = replace(DEFAULT_SAFETY, executions=20, motions=20)


def with_value(index: int, value: float) -> Array:
    state = LEVEL.copy()
    state[index] = value
    return state


def refusal(state: Array, config: SafetyConfig = FEW) -> str | None:
    return SafetySet(CUBE, config, QUIET).refusals(state[None])[0]


def motion_refusal(state: Array, config: SafetyConfig = FEW) -> str | None:
    return SafetySet(CUBE, config, QUIET).motion_refusals(PARTICLE, state[None])[0]


SPEED, UP, SPIN, HEIGHT = 7, 9, 11, 2
LOOSE = replace(FEW, largest_speed=9.0, largest_spin=99.0, largest_energy=9.0, highest_apex=9.0, highest_release=9.0)


@pytest.mark.parametrize(
    ("name", "config", "index", "inside", "outside"),
    [
        ("speed", replace(LOOSE, largest_speed=1.4), SPEED, 1.399, 1.401),
        ("spin", replace(LOOSE, largest_spin=11.0), SPIN, 10.99, 11.01),
        ("release height", replace(LOOSE, highest_release=0.24), HEIGHT, 0.2399, 0.2401),
        ("release height", LOOSE, HEIGHT, 0.0901, 0.0899),
        ("energy", replace(LOOSE, largest_energy=0.41), SPEED, np.sqrt(2 * (0.409 - 0.00162) / 0.37), np.sqrt(2 * 0.41 / 0.37)),
        ("apex", replace(LOOSE, highest_apex=0.2), UP, np.sqrt(2 * 9.81 * 0.0499), np.sqrt(2 * 9.81 * 0.0501)),
        ("clearance", replace(LOOSE, lowest_release=0.01), HEIGHT, 0.0625, 0.0623),
    ],
)
def test_limits_of_the_release_hold_from_both_sides(
    name: str, config: SafetyConfig, index: int, inside: float, outside: float
) -> None:
    assert refusal(with_value(index, inside), config) is None
    found = refusal(with_value(index, outside), config)
    assert found is not None
    assert found.startswith(f"{name}: found ")
    assert "in 100.0% of executions, expected at " in found


def resting_place(state: Array) -> float:
    """How far from the middle of the board it rests, from what a limit of 1 mm says."""
    found = motion_refusal(state, replace(FEW, board_half_width=0.001))
    assert found is not None
    return float(found.split()[2])


def test_a_throw_rests_on_the_board_or_is_refused() -> None:
    place = resting_place(LEVEL)
    assert motion_refusal(LEVEL, replace(FEW, board_half_width=place + 0.001)) is None
    found = motion_refusal(LEVEL, replace(FEW, board_half_width=place - 0.001))
    assert found is not None
    assert found.startswith("rest: found ")


def test_a_throw_flies_long_enough_to_be_seen_or_is_refused() -> None:
    fall = float(np.sqrt(2 * (0.15 - 0.0524) / 9.81))
    still = with_value(SPIN, 0.0)
    assert motion_refusal(still, replace(FEW, shortest_flight=fall - 0.008)) is None
    found = motion_refusal(still, replace(FEW, shortest_flight=fall + 0.008))
    assert found is not None
    assert found.startswith("flight: found ")


def test_a_body_stays_away_from_the_thrower_or_the_throw_is_refused() -> None:
    place = resting_place(LEVEL)
    beyond = (place + 0.2, 0.0)
    assert motion_refusal(LEVEL, replace(FEW, keep_out_place=beyond, keep_out_radius=0.19)) is None
    found = motion_refusal(LEVEL, replace(FEW, keep_out_place=beyond, keep_out_radius=0.21))
    assert found is not None
    assert found.startswith("distance to the thrower: found ")


def test_a_throw_may_begin_beside_the_thrower() -> None:
    beside = (float(LEVEL[0]), 0.0)
    assert motion_refusal(LEVEL, replace(FEW, keep_out_place=beside, keep_out_radius=0.1)) is None


def test_a_body_that_does_not_come_to_rest_is_refused() -> None:
    fast = with_value(SPEED, 9.0)
    found = motion_refusal(fast, replace(FEW, board_half_width=99.0))
    assert found is not None
    assert found.startswith("rest: found none within 0.9 s (--set forecast.longest=SECONDS) in ")


def test_a_motion_that_ends_later_than_is_predicted_names_the_setting_with_which_it_is_seen() -> None:
    moon = replace(CUBE, gravity=1.62)
    particle, safety = replace(PARTICLE, body=moon), SafetySet(moon, replace(FEW, board_half_width=99.0), QUIET)
    (found,) = safety.motion_refusals(particle, LEVEL[None])
    assert found is not None
    assert "(--set forecast.longest=SECONDS)" in found
    assert safety.motion_refusals(particle, LEVEL[None], PredictionConfig(longest=5.0)) == (None,)


@pytest.mark.parametrize(("deviations", "refused"), [(2.0, True), (3.0, False)])
def test_one_execution_in_a_hundred_may_break_a_limit(deviations: float, refused: bool) -> None:
    """2 standard deviations under the limit 2.3 % are over it, 3 under it 0.1 %."""
    noise = ExecutionNoise.expected(NoiseConfig(position=0.005, turn=1e-9, speed=0.0, velocity=1e-9, spin=1e-9))
    safety = SafetySet(CUBE, replace(DEFAULT_SAFETY, executions=4000), noise)
    state = with_value(HEIGHT, DEFAULT_SAFETY.highest_release - 0.005 * deviations)
    assert (safety.refusals(state[None])[0] is not None) == refused


def test_releases_are_judged_one_by_one_in_any_number() -> None:
    states = np.stack([LEVEL, with_value(SPEED, 5.0)] * 100)
    refusals = SafetySet(CUBE, FEW, QUIET).refusals(states)
    assert [one is None for one in refusals] == [True, False] * 100


def test_the_thrower_is_asked_and_must_answer_for_each_throw() -> None:
    def feasible(throws: object) -> tuple[str | None, ...]:
        return ("joint 4: found 2.8 rad/s, expected at most 2.62",)

    safety = SafetySet(CUBE, FEW, QUIET, feasible)
    throw = throw_of_state("a", "cube", LEVEL)
    assert safety.thrower_refusals([throw]) == ("joint 4: found 2.8 rad/s, expected at most 2.62",)
    with pytest.raises(InvalidValueError, match="answers of the thrower: found 1, expected 2"):
        safety.thrower_refusals([throw, throw])
    nobody: Callable[[list[Throw]], tuple[str | None, ...]] = SafetySet(CUBE, FEW, QUIET).thrower_refusals
    assert nobody([throw]) == (None,)


@pytest.mark.parametrize(
    ("name", "value"),
    [("largest_speed", 0.0), ("share", 1.0), ("lowest_release", 0.3), ("keep_out_place", (1.0,)), ("motions", 0)],
)
def test_limits_that_make_no_sense_are_refused(name: str, value: object) -> None:
    with pytest.raises(InvalidValueError, match=f"safety.{name}"):
        replace(DEFAULT_SAFETY, **{name: value})  # type: ignore[arg-type]
