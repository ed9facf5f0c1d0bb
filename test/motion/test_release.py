"""The beginning of a fall is found in noisy poses of a held and then flying body, with an uncertainty that is true."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.release import BodyShape, Fall, HandPath, ReleaseConfig, Track, find_fall

PLANNED, COMMANDED = 0.38, 0.33
CUBE = BodyShape(CONTACTNETS_CUBE.vertices, CONTACTNETS_CUBE.inertia, CONTACTNETS_CUBE.gravity)


@dataclass(frozen=True, eq=False)
class Thrown:
    """A body that a hand swings and releases; the hand is off its plan by `off`(t), (..., 3) [m]."""

    velocity: Array
    spin: Array
    fall: float = 0.39
    noise: float = 1e-4
    seed: int = 0
    off: Callable[[Array], Array] = lambda times: np.zeros((*np.shape(times), 3))

    @property
    def hand(self) -> HandPath:
        """Speeds up for 0.35 s, goes on steadily for 0.06 s, slows down."""
        times = np.arange(0.0, 0.76, 0.002)
        up, down = np.clip(times / 0.35, 0.0, 1.0), np.clip((times - 0.41) / 0.35, 0.0, 1.0)
        share = (3.0 * up**2 - 2.0 * up**3) * (1.0 - 3.0 * down**2 + 2.0 * down**3)
        way = np.concatenate([[0.0], np.cumsum(0.001 * (share[1:] + share[:-1]))])
        return HandPath(times, np.array([-0.3, 0.0, 0.2]) + way[:, None] * self.velocity)

    @property
    def release(self) -> tuple[Array, Array]:
        near = self.fall + np.array([-1e-5, 0.0, 1e-5])
        places, velocities = self.hand.at(near)
        off = self.off(near)
        return places[1] + off[1], velocities[1] + (off[2] - off[0]) / 2e-5

    def track(self, *, stays: bool = False) -> Track:
        rng, (place, velocity) = np.random.default_rng(self.seed), self.release
        times = np.arange(-0.05, 0.62, 1.0 / 148.0)
        flown = (times - self.fall)[:, None]
        flight = place + velocity * flown - 0.5 * np.array([0.0, 0.0, CUBE.gravity]) * flown**2
        held = self.hand.at(times)[0] + self.off(times)
        places = held if stays else np.where(flown < 0.0, held, flight)
        turned = quaternions.exp(flown * self.spin)
        wobble = quaternions.exp(self.noise / 0.05 * rng.standard_normal((len(times), 3)))
        return Track(times, places + self.noise * rng.standard_normal(places.shape), quaternions.multiply(turned, wobble))

    def found(self, track: Track | None = None) -> Fall | str:
        return find_fall(self.track() if track is None else track, self.hand, COMMANDED, PLANNED, CUBE)


def thrown(seed: int, noise: float = 1e-4) -> Thrown:
    rng = np.random.default_rng(seed)
    velocity, spin = rng.uniform([0.3, -0.3, -0.2], [1.1, 0.3, 0.3]), rng.uniform(-5.0, 5.0, 3)
    error = rng.normal(0.0, [[2e-3], [0.01], [0.2]], (3, 3))  # of place, velocity and acceleration
    fall = 0.39 + 0.01 * rng.standard_normal()

    def off(times: Array) -> Array:
        s = np.asarray(times)[..., None] - PLANNED
        return np.asarray(error[0] + error[1] * s + 0.5 * error[2] * s**2 * (np.abs(s) < 0.2))

    return Thrown(velocity, spin, fall, noise, seed, off)


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
