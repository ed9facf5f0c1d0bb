"""Velocities are backward differences over the true stamps, then a median of three."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import medfilt

from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.smoothing import (
    kinematic_noise_growth,
    kinematics,
    median_of_three,
    median_orientations,
    noise_growth,
)

FRAMES = 40


def uneven_stamps() -> NDArray[np.int64]:
    rng = np.random.default_rng(3)
    return np.cumsum(rng.integers(6_000_000, 7_500_000, FRAMES)).astype(np.int64)


def test_the_median_is_scipys_inside_and_keeps_an_end_that_its_neighbour_equals() -> None:
    values = np.random.default_rng(1).normal(size=(FRAMES, 2))
    expected = np.stack([medfilt(column, 3) for column in values.T], axis=1)
    np.testing.assert_array_equal(median_of_three(values)[1:-1], expected[1:-1])
    np.testing.assert_array_equal(median_of_three(values)[[0, -1]], values[[0, -1]])


def test_a_fall_over_uneven_stamps_has_gravity_as_its_acceleration() -> None:
    stamps = uneven_stamps()
    seconds = (stamps - stamps[0]) / 1e9
    positions = np.outer(seconds, [1.0, -0.5, 2.0])
    rates = kinematics(stamps, positions, np.tile(quaternions.IDENTITY, (FRAMES, 1)))
    np.testing.assert_allclose(rates.linear_velocities, np.tile([1.0, -0.5, 2.0], (FRAMES, 1)), atol=1e-9)
    np.testing.assert_allclose(rates.accelerations, 0.0, atol=1e-6)


def test_the_velocity_of_a_frame_is_that_of_the_step_which_led_to_it() -> None:
    """A jump of the velocity between frames 9 and 10 shows in frame 10, not in frame 9: p' = p + dt v'."""
    stamps = np.arange(FRAMES) * 6_756_757
    velocity = np.where(np.arange(FRAMES) < 10, 1.0, 3.0)
    positions = np.outer(np.cumsum(velocity) * 6_756_757e-9, [0.0, 0.0, 1.0])
    rates = kinematics(stamps, positions, np.tile(quaternions.IDENTITY, (FRAMES, 1)))
    np.testing.assert_allclose(rates.linear_velocities[:, 2], velocity, rtol=1e-9)
    assert rates.accelerations[:, 2].argmax() == 10


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_angular_velocity_is_in_the_body_frame_and_blind_to_the_sign_of_the_quaternion(sign: float) -> None:
    omega, stamps = np.array([1.0, -2.0, 4.0]), uneven_stamps()
    seconds = (stamps - stamps[0]) / 1e9
    turns = quaternions.multiply(quaternions.exp([0.3, 2.0, -0.5]), quaternions.exp(np.outer(seconds, omega)))
    turns[::2] *= sign
    rates = kinematics(stamps, np.zeros((FRAMES, 3)), turns)
    np.testing.assert_allclose(rates.angular_velocities, np.tile(omega, (FRAMES, 1)), atol=1e-6)


def test_an_outlier_of_one_frame_is_not_seen_in_the_velocities() -> None:
    stamps = np.arange(FRAMES) * 6_756_757
    positions = np.outer(np.arange(FRAMES), [0.01, 0.0, 0.0])
    clean = kinematics(stamps, positions, np.tile(quaternions.IDENTITY, (FRAMES, 1)))
    positions[20] += 0.005
    with_outliers = kinematics(stamps, positions, np.tile(quaternions.IDENTITY, (FRAMES, 1)))
    np.testing.assert_allclose(with_outliers.linear_velocities, clean.linear_velocities, atol=1e-12)


def turning(speed: float) -> Array:
    return quaternions.exp(np.outer(np.arange(FRAMES), [speed, 0.0, 0.0]))


@pytest.mark.parametrize(("speed", "tolerance"), [(0.02, 1e-5), (0.5, 3e-3)])
def test_filtered_orientations_lose_outliers_and_keep_a_steady_turn_through_half_turns(speed: float, tolerance: float) -> None:
    steady = turning(speed)
    np.testing.assert_allclose(quaternions.angle_between(median_orientations(steady), steady), 0.0, atol=1e-7)
    disturbed = steady.copy()
    disturbed[17] = quaternions.multiply(steady[17], quaternions.exp([0.0, 0.1, 0.0]))
    assert quaternions.angle_between(median_orientations(disturbed)[17], steady[17]) < tolerance


@pytest.mark.parametrize(("rate", "filtered"), [(30, False), (60, False), (120, False), (148, True), (250, True)])
def test_velocities_of_slow_cameras_are_the_differences_themselves_and_noise_counts_so_much_more(
    rate: int, filtered: bool
) -> None:
    rng = np.random.default_rng(rate)
    stamps = np.rint(1e9 * (np.arange(FRAMES) + 0.05 * rng.random(FRAMES)) / rate).astype(np.int64)
    positions = rng.normal(size=(FRAMES, 3))
    orientations = quaternions.exp(0.3 * rng.normal(size=(FRAMES, 3)))
    found = kinematics(stamps, positions, orientations)
    seconds = np.diff(stamps)[:, np.newaxis] / 1e9
    turns = quaternions.log(quaternions.multiply(quaternions.conjugate(orientations[:-1]), orientations[1:])) / seconds
    for own, rates in ((found.linear_velocities, np.diff(positions, axis=0) / seconds), (found.angular_velocities, turns)):
        assert np.array_equal(own[1:], rates) != filtered
        np.testing.assert_array_equal(own[2:-1], (median_of_three(rates) if filtered else rates)[1:-1])
    growth = 10.0 * rate / 150.0
    assert noise_growth(1.0 / rate, 10.0) == pytest.approx(growth)
    assert kinematic_noise_growth(1.0 / rate, 10.0) == pytest.approx(growth * (1.0 if filtered else 1.6))
