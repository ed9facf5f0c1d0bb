"""Throws in the simulated world: they leave as commanded, come to rest, and pass the gates of real tosses."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.design.execution_noise import ExecutionNoise, errors_of
from contact_curation.design.throw import Throw, throw_of_state
from contact_curation.errors import InvalidValueError
from contact_curation.motion.gate_config import GateConfig
from contact_curation.motion.pose_noise import RIG
from contact_curation.motion.scales import scale_of
from contact_curation.simulation.thrown_toss import DEFAULT_THROWN, ThrownTossConfig, executed_throw, thrown_toss
from contact_curation.simulation.world import WorldConfig
from test.simulated import release_states

CUBE = CONTACTNETS_CUBE
THROWS = [
    throw_of_state(f"throw-{number}", "cube", state)
    for number, state in enumerate(release_states(12, np.random.default_rng(0)))
]


def test_a_toss_begins_with_the_throw_and_ends_flat_and_still() -> None:
    for throw in THROWS:
        toss = thrown_toss(CUBE, throw, first_stamp_ns=5)
        np.testing.assert_array_equal(toss.positions[0], throw.position)
        np.testing.assert_array_equal(toss.linear_velocities[0], throw.linear_velocity)
        assert toss.stamps_ns[0] == 5
        corners = np.sort(CUBE.polytope.corner_heights(toss.positions[-1], toss.orientations_wxyz[-1]))
        assert abs(corners[:4]).max() < 1e-3
        assert np.linalg.norm(np.diff(toss.positions[-DEFAULT_THROWN.rest_frames :], axis=0), axis=1).max() < 3e-4


def test_contacts_are_firm_enough_for_the_gates_of_real_tosses() -> None:
    assert -0.0059 < deepest(CUBE, THROWS) < 0.0  # the deepest of the real tosses


@pytest.mark.parametrize("half_width", [pytest.param(0.002, marks=pytest.mark.slow), 0.006, 0.02, 0.2])
def test_bodies_of_any_size_sink_less_than_the_gates_allow(half_width: float) -> None:
    body = replace(
        CUBE,
        vertices=half_width * np.sign(CUBE.vertices),
        mass=1e6 * half_width**3,
        inertia=1e6 * half_width**5 * 2.0 / 3.0 * np.eye(3),
        length_scale=half_width,
    )
    states = np.array([throw.release for throw in THROWS[:6]])
    states[:, 2] += np.sqrt(3.0) * max(half_width - 0.0524, 0.0)
    throws = [throw_of_state(f"throw-{number}", "cube", state) for number, state in enumerate(states)]
    config = replace(DEFAULT_THROWN, world=WorldConfig.of_body(body))
    assert -deepest(body, throws, config) < 0.5 * GateConfig().bounds(scale_of(body), RIG).depth


def deepest(body: Body, throws: Sequence[Throw], config: ThrownTossConfig = DEFAULT_THROWN) -> float:
    """Height of the lowest vertex in any frame of some throws [m]."""
    tosses = (thrown_toss(body, throw, config) for throw in throws)
    return min(float(body.polytope.corner_heights(toss.positions, toss.orientations_wxyz).min()) for toss in tosses)


def test_the_same_throw_gives_the_same_toss_and_noise_repeats_by_its_seed() -> None:
    assert thrown_toss(CUBE, THROWS[0]).digest() == thrown_toss(CUBE, THROWS[0]).digest()
    noise = ExecutionNoise.expected()
    one, other, third = (executed_throw(THROWS[0], noise, np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert one.to_mapping() == other.to_mapping() != third.to_mapping()
    error = errors_of(THROWS[0].release[None], one.release[None])[0]
    assert 0.0 < np.abs(error[:3]).max() < 0.025
    assert one.throw_id == THROWS[0].throw_id


def test_what_does_not_come_to_rest_in_time_and_other_bodies_are_refused() -> None:
    with pytest.raises(InvalidValueError, match=r"motion of throw throw-0: found no rest within 0\.3 s"):
        thrown_toss(CUBE, THROWS[0], replace(DEFAULT_THROWN, longest=0.3))
    with pytest.raises(InvalidValueError, match="body of throw throw-0: found cube, expected brick"):
        thrown_toss(replace(CUBE, name="brick"), THROWS[0])
