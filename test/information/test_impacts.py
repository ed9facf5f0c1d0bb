"""Impacts between frames, as one transition."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.geometry.quaternions import Array
from contact_curation.information.impacts import as_described, merged_impacts
from contact_curation.learning.fits.refits import subset
from contact_curation.motion.transitions import Transitions, transitions_of
from test.simulated import RIG_NOISE, TrackerNoise, simulated_tosses

DT = 1.0 / 148.0
GRAVITY = CONTACTNETS_CUBE.scaled_gravity
E = 0.4


def fall(frames: int, landing: float, dt: float = DT) -> Array:
    """(T,) heights of a point that meets z = 0 `landing` frame periods after the first frame, at 30 lengths/s, and bounces."""
    times = dt * (np.arange(frames) - landing)
    up = E * 30.0 * times - 0.5 * GRAVITY * times**2
    return np.where(times < 0.0, -30.0 * times - 0.5 * GRAVITY * times**2, up)


def transitions(*heights: Array, dt: float = DT) -> Transitions:
    """Of motions along z; velocities are those of the frame period before, as a tracker measures them."""
    tosses = []
    for height in heights:
        states = np.zeros((len(height) - 1, 13))
        states[:, 2], states[:, 3], states[:, 9] = height[1:], 1.0, np.diff(height) / dt
        tosses.append(states)
    counts = [len(states) - 1 for states in tosses]
    before, after = (np.concatenate([states[part] for states in tosses]) for part in (slice(-1), slice(1, None)))
    starts = np.concatenate([[0], np.cumsum(counts)])
    return Transitions(tuple(str(k) for k in range(len(heights))), before, after, np.full(len(before), dt), starts)


@pytest.mark.parametrize("landing", [10.3, 10.5, 10.8])
def test_one_transition_leads_from_before_an_impact_to_after_it(landing: float) -> None:
    data = transitions(fall(20, landing), fall(20, landing + 2.0))
    merged = merged_impacts(data, CONTACTNETS_CUBE)
    assert merged.toss_ids == data.toss_ids
    assert len(merged.dt) == len(data.dt) - 2
    assert merged.starts.tolist() == [0, 17, 34]
    long = merged.dt > 1.5 * DT
    assert merged.dt[long] == pytest.approx(2 * DT)
    assert -merged.after[long, 9] / merged.before[long, 9] == pytest.approx(E, abs=0.05)
    assert not np.isclose(-data.after[:, 9] / data.before[:, 9], E, atol=0.05).any()
    for one in (merged, data):
        assert one.dt.sum() == pytest.approx(36 * DT)
        assert np.array_equal(one.before[1:17], one.after[:16])


def test_an_impact_at_a_frame_needs_no_merging() -> None:
    data = transitions(fall(20, 10.0))
    assert len(merged_impacts(data, CONTACTNETS_CUBE).dt) == len(data.dt)


def test_noise_is_no_impact_and_lost_frames_change_nothing_else() -> None:
    rng = np.random.default_rng(0)
    heights = fall(200, 500.0) + 0.03 * rng.standard_normal(200)  # its velocity changes by 11 lengths/s, gravity's bound is 6.3
    data = transitions(heights)
    assert len(merged_impacts(data, CONTACTNETS_CUBE).dt) >= len(data.dt) - 2
    falling = transitions(fall(40, 60.0))
    lost = replace(
        falling,
        before=falling.before[[0, 1, 5, 6]],
        after=falling.before[[1, 5, 6, 7]],
        dt=DT * np.array([1.0, 4.0, 1.0, 1.0]),
        starts=np.array([0, 4]),
    )
    assert np.array_equal(merged_impacts(lost, CONTACTNETS_CUBE).dt, lost.dt)


@pytest.mark.parametrize(
    ("heights", "fewer"),
    [([0.0, 0.5, 0.0], 2), ([0.0, 0.5, 0.0, 0.5], 0), ([0.0, 0.5, 0.0, 0.5, 0.0], 0), ([0.0, 0.5] * 4, 0)],
    ids=["three", "four", "five", "eight"],
)
def test_only_up_to_three_changes_in_a_row_are_one_impact(heights: list[float], fewer: int) -> None:
    data = transitions(np.pad(heights, 6, mode="edge"))
    assert len(merged_impacts(data, CONTACTNETS_CUBE).dt) == len(data.dt) - fewer


@pytest.mark.parametrize(("jump", "fewer"), [(3.9, 0), (4.1, 1)])
def test_an_impact_changes_the_velocity_by_five_times_what_gravity_does_beside_gravitys_own_change(
    jump: float, fewer: int
) -> None:
    velocities = np.concatenate([np.zeros(8), [jump, 2.0 * jump], np.full(8, 2.0 * jump)])
    data = transitions(GRAVITY * DT**2 * np.cumsum(velocities))
    assert len(merged_impacts(data, CONTACTNETS_CUBE).dt) == len(data.dt) - fewer


@pytest.mark.parametrize(
    ("friction", "rate", "plain"), [(0.3, 148.0, False), (0.31, 148.0, True), (0.6, 60.0, True), (0.6, 250.0, False)]
)
def test_of_much_friction_velocities_lead_from_pose_to_pose(friction: float, rate: float, plain: bool) -> None:
    body = replace(CONTACTNETS_CUBE, friction=friction)
    data = transitions_of(simulated_tosses(2, 0, RIG_NOISE), body.length_scale)
    data = replace(data, dt=np.full(len(data.dt), 1.0 / rate))
    rigid = ContactGeometry.of_body(body).rigid()
    described = as_described(data, rigid, body)
    assert (described is not data) == plain
    moved = described.before[:, :3] + data.dt[:, np.newaxis] * described.after[:, 7:10]
    assert np.allclose(moved, data.after[:, :3], rtol=0.0, atol=1e-12) == plain
    np.testing.assert_array_equal(described.after[:, :7], data.after[:, :7])
    assert as_described(data, ContactGeometry.of_body(body), body) is data
    merged = as_described(data, replace(rigid, restitution=0.3), body)
    np.testing.assert_array_equal(merged.after[-1], described.after[-1])


def test_what_a_toss_is_described_by_does_not_depend_on_other_tosses() -> None:
    body = replace(CONTACTNETS_CUBE, friction=0.6)
    rigid = ContactGeometry.of_body(body).rigid()
    data = transitions_of(simulated_tosses(3, 0, RIG_NOISE), body.length_scale)
    rates = np.array([148.0, 225.0, 225.0])
    data = replace(data, dt=1.0 / rates[data.toss_index])
    together = as_described(data, rigid, body)
    for toss in range(3):
        alone = as_described(subset(data, np.array([toss]))[0], rigid, body)
        rows = slice(*data.starts[toss : toss + 2])
        np.testing.assert_array_equal(together.before[rows], alone.before)
        np.testing.assert_array_equal(together.after[rows], alone.after)
    slow = data.toss_index == 0
    assert (together.after[slow, 7:10] != data.after[slow, 7:10]).any()
    np.testing.assert_array_equal(together.after[~slow], data.after[~slow])


@pytest.mark.parametrize(("noise", "span"), [(1.0, 1), (4.0, 2), (20.0, 3)])
def test_transitions_lead_over_several_frames_where_the_tracker_is_noisy(noise: float, span: int) -> None:
    quiet = simulated_tosses(1, 0, RIG_NOISE)
    noisy = simulated_tosses(1, 1, TrackerNoise(noise * RIG_NOISE.position, noise * RIG_NOISE.orientation))
    data = transitions_of((*quiet, *noisy), CONTACTNETS_CUBE.length_scale)
    rigid = ContactGeometry.of_body(CONTACTNETS_CUBE).rigid()
    described = as_described(data, rigid, CONTACTNETS_CUBE)
    assert described.toss_ids == data.toss_ids
    assert np.diff(described.starts).tolist() == [int(data.starts[1]), *(np.diff(data.starts)[1:] // span)]
    for toss in range(2):
        rows, own = (slice(*starts[toss : toss + 2]) for starts in (described.starts, data.starts))
        each = span if toss else 1
        many = np.diff(described.starts)[toss] * each
        np.testing.assert_array_equal(described.before[rows, :7], data.before[own][:many:each, :7])
        np.testing.assert_array_equal(described.after[rows, :7], data.after[own][each - 1 : many : each, :7])
        np.testing.assert_allclose(described.dt[rows], each / 148.0, rtol=1e-9)
        alone = as_described(subset(data, np.array([toss]))[0], rigid, CONTACTNETS_CUBE)
        np.testing.assert_array_equal(described.after[rows], alone.after)
        np.testing.assert_array_equal(described.dt[rows], alone.dt)
    if span > 1:
        moved = described.before[:, :3] + described.dt[:, np.newaxis] * described.after[:, 7:10]
        later = described.toss_index > 0
        np.testing.assert_allclose(moved[later], described.after[later, :3], atol=1e-12)
    assert as_described(data, ContactGeometry.of_body(CONTACTNETS_CUBE), CONTACTNETS_CUBE) is data


def test_only_a_theta_with_a_restitution_describes_impacts() -> None:
    data, plain = transitions(fall(20, 10.3)), ContactGeometry.of_body(CONTACTNETS_CUBE)
    assert as_described(data, None, CONTACTNETS_CUBE) is data
    assert as_described(data, plain, CONTACTNETS_CUBE) is data
    assert as_described(data, plain.rigid(), CONTACTNETS_CUBE) is data
    bouncing = replace(plain.rigid(), restitution=0.3)
    assert len(as_described(data, bouncing, CONTACTNETS_CUBE).dt) == len(data.dt) - 1
