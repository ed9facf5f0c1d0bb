"""Bounds follow from the body and its tracker: a 20 mm die, a 400 mm plate, a prism and a brick, at 60 to 1000 Hz."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from benchmarks.data.gate_false_alarms import ingested, noisy
from benchmarks.data.thrown_bodies import FINE_PERIOD, ThrownBody, prism, release, thrown, uniform
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.geometry import quaternions
from contact_curation.geometry.polytopes import box
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.gate_config import GateConfig
from contact_curation.motion.gates import inspect
from contact_curation.motion.pose_noise import LOUD, RIG, RIG_NOISE, TrackerScale
from contact_curation.motion.scales import scale_of, size_of
from contact_curation.motion.segmenter_config import SegmenterConfig
from contact_curation.motion.smoothing import kinematics
from contact_curation.motion.toss import Toss

TRIANGLE = [(0.0, 0.0), (0.10, 0.0), (0.0, 0.06)]
BODIES = {
    "prism": uniform("prism", [prism(TRIANGLE, 0.08)], 900.0, 0.3),
    "brick": uniform("brick", [box([0.06, 0.03, 0.02]).vertices], 900.0, 0.3),
    "die": uniform("die", [box([0.01, 0.01, 0.01]).vertices], 1200.0, 0.2),
    "plate": uniform("plate", [box([0.2, 0.15, 0.008]).vertices], 600.0, 0.35),
}


@cache
def motions(name: str) -> tuple[Array, ...]:
    """Five throws (T, 7)."""
    thrower: ThrownBody = BODIES[name]
    rng = np.random.default_rng(3)
    seen = [thrown(thrower, release(thrower.body, rng)) for _ in range(5)]
    return tuple(poses for poses in seen if poses is not None)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["prism", "brick", "die", "plate"])
@pytest.mark.parametrize(("rate", "noise"), [(60, 0.0), (250, 0.0), (60, 2.0), (250, 2.0), (1000, 1.0)])
def test_a_body_that_is_described_exactly_loses_no_toss(name: str, rate: int, noise: float) -> None:
    rng, rules = np.random.default_rng(0), SegmenterConfig(tracker_noise=max(noise, 1.0))
    for poses in motions(name):
        seen = noisy(poses[:: round(1.0 / (rate * FINE_PERIOD))], noise, rng)
        assert [type(one) for one in ingested(BODIES[name].body, rate, seen, rules)] == [Toss]


@cache
def toss(name: str) -> Toss:
    body, poses = BODIES[name].body, motions(name)[0][::12]
    (found,) = ingested(body, 250, poses, SegmenterConfig())
    assert isinstance(found, Toss)
    return found


@pytest.mark.parametrize("name", ["die", "plate"])
@pytest.mark.parametrize("share", [0.9, 1.2, -0.9, -1.2])
def test_a_rest_beside_the_board_is_seen_by_the_size_of_the_body(name: str, share: float) -> None:
    body = BODIES[name].body
    lift = np.array([0.0, 0.0, share * 0.003 / 0.0524 * size_of(body.vertices)])
    reasons = inspect(replace(toss(name), positions=toss(name).positions + lift), body, GateConfig())
    assert any(line.startswith("height at rest") for line in reasons) is (abs(share) > 1.0), reasons


@pytest.mark.parametrize("name", ["die", "plate"])
@pytest.mark.parametrize("share", [0.9, 1.2])
def test_a_turn_of_one_frame_is_seen_by_the_levers_of_the_body(name: str, share: float) -> None:
    body, at = BODIES[name].body, 20  # in the air
    scale = scale_of(body)
    bound = GateConfig().bounds(scale, RIG).jump_spins[2] * 250.0 / 150.0
    orientations = toss(name).orientations_wxyz.copy()
    orientations[at] = quaternions.multiply(orientations[at], quaternions.exp(share * bound / 250.0 * scale.axes[:, 2]))
    reasons = inspect(replace(toss(name), orientations_wxyz=orientations), body, GateConfig())
    assert any(line.startswith("turn beside") for line in reasons) is (share > 1.0), reasons


def test_for_the_cube_at_its_rig_the_bounds_are_the_published_ones() -> None:
    cube = scale_of(CONTACTNETS_CUBE)
    gates, rules = GateConfig().bounds(cube, RIG), SegmenterConfig().bounds(cube, RIG)
    assert (cube.size, cube.reach) == pytest.approx((0.0524, 0.0524 * np.sqrt(3.0)))
    found = (gates.impulse_tolerance, gates.airborne_clearance, gates.airborne_acceleration, gates.depth, gates.rest_height)
    assert found == pytest.approx((3.0 * 0.0524, 0.010, 0.6 * 9.81, 0.15 * 0.0524, 0.003))
    assert (*gates.jump_spins, gates.twist_tolerance, gates.rest_tilt) == pytest.approx(
        (25.0, 25.0, 25.0, 2.0, np.radians(1.4))
    )
    assert (rules.fall_tolerance, rules.fall_mean_tolerance, rules.airborne_acceleration) == pytest.approx((3.0, 1.0, 4.905))
    assert (rules.release_clearance, rules.flat_tolerance, rules.lowest_corner) == pytest.approx((0.010, 0.005, 0.007))
    assert (rules.shortest, rules.settle_time, rules.rest_displacement) == pytest.approx((0.3, 0.3, 0.3e-3))


def test_a_prism_of_many_sides_lies_flat_only_far_from_its_edges() -> None:
    """Rolling over an edge from balance, the next vertices come down from 5.4 mm."""
    angles = np.arange(12) * np.pi / 6
    vertices = np.array([(0.04 * np.cos(angle), 0.04 * np.sin(angle), z) for angle in angles for z in (-0.06, 0.06)])
    prism = scale_of(replace(CONTACTNETS_CUBE, name="prism", vertices=vertices))
    assert SegmenterConfig().bounds(prism, RIG).flat_tolerance == pytest.approx(0.04 * (1.0 - np.cos(np.pi / 6)) / 3.0)


@pytest.mark.parametrize("rate", [120, 150, 250])
def test_noise_of_which_nothing_is_said_rejects_one_falling_frame_in_100_000(rate: int) -> None:
    """From `LOUD` times the noise on a line says what to set."""
    rng, times, frames = np.random.default_rng(0), np.arange(500) / rate, 400 * 500
    fall = np.outer(times, [1.0, -0.5, 0.0]) - np.outer(0.5 * 9.81 * times**2, [0.0, 0.0, 1.0])
    stamps, still = np.rint(1e9 * times).astype(np.int64), np.tile(quaternions.IDENTITY, (500, 1))
    noises = LOUD * RIG_NOISE * rng.standard_normal((400, 500, 3))
    found = np.concatenate([kinematics(stamps, fall + noise, still).accelerations[2:] for noise in noises])
    sizes = np.linalg.norm(found + np.array([0.0, 0.0, 9.81]), axis=1)
    bound = SegmenterConfig().bounds(scale_of(CONTACTNETS_CUBE), RIG).airborne_bound(1.0 / rate)
    assert np.sum(sizes > bound) <= 3e-5 * frames
    assert np.sum(sizes > 0.6 * bound) >= 1e-4 * frames  # nor is it too wide


def test_a_bound_of_a_users_own_on_accelerations_grows_with_noise_alone() -> None:
    rules = SegmenterConfig(airborne_acceleration=2.0).bounds(scale_of(CONTACTNETS_CUBE), TrackerScale(3.0, 3.0))
    assert rules.airborne_bound(1.0 / 150.0) == pytest.approx(6.0)
    assert SegmenterConfig().bounds(scale_of(CONTACTNETS_CUBE), RIG).airborne_bound(1.0 / 60.0) == pytest.approx(4.905)


def test_what_a_user_sets_stays_for_any_body_and_tracker() -> None:
    plate, noisy_tracker = scale_of(BODIES["plate"].body), TrackerScale(8.0, 8.0)
    gates = GateConfig(depth=0.001, impulse_tolerance=0.05, jump_spin=5.0).bounds(plate, noisy_tracker)
    assert (gates.depth, gates.impulse_tolerance, gates.least_impulse, gates.jump_spins.tolist()) == (
        0.001,
        0.05,
        0.0,
        [5.0] * 3,
    )
    rules = SegmenterConfig(rest_displacement=1e-4, shortest=0.1).bounds(plate, noisy_tracker)
    assert (rules.rest_displacement, rules.shortest) == (1e-4, 0.1)
