"""Bad tosses made on purpose: what each fault changes, and that the gates know which of them they can see."""

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.errors import InvalidValueError
from contact_curation.experiments.faults import MAKERS, Fault, FaultConfig, with_faults
from contact_curation.geometry import quaternions
from contact_curation.motion.gate_config import GateConfig
from contact_curation.motion.gates import inspect
from contact_curation.motion.toss import Toss
from test.simulated import RIG_NOISE, simulated_tosses

CONFIG = FaultConfig()


@pytest.fixture(scope="module")
def tosses() -> tuple[Toss, ...]:
    return tuple(simulated_tosses(12, seed=3, noise=RIG_NOISE))


def made(toss: Toss, fault: Fault, seed: int = 0) -> Toss:
    return MAKERS[fault](toss, np.random.default_rng(seed), CONFIG)


def moved(toss: Toss, other: Toss) -> np.ndarray:
    return np.asarray(np.linalg.norm(other.positions - toss.positions, axis=1))


def turned(toss: Toss, other: Toss) -> np.ndarray:
    return quaternions.angle_between(toss.orientations_wxyz, other.orientations_wxyz)


def test_a_spike_is_one_frame_and_its_two_velocities(tosses: tuple[Toss, ...]) -> None:
    bad = made(tosses[0], Fault.SPIKE)
    off = moved(tosses[0], bad)
    assert np.count_nonzero(off) == 1
    assert off.max() == pytest.approx(0.005)
    changed = np.flatnonzero(np.abs(bad.linear_velocities - tosses[0].linear_velocities).max(axis=1))
    assert changed.tolist() == [int(off.argmax()), int(off.argmax()) + 1]


@pytest.mark.parametrize("seed", range(6))
def test_a_burst_of_outliers_is_two_or_three_frames_and_gets_past_the_median(tosses: tuple[Toss, ...], seed: int) -> None:
    off = moved(tosses[1], made(tosses[1], Fault.BURST, seed))
    assert np.count_nonzero(off) in (2, 3)
    assert off.max() == pytest.approx(0.005)


def test_a_drift_grows_evenly_and_bends_no_velocity_by_much(tosses: tuple[Toss, ...]) -> None:
    bad = made(tosses[2], Fault.DRIFT)
    np.testing.assert_allclose(moved(tosses[2], bad), np.linspace(0.0, 0.010, bad.frames), atol=1e-12)
    assert np.abs(bad.linear_velocities - tosses[2].linear_velocities).max() < 0.05


def test_another_board_tilts_and_lifts_the_whole_motion(tosses: tuple[Toss, ...]) -> None:
    bad = made(tosses[3], Fault.BOARD)
    np.testing.assert_allclose(turned(tosses[3], bad), np.radians(2.0), atol=1e-9)
    before, after = (np.linalg.norm(toss.linear_velocities, axis=1) for toss in (tosses[3], bad))
    np.testing.assert_allclose(after, before, atol=1e-12)
    assert abs((bad.positions - tosses[3].positions)[:, 2].mean()) < 0.02


def test_swapped_tags_turn_the_body_from_some_frame_on(tosses: tuple[Toss, ...]) -> None:
    angles = turned(tosses[4], made(tosses[4], Fault.TAGS))
    from_there = int(np.flatnonzero(angles > 1e-6)[0])
    np.testing.assert_allclose(angles[from_there:], 0.5 * np.pi, atol=1e-6)
    assert from_there > 0


def test_late_orientations_are_those_of_two_frames_before(tosses: tuple[Toss, ...]) -> None:
    bad = made(tosses[5], Fault.TIME)
    np.testing.assert_array_equal(bad.orientations_wxyz[2:], tosses[5].orientations_wxyz[:-2])
    np.testing.assert_array_equal(bad.positions, tosses[5].positions)


@pytest.mark.parametrize("fault", [Fault.SPIKE, Fault.BURST, Fault.TAGS])
def test_gates_see_what_jumps(tosses: tuple[Toss, ...], fault: Fault) -> None:
    seen = [bool(inspect(made(toss, fault), CONTACTNETS_CUBE, GateConfig())) for toss in tosses]
    assert sum(seen) >= len(tosses) - 1


@pytest.mark.parametrize("fault", list(Fault))
def test_a_share_of_a_pool_is_bad_and_the_same_tosses_for_every_fault(tosses: tuple[Toss, ...], fault: Fault) -> None:
    pool, bad = with_faults(tosses, fault, 0.25, seed=4)
    assert bad == with_faults(tosses, Fault.SPIKE, 0.25, seed=4)[1]
    assert {one.toss_id for one, before in zip(pool, tosses) if one.digest() != before.digest()} == bad
    assert len(bad) == 3


def test_a_share_above_one_is_refused(tosses: tuple[Toss, ...]) -> None:
    with pytest.raises(InvalidValueError, match="share of bad tosses"):
        with_faults(tosses, Fault.DRIFT, 1.5, seed=0)
