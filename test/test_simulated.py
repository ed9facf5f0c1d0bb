"""The simulated tosses are what they claim: seeded, physical, and like the real ones."""

from pathlib import Path

import numpy as np
import pytest
import torch

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.toss import Toss
from test.simulated import (
    FRAME_PERIOD,
    FRAMES_AT_REST,
    RELEASE_DEVIATION,
    RELEASE_MEAN,
    RIG_NOISE,
    TrackerNoise,
    length_scales,
    release_states,
    simulated_tosses,
    toss_of,
)


def test_the_same_seed_gives_the_same_tosses_and_another_seed_others() -> None:
    first, again, other = (simulated_tosses(3, seed, RIG_NOISE) for seed in (1, 1, 2))
    assert [toss.digest() for toss in first] == [toss.digest() for toss in again]
    assert not {toss.digest() for toss in first} & {toss.digest() for toss in other}


def test_exact_velocities_carry_each_pose_to_the_next() -> None:
    for toss in simulated_tosses(4, seed=3):
        moved = toss.positions[:-1] + FRAME_PERIOD * toss.linear_velocities[1:]
        turned = quaternions.multiply(toss.orientations_wxyz[:-1], quaternions.exp(FRAME_PERIOD * toss.angular_velocities[1:]))
        np.testing.assert_allclose(toss.positions[1:], moved, atol=1e-14)
        np.testing.assert_allclose(toss.orientations_wxyz[1:], turned, atol=1e-14)


def test_a_toss_starts_in_the_air_and_ends_with_frames_at_rest_on_a_face() -> None:
    for toss in simulated_tosses(20, seed=4):
        heights = CONTACTNETS_CUBE.polytope.corner_heights(toss.positions, toss.orientations_wxyz)
        assert heights[0].min() > 0.015
        assert -1e-5 < heights.min() < 1e-5
        assert np.sort(heights[-1])[:4] == pytest.approx(0.0, abs=1e-5)
        resting = np.linalg.norm(toss.linear_velocities, axis=1) < 1e-2
        assert resting[-FRAMES_AT_REST:].all()
        assert not resting[: -FRAMES_AT_REST - 60].all()


def test_a_trackers_velocities_are_near_the_true_ones_away_from_impacts() -> None:
    exact, seen = simulated_tosses(6, seed=5), simulated_tosses(6, seed=5, noise=RIG_NOISE)
    for true, noisy in zip(exact, seen, strict=True):
        assert np.median(np.abs(noisy.linear_velocities - true.linear_velocities)) < 0.01
        assert np.abs(noisy.positions - true.positions).max() < 6.0 * RIG_NOISE.position
        angles = quaternions.angle_between(true.orientations_wxyz, noisy.orientations_wxyz)
        assert angles.max() < 8.0 * RIG_NOISE.orientation
        np.testing.assert_array_equal(true.stamps_ns, noisy.stamps_ns)


def test_without_noise_a_trackers_velocities_are_the_true_ones_through_a_median_of_three() -> None:
    states = simulated_tosses(1, seed=6)[0]
    seen = simulated_tosses(1, seed=6, noise=TrackerNoise(0.0, 0.0))[0]
    airborne = slice(0, 8)
    np.testing.assert_allclose(seen.linear_velocities[airborne], states.linear_velocities[airborne], atol=1e-6)
    np.testing.assert_allclose(seen.angular_velocities[airborne], states.angular_velocities[airborne], atol=1e-6)


@pytest.fixture(scope="module")
def real_tosses(contactnets_folder: Path) -> list[Toss]:
    scales = length_scales(CONTACTNETS_CUBE)
    tosses = (torch.load(contactnets_folder / f"{i}.pt", weights_only=True)[0, :, :13].numpy() for i in range(570))
    return [toss_of(states * scales, 0, "cube") for states in tosses]


def test_releases_are_spread_like_the_real_ones(real_tosses: list[Toss]) -> None:
    real = in_heading_frame(np.array([first_state(toss) for toss in real_tosses]))
    ours = in_heading_frame(release_states(2000, np.random.default_rng(7)))
    for releases in (real, ours):
        np.testing.assert_allclose((releases.mean(axis=0) - RELEASE_MEAN) / RELEASE_DEVIATION, 0.0, atol=0.1)
        np.testing.assert_allclose(releases.std(axis=0) / RELEASE_DEVIATION, 1.0, atol=0.1)


def test_the_noise_is_that_of_the_real_tosses_in_the_air(real_tosses: list[Toss]) -> None:
    position, orientation = white_noise_of(real_tosses)
    assert RIG_NOISE.position == pytest.approx(position, rel=0.05)
    assert RIG_NOISE.orientation == pytest.approx(orientation, rel=0.05)


def test_the_noise_of_the_real_tosses_is_nearly_white(real_tosses: list[Toss]) -> None:
    bends = [bend for bend, _ in (second_differences(toss) for toss in real_tosses) if len(bend) > 2]
    earlier, later = (np.concatenate([bend[part] for bend in bends]) for part in (slice(None, -1), slice(1, None)))
    correlation = np.sum(earlier * later) / np.sqrt(np.sum(earlier**2) * np.sum(later**2))
    assert correlation == pytest.approx(-0.58, abs=0.02)  # white noise: -4/6


def test_the_fit_of_the_noise_finds_the_noise_that_was_put_in() -> None:
    position, orientation = white_noise_of(simulated_tosses(100, seed=8, noise=RIG_NOISE))
    assert position == pytest.approx(RIG_NOISE.position, rel=0.1)
    assert orientation == pytest.approx(RIG_NOISE.orientation, rel=0.1)


def first_state(toss: Toss) -> Array:
    return np.concatenate([toss.positions[0], toss.orientations_wxyz[0], toss.linear_velocities[0], toss.angular_velocities[0]])


def in_heading_frame(states: Array) -> Array:
    """What RELEASE_MEAN lists, of states (N, 13), as (N, 8)."""
    heading = np.arctan2(states[:, 8], states[:, 7])
    to_heading = quaternions.exp(np.stack([0.0 * heading, 0.0 * heading, -heading], axis=1))
    position, velocity = (quaternions.rotate(to_heading, states[:, columns]) for columns in (slice(0, 3), slice(7, 10)))
    spin = quaternions.rotate(to_heading, quaternions.rotate(states[:, 3:7], states[:, 10:]))
    return np.concatenate([position, velocity[:, [0, 2]], spin], axis=1)


def white_noise_of(tosses: list[Toss] | tuple[Toss, ...]) -> tuple[float, float]:
    """Standard deviations [m, rad] of white noise with the second differences that the poses have in free fall."""
    positions, orientations = zip(*(second_differences(toss) for toss in tosses), strict=True)
    of_white_noise = np.sqrt(1.0 + 4.0 + 1.0)
    return root_mean_square(positions) / of_white_noise, root_mean_square(orientations) / of_white_noise


def second_differences(toss: Toss) -> tuple[Array, Array]:
    """Of positions beyond gravity's (T, 3) [m] and of orientations (T, 3) [rad], from release to the first contact."""
    heights = CONTACTNETS_CUBE.polytope.corner_heights(toss.positions, toss.orientations_wxyz).min(axis=1)
    air = slice(0, int(np.argmax(heights < 0.008)) - 1)
    bend = np.diff(toss.positions[air], 2, axis=0)
    bend[:, 2] += CONTACTNETS_CUBE.gravity * FRAME_PERIOD**2
    q = toss.orientations_wxyz[air]
    turns = quaternions.log(quaternions.multiply(quaternions.conjugate(q[:-1]), q[1:]))
    return bend, np.diff(turns, axis=0)


def root_mean_square(parts: tuple[Array, ...]) -> float:
    return float(np.sqrt(np.mean(np.square(np.concatenate(parts)))))
