"""The beginning of a fall is found in noisy poses of a held and then flying body, with an uncertainty that is true."""

import numpy as np
import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.motion.release import BodyShape, Fall, ReleaseConfig, Track, find_fall
from test.motion.release.hand import COMMANDED, CUBE, PLANNED, Thrown, thrown


def test_the_fall_of_a_hand_that_is_off_its_plan_is_found_within_its_stated_error() -> None:
    throws = [thrown(seed, noise=3e-4) for seed in range(10)]
    found = [one.found() for one in throws]
    errors = np.array([fall.time - one.fall for one, fall in zip(throws, found) if isinstance(fall, Fall)])
    stated = np.array([fall.time_sd for fall in found if isinstance(fall, Fall)])
    assert len(errors) == len(throws)
    assert np.abs(errors).max() < 0.002
    assert 0.4 < np.sqrt(np.mean((errors / stated) ** 2)) < 1.8


def test_the_state_at_the_release_is_the_bodys() -> None:
    one = thrown(3)
    fall = one.found()
    assert isinstance(fall, Fall)
    place, velocity = one.release
    np.testing.assert_allclose(fall.state[:3], place, atol=1e-3)
    np.testing.assert_allclose(fall.state[7:10], velocity, atol=0.01 * np.linalg.norm(velocity))
    np.testing.assert_allclose(fall.state[10:], one.spin, atol=0.1)
    assert quaternions.angle_between(fall.state[3:7], quaternions.IDENTITY) < 0.02


def test_a_body_that_does_not_turn_evenly_has_its_own_spin_at_the_release() -> None:
    long = BodyShape(CUBE.vertices, np.diag([1.0, 6.0, 6.5]), CUBE.gravity)
    one = Thrown(np.array([0.8, 0.0, 0.1]), np.zeros(3), noise=1e-5)
    track, spin = one.track(), np.array([2.0, 4.0, -1.0])
    turned, rate, step = [quaternions.IDENTITY], spin, 1e-4
    for _ in range(2500):  # Euler's equations, in small steps
        turned.append(quaternions.multiply(turned[-1], quaternions.exp(step * rate)))
        rate = rate - step * np.linalg.solve(long.inertia, np.cross(rate, long.inertia @ rate))
    rows = np.clip(((track.times - one.fall) / step).astype(int), 0, 2500)
    fall = find_fall(Track(track.times, track.positions, np.array(turned)[rows]), one.hand, COMMANDED, PLANNED, long)
    assert isinstance(fall, Fall)
    np.testing.assert_allclose(fall.state[10:], spin, atol=0.1)


def test_tracking_outliers_and_lost_frames_do_not_move_the_fall() -> None:
    one = thrown(4)
    track, rng = one.track(), np.random.default_rng(7)
    outlier, lost = rng.random(len(track.times)) < 0.05, rng.random(len(track.times)) < 0.1
    positions = track.positions + outlier[:, None] * rng.normal(0.0, 0.02, track.positions.shape)
    fall = one.found(Track(track.times[~lost], positions[~lost], track.orientations_wxyz[~lost]))
    assert isinstance(fall, Fall)
    assert abs(fall.time - one.fall) < 0.002


def test_the_landing_takes_no_part() -> None:
    one = Thrown(np.array([0.6, 0.0, -0.3]), np.zeros(3))
    track = one.track()
    lowest = track.positions[:, 2] + CUBE.vertices[:, 2].min()
    assert lowest.min() < -0.05  # the flight would go on below the board
    stopped = track.positions.copy()
    stopped[lowest < 0.0, 2] = -CUBE.vertices[:, 2].min()
    fall = one.found(Track(track.times, stopped, track.orientations_wxyz))
    assert isinstance(fall, Fall)
    assert abs(fall.time - one.fall) < 0.001


@pytest.mark.parametrize(
    ("track", "line"),
    [
        (thrown(5).track(stays=True), "no fall found"),
        (Track(np.zeros(0), np.zeros((0, 3)), np.zeros((0, 4))), "0 frames of the held body"),
    ],
)
def test_a_body_that_does_not_fall_or_is_not_seen_is_said_in_one_line(track: Track, line: str) -> None:
    found = thrown(5).found(track)
    assert isinstance(found, str)
    assert line in found


def test_a_span_that_is_not_positive_is_refused() -> None:
    with pytest.raises(InvalidValueError, match=r"release\.held_span"):
        ReleaseConfig(held_span=0.0)
