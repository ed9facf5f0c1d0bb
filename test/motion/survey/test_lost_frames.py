"""Frames that were lost and whose stamps were closed up."""

from collections.abc import Sequence

import numpy as np
import pytest

from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.pose_noise import RIG_NOISE
from contact_curation.motion.survey.lost_frames import lost_frames

PERIOD, REACH, GRAVITY = 1.0 / 250.0, 0.05, 9.81
FALL = np.array([0.0, 0.0, -GRAVITY])
CALM = np.array([-1.0, 0.2, 0.6, 4.0, -6.0, 3.0])
"""Velocity [m/s] and spin [rad/s] behind an impact."""


def bounced(impacts: Sequence[float], frames: int = 60) -> tuple[Array, Array]:
    """Poses of a body that falls, and changes velocity and spin at some times [periods]; white noise on positions."""
    rates = np.array([-1.2, 0.1, -1.5, 1.0, 7.0, -2.0])
    position, orientation, start = np.array([0.0, 0.0, 0.3]), np.array([1.0, 0.0, 0.0, 0.0]), 0.0
    positions, orientations = np.zeros((frames, 3)), np.zeros((frames, 4))
    for end in [*impacts, float(frames)]:
        inside = np.arange(np.ceil(start), np.ceil(end)).astype(int)
        after = np.append(inside - start, end - start)[:, np.newaxis] * PERIOD
        path = position + after * rates[:3] + 0.5 * after**2 * FALL
        turned = quaternions.multiply(orientation, quaternions.exp(after * rates[3:]))
        positions[inside], orientations[inside] = path[:-1], turned[:-1]
        position, orientation = path[-1], turned[-1]
        rates = CALM if end == impacts[0] else -0.8 * rates
        start = end
    return positions + RIG_NOISE * np.random.default_rng(0).standard_normal((frames, 3)), orientations


def found(poses: tuple[Array, Array], without: Sequence[int] = ()) -> dict[int, int]:
    """What is lost, by step, when some frames are left out."""
    kept = np.setdiff1d(np.arange(len(poses[0])), without)
    lost = lost_frames(poses[0][kept], poses[1][kept], PERIOD, REACH, GRAVITY)
    return {int(step): int(lost[step]) for step in np.flatnonzero(lost)}


def test_nothing_is_lost_of_a_whole_recording() -> None:
    assert found(bounced([25.4])) == {}


@pytest.mark.parametrize("count", [1, 2, 5])
def test_frames_lost_in_the_air_are_told(count: int) -> None:
    assert found(bounced([40.4]), range(15, 15 + count)) == {14: count}


@pytest.mark.parametrize("without", [[25], [26], [25, 26], [24, 25]])
def test_frames_lost_at_an_impact_are_told(without: list[int]) -> None:
    assert found(bounced([25.4]), without) == {without[0] - 1: len(without)}


@pytest.mark.parametrize("without", [[26], [25, 26]])
def test_a_flight_of_few_frames_between_two_impacts_is_enough(without: list[int]) -> None:
    assert found(bounced([25.4, 32.7]), without) == {without[0] - 1: len(without)}


def test_a_frame_lost_soon_after_the_release_is_told() -> None:
    assert found(bounced([40.4]), [5]) == {4: 1}


def test_two_impacts_in_a_row_leave_it_open() -> None:
    assert found(bounced([25.4, 27.7]), [26]) == {}


def test_an_outlier_is_no_lost_frame() -> None:
    positions, orientations = bounced([40.4])
    positions[20] += [0.004, 0.0, 0.003]
    assert found((positions, orientations)) == {}


def test_a_shift_that_stays_is_no_lost_frame() -> None:
    positions, orientations = bounced([40.4])
    positions[20:] += [0.004, 0.0, -0.006]
    assert found((positions, orientations)) == {}


def test_a_change_of_edge_in_slow_rolling_is_no_lost_frame() -> None:
    """What the board carries does not fall: parabolas through few frames of it bend wrongly, by 0.4 mm at 148 Hz."""
    period, at = 1.0 / 148.0, np.arange(40) - 20.5
    times = period * at[:, np.newaxis]
    path = np.where(times < 0.0, times * [0.041, 0.0, 0.081], times * [0.023, 0.0, -0.006])
    orientations = quaternions.exp(np.where(times < 0.0, times * [0.0, -3.738, 0.0], times * [0.0, 0.24, 0.0]))
    positions = path + RIG_NOISE * np.random.default_rng(0).standard_normal((40, 3))
    assert not lost_frames(positions, orientations, period, REACH, GRAVITY).any()
