"""A file's toss is put back onto the board and the stamps that it was tracked with."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.motion.restored_toss import restored
from contact_curation.motion.smoothing import kinematics
from contact_curation.motion.toss import NANOSECONDS
from test.motion.recorded_tosses import recorded


@pytest.mark.parametrize("yaw", [0.0, 0.8, 1.6, 3.0, -2.0])
def test_a_toss_along_x_comes_back_as_the_tracker_saw_it_whatever_its_yaw(yaw: float) -> None:
    made = recorded(1, yaw=yaw)
    back = restored(made.toss)
    assert (back.yaw - yaw + np.pi) % (2.0 * np.pi) - np.pi == pytest.approx(0.0, abs=1e-10)
    np.testing.assert_allclose(back.toss.positions, made.positions, atol=1e-10)
    np.testing.assert_allclose(back.toss.linear_velocities, made.velocities, atol=1e-9)
    steps = np.diff(back.toss.stamps_ns) / NANOSECONDS
    sure = back.timing.anchored[1:] if back.timing else np.zeros(0, dtype=bool)
    assert back.timed_steps == np.count_nonzero(sure) > 90
    assert np.abs(steps[sure] - made.periods[sure]).max() <= 1.01e-9
    assert back.toss.frame_period == made.toss.frame_period, "nominal: the loss is defined with it"


def test_a_toss_along_y_is_turned_on_by_a_quarter_until_it_leaves_along_x() -> None:
    made = recorded(2, yaw=0.2, heading=0.5 * np.pi)
    back = restored(made.toss)
    np.testing.assert_allclose(back.toss.positions[:, 0], made.positions[:, 1], atol=1e-10)


def test_differences_and_medians_of_the_restored_toss_are_the_files_velocities() -> None:
    toss = restored(recorded(3, yaw=1.2).toss).toss
    rates = kinematics(toss.stamps_ns, toss.positions, toss.orientations_wxyz)
    inner = slice(2, -1)  # the medians of the others look at frames outside
    np.testing.assert_allclose(rates.linear_velocities[inner], toss.linear_velocities[inner], rtol=5e-7, atol=1e-9)
    np.testing.assert_allclose(rates.angular_velocities[inner], toss.angular_velocities[inner], rtol=5e-7, atol=1e-9)


def test_what_was_made_in_another_way_stays_as_it_was() -> None:
    made = recorded(4, yaw=0.9).toss
    slower = replace(made, linear_velocities=0.8 * made.linear_velocities, angular_velocities=0.7 * made.angular_velocities)
    assert restored(slower).toss is slower
    short = recorded(5, frames=2).toss
    assert (restored(short).toss, restored(short).timing) == (short, None)
