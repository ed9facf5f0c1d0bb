"""Stamps and yaw come back out of the velocities that were made with them."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.restored_toss import RESOLUTION, RecoveredTiming, recover_timing
from contact_curation.motion.smoothing import median_of_three
from contact_curation.motion.toss import Toss
from test.motion.recorded_tosses import PERIOD, Recorded, recorded


def recover(toss: Toss, unit: float = 1.0) -> RecoveredTiming:
    return recover_timing(
        toss.positions / unit,
        toss.orientations_wxyz,
        toss.linear_velocities / unit,
        toss.angular_velocities,
        toss.frame_period,
    )


def wrong_periods(made: Recorded, found: RecoveredTiming) -> Array:
    """Relative errors of the periods that are said to be certain."""
    sure = found.anchored[1:]
    return np.abs(found.periods[1:][sure] / made.periods[sure] - 1.0)


@pytest.mark.parametrize(("seed", "yaw"), [(0, 0.0), (1, 0.7), (2, 1.5), (3, 2.0), (4, -2.9), (5, 1e-3)])
def test_periods_and_yaw_are_recovered(seed: int, yaw: float) -> None:
    made = recorded(seed, yaw=yaw)
    found = recover(made.toss)
    assert found.found
    assert wrong_periods(made, found).max() == 0.0, "multiples of the resolution are exact"
    assert found.anchored[1:].mean() > 0.95
    off = (found.yaw - yaw + 0.25 * np.pi) % (0.5 * np.pi) - 0.25 * np.pi
    assert abs(off) < 1e-11
    assert 0.0 <= found.yaw < 0.5 * np.pi


def test_the_unit_of_length_does_not_matter() -> None:
    made = recorded(6, yaw=1.0)
    found, other = recover(made.toss), recover(made.toss, unit=0.0524)
    np.testing.assert_array_equal(found.anchored, other.anchored)
    np.testing.assert_array_equal(found.periods[found.anchored], other.periods[found.anchored])
    assert found.yaw == pytest.approx(other.yaw, abs=1e-11)


def test_the_velocities_of_a_toss_come_back_from_its_periods_even_where_these_are_not_certain() -> None:
    uncertain = 0
    for seed in range(10, 20):
        found = recover(recorded(seed, yaw=0.4).toss)
        uncertain += int(np.count_nonzero(~found.anchored[1:]))
        assert found.linear_residuals.max() < 1e-11
        assert found.angular_residuals.max() < 1e-11
        assert np.abs(found.periods / PERIOD - 1.0).max() < 0.06
    assert uncertain > 0, "or this shows nothing"


def test_stamps_of_any_resolution_are_recovered_where_channels_agree() -> None:
    """Near zero, float64 seconds have no resolution to speak of."""
    made = recorded(7, yaw=0.3, epoch=1.0)
    assert (np.abs(made.periods / RESOLUTION - np.round(made.periods / RESOLUTION)) > 1e-3).any()
    found = recover(made.toss)
    assert found.anchored[1:].mean() > 0.9
    assert wrong_periods(made, found).max() < 1e-9


def test_velocities_of_other_origin_give_nominal_periods_and_residuals_that_tell() -> None:
    toss = recorded(8).toss
    rng = np.random.default_rng(8)
    noisy = replace(toss, linear_velocities=toss.linear_velocities + 1e-3 * rng.normal(size=(toss.frames, 3)))
    noisy = replace(noisy, angular_velocities=toss.angular_velocities + 1e-3 * rng.normal(size=(toss.frames, 3)))
    found = recover(noisy)
    assert not found.found
    np.testing.assert_array_equal(found.periods, PERIOD)
    assert found.linear_residuals.max() > 1e-3


def test_one_velocity_that_was_changed_is_told_by_its_residual_alone() -> None:
    toss = recorded(9).toss
    changed = toss.angular_velocities.copy()
    changed[40, 1] += 0.5
    found = recover(replace(toss, angular_velocities=changed))
    assert np.flatnonzero(found.angular_residuals > 1e-9).tolist() == [40]
    assert found.angular_residuals[40] == pytest.approx(0.5, rel=1.0)
    assert found.linear_residuals.max() < 1e-11


def sliding(spin: float, epoch: float) -> tuple[Array, RecoveredTiming]:
    """True periods, and what is found, of a body that slides straight on, slower and slower, and turns likewise."""
    times = epoch + np.cumsum(PERIOD * (1.0 + np.random.default_rng(1).uniform(-0.03, 0.03, 80)))
    seconds, periods = times - times[0], np.diff(times)
    way = seconds - 0.4 * seconds**2
    positions, turns = np.outer(way, [0.9, 0.3, 0.0]), np.outer(spin * way, [0.0, 0.0, 1.0])
    linear, angular = (median_of_three(np.diff(values, axis=0) / periods[:, np.newaxis]) for values in (positions, turns))
    return periods[1:], recover_timing(positions[1:], quaternions.exp(turns[1:]), linear, angular, PERIOD)


@pytest.mark.parametrize("spin", [0.0, 2.0])
def test_a_body_that_slides_straight_on_shows_no_yaw_and_no_wrong_period(spin: float) -> None:
    """Its x and y are in proportion, so both agree on every ratio, also those of its neighbours."""
    periods, found = sliding(spin, epoch=1.58e9)
    assert found.yaw == 0.0
    np.testing.assert_array_equal(found.periods[1:][found.anchored[1:]], periods[found.anchored[1:]])


def test_witnesses_that_contradict_each_other_are_not_believed() -> None:
    """Without a resolution nothing tells a sliding body's own ratio from its neighbours'."""
    periods, found = sliding(spin=2.0, epoch=1.0)
    wrong = np.abs(found.periods[1:] / periods - 1.0) > 1e-9
    assert not (wrong & found.anchored[1:]).any()


def test_a_body_at_rest_tells_nothing() -> None:
    still = np.zeros((20, 3))
    found = recover_timing(still, np.tile(quaternions.IDENTITY, (20, 1)), still, still, PERIOD)
    assert (found.found, found.yaw, found.linear_residuals.max()) == (False, 0.0, 0.0)
    np.testing.assert_array_equal(found.periods, PERIOD)


@pytest.mark.parametrize("frames", [3, 4, 5])
def test_few_frames_do(frames: int) -> None:
    found = recover(recorded(11, frames=frames).toss)
    assert found.periods.shape == found.linear_residuals.shape == (frames,)
    assert found.angular_residuals.max() < 1e-11
