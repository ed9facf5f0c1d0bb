"""Bodies fall with gravity, whatever a hand did in the frames before, and rest where they neither move nor turn."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.data.check_faults import noisier, real_session
from contact_curation.geometry import quaternions
from contact_curation.geometry.polytopes import box
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.survey.falls import Flight, Rest, Survey, Throw, acceleration_of, survey
from contact_curation.motion.survey.rests import on_board
from contact_curation.motion.survey.series import PoseSeries

GRAVITY = 9.81


def released(rate: float, noise: float, rng: np.random.Generator, fall: float = 0.2, seconds: float = 1.0) -> PoseSeries:
    """A body that is carried at an even velocity, let go between two frames, and lies after its fall where it lands."""
    times = np.arange(round(seconds * rate)) / rate - 0.35 + rng.uniform(0.0, 1.0 / rate)
    moved = np.minimum(times, fall)
    fallen = 0.5 * GRAVITY * np.maximum(moved, 0.0) ** 2
    places: Array = np.outer(moved, rng.uniform(-0.5, 0.5, 3)) - np.outer(fallen, [0.0, 0.0, 1.0])
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (len(times), 1))
    return PoseSeries(np.rint((times + 1.0) * 1e9).astype(np.int64), places + noise * rng.standard_normal(places.shape), turns)


@pytest.mark.slow
@pytest.mark.parametrize(("rate", "noise"), [(60.0, 5e-4), (60.0, 2e-5), (148.0, 2e-4), (148.0, 2e-5), (500.0, 1e-4)])
def test_bodies_that_a_hand_lets_go_fall_with_gravity(rate: float, noise: float) -> None:
    rng = np.random.default_rng(0)
    found = survey([released(rate, noise, rng) for _ in range(150)])
    assert len(found.throws) == 150
    assert found.gravity is not None
    sizes = [float(np.linalg.norm(throw.acceleration)) for throw in found.throws]
    assert np.linalg.norm(found.gravity) == pytest.approx(GRAVITY, rel=0.005)
    assert np.median(sizes) == pytest.approx(GRAVITY, rel=0.005)


@pytest.mark.parametrize("seed", [0, 1])
def test_noise_does_not_choose_the_falls_that_it_bends_most(seed: int) -> None:
    rng = np.random.default_rng(seed)
    found = survey([released(148.0, 6e-4, rng) for _ in range(20)])
    assert len(found.throws) == 20
    assert found.gravity is not None
    assert np.linalg.norm(found.gravity) == pytest.approx(GRAVITY, rel=0.006)


def waved(noise: float, rng: np.random.Generator) -> PoseSeries:
    """A hand moves a body to and fro for 20 s, at up to 3 m/s^2 along each axis."""
    times = np.arange(3000) / 148.0
    places = 0.05 * np.sin(7.5 * times[:, np.newaxis] + rng.uniform(0.0, 6.0, 3)) + noise * rng.standard_normal((3000, 3))
    return PoseSeries(np.rint(1e9 * times).astype(np.int64), places, np.tile([1.0, 0.0, 0.0, 0.0], (3000, 1)))


@pytest.mark.parametrize("noise", [1.3e-4, 2.2e-4])
@pytest.mark.parametrize("seed", [0, 1])
def test_what_a_hand_does_for_long_in_noise_is_no_fall(seed: int, noise: float) -> None:
    rng = np.random.default_rng(seed)
    found = survey([waved(noise, rng), *(released(148.0, noise, rng) for _ in range(6))])
    assert len(found.throws) == 6
    assert found.gravity is not None
    assert np.linalg.norm(found.gravity) == pytest.approx(GRAVITY, rel=0.02)


@pytest.mark.parametrize("seed", [2, 3])
def test_bodies_at_rest_do_not_fall_in_noise(seed: int) -> None:
    rng = np.random.default_rng(seed)
    found = survey([released(148.0, 6e-4, rng, 0.13, 3.0) for _ in range(20)])
    assert [len(throw.flights) for throw in found.throws] == [1] * 20
    assert [throw.rest is not None for throw in found.throws] == [True] * 20


@pytest.mark.parametrize("first", [60, 220, 260])
def test_real_impacts_in_much_noise_are_not_taken_for_gravity(first: int, contactnets_folder: Path) -> None:
    made = real_session(contactnets_folder, range(first, first + 20))
    made = noisier(28.0)(made, np.random.default_rng(first // 20))
    found = survey([PoseSeries(made.stamps_ns, made.poses[:, :3], made.poses[:, 3:])])
    assert found.gravity is not None
    assert np.linalg.norm(found.gravity) == pytest.approx(9.65, rel=0.05)  # lengths are 1.7 % short


def at_rest(height: float, tilt: float = 0.0) -> Throw:
    lying = Rest(0, 1, np.array([0.0, 0.0, height]), quaternions.exp(np.array([tilt, 0.5 * tilt, 0.0])))
    return Throw((), lying, Flight(0, 0, 1), np.array([0.0, 0.0, -GRAVITY]))


@pytest.mark.parametrize("elsewhere", ["caught", "held", "on the floor", "on a shelf"])
def test_the_board_is_where_most_bodies_rest_equally_high(elsewhere: str) -> None:
    rng = np.random.default_rng(1)
    board = 0.05 + rng.uniform(0.0, 0.01, 20)
    aside, tilt = {
        "caught": (rng.uniform(0.3, 1.2, 60), 0.0),
        "held": (np.full(60, 0.5), 0.7),
        "on the floor": (np.full(15, -0.65), 0.0),
        "on a shelf": (np.full(15, 0.9), 0.0),
    }[elsewhere]
    throws = (*map(at_rest, board), *(at_rest(height, tilt) for height in aside))
    found = on_board(Survey((), 0.0, np.array([0.0, 0.0, -GRAVITY]), throws, 1.0), box([0.06, 0.06, 0.06]))
    assert [one.rest is not None for one in found.throws] == [True] * 20 + [False] * len(aside)


ROCKING, PERIOD, CYCLES, RADIUS = np.radians(9.0), 1.0, 1.25, 0.045
"""[rad, s, 1, m] A disk with many edges rolls to and fro on them, slowly."""


def rocking(rate: float, noise: float, rng: np.random.Generator) -> PoseSeries:
    """A released body that rocks where it lands, and then lies upright."""
    fallen = released(rate, noise, rng)
    times = np.arange(round(3.0 * rate)) / rate
    turned = np.where(times < CYCLES * PERIOD, ROCKING * np.cos(2.0 * np.pi * times / PERIOD), 0.0)
    stop = round(0.55 * rate)
    turns = quaternions.exp(np.concatenate([np.zeros((stop, 3)), np.outer(turned, [0.0, 1.0, 0.0])]))
    rolled = fallen.positions[stop] + np.outer(RADIUS * (turned - turned[0]), [1.0, 0.0, 0.0])
    places = np.concatenate([fallen.positions[:stop], rolled + noise * rng.standard_normal(rolled.shape)])
    turns = quaternions.multiply(quaternions.exp(10.0 * noise * rng.standard_normal(places.shape)), turns)
    return PoseSeries(np.rint(1e9 * np.arange(len(places)) / rate).astype(np.int64), places, turns)


@pytest.mark.parametrize(("rate", "noise"), [(60.0, 2e-4), (120.0, 2e-5), (120.0, 2e-4), (500.0, 1e-4)])
def test_a_turning_point_of_a_body_that_rocks_is_no_rest(rate: float, noise: float) -> None:
    rng = np.random.default_rng(0)
    throws = survey([rocking(rate, noise, rng) for _ in range(20)]).throws
    rests = np.array([throw.rest.orientation_wxyz for throw in throws if throw.rest is not None])
    off = np.degrees(2.0 * np.arccos(np.clip(np.abs(rests[:, 0]), 0.0, 1.0)))
    assert len(rests) == 20
    assert off.max() < 1.0


def test_a_body_rests_that_is_seen_for_a_moment_before_a_gap() -> None:
    """Tosses that were cut, one after the other: what comes behind the gap lies otherwise."""
    rng, parts = np.random.default_rng(0), list[PoseSeries]()
    for number in range(12):
        part, stop = released(148.0, 2e-5, rng), round(0.65 * 148.0)
        turn = np.tile(quaternions.exp(np.array([0.3 * number, 0.0, 0.0])), (stop, 1))
        parts.append(PoseSeries(part.stamps_ns[:stop] + 1_700_000_000 * number, part.positions[:stop], turn))
    names = ("stamps_ns", "positions", "orientations_wxyz")
    throws = survey([PoseSeries(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))]).throws
    assert [throw.rest is None for throw in throws] == [False] * 12


@pytest.mark.parametrize("shown", [[9, 8, 8], [6, 8], [8.5, 8.5, 8]], ids=str)
@pytest.mark.parametrize("right", [True, False])
def test_uneven_stamps_count_where_the_body_falls_by_them(shown: list[float], right: bool) -> None:
    times = 1e-3 * np.cumsum(np.resize(shown, 16))
    taken = times if right else np.linspace(times[0], times[-1], len(times))
    noise = np.random.default_rng(0).normal(0.0, 2e-5, (len(times), 3))
    positions = np.outer(taken, [0.8, -0.3, 0.5]) - np.outer(0.5 * 9.81 * taken**2, [0.0, 0.0, 1.0]) + noise
    np.testing.assert_allclose(acceleration_of(positions, times), [0.0, 0.0, -9.81], atol=0.06)
