"""Tosses as pairs of successive frames in characteristic units."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import by_differences, periods_of, states_of, transitions_of, usual_period
from test.motion.streams import CUBE, HALF_WIDTH, stream
from test.motion.test_segmenter import cut


@pytest.fixture(scope="module")
def toss() -> Toss:
    (found,) = cut(stream())
    assert isinstance(found, Toss)
    return found


def test_lengths_are_divided_by_the_characteristic_length_and_turns_are_not(toss: Toss) -> None:
    states = states_of(toss, HALF_WIDTH)
    assert states[-1, 2] == pytest.approx(1.0, abs=1e-3), "a cube at rest stands one half width high"
    np.testing.assert_allclose(states[:, 3:7], toss.orientations_wxyz)
    np.testing.assert_allclose(states[:, 7:10] * HALF_WIDTH, toss.linear_velocities)
    np.testing.assert_allclose(states[:, 10:13], toss.angular_velocities)


def test_transitions_join_tosses_without_joining_their_ends(toss: Toss) -> None:
    joined = transitions_of([toss, toss], HALF_WIDTH)
    steps = toss.frames - 1
    assert joined.starts.tolist() == [0, steps, 2 * steps]
    np.testing.assert_array_equal(joined.before[1:steps], joined.after[: steps - 1])
    np.testing.assert_array_equal(joined.toss_index, [0] * steps + [1] * steps)
    np.testing.assert_array_equal(joined.index_in_toss, [*range(steps), *range(steps)])
    np.testing.assert_allclose(joined.dt, toss.frame_period)
    assert CUBE.polytope.corner_heights(toss.positions, toss.orientations_wxyz).min() > -1e-6


def test_plain_velocities_lead_from_pose_to_pose_and_those_of_a_toss_are_its_own(toss: Toss) -> None:
    other = replace(toss, positions=2.0 * toss.positions)
    data = transitions_of([toss, other], HALF_WIDTH)
    plain = by_differences(data)
    np.testing.assert_allclose(
        data.before[:, :3] + data.dt[:, np.newaxis] * plain.after[:, 7:10], data.after[:, :3], atol=1e-12
    )
    turns = quaternions.exp(data.dt[:, np.newaxis] * plain.after[:, 10:])
    turned = quaternions.multiply(data.before[:, 3:7], turns)
    np.testing.assert_allclose(np.abs((turned * data.after[:, 3:7]).sum(axis=1)), 1.0, atol=1e-12)
    np.testing.assert_array_equal(plain.before[:, :7], data.before[:, :7])
    for begin, end in pairwise(data.starts):
        np.testing.assert_array_equal(plain.before[begin + 1 : end, 7:], plain.after[begin : end - 1, 7:])
        np.testing.assert_array_equal(plain.before[begin, 7:], plain.after[begin, 7:])


def test_no_tosses_are_no_transitions() -> None:
    with pytest.raises(InvalidValueError, match="tosses: found none"):
        transitions_of([], HALF_WIDTH)


@pytest.mark.parametrize(
    ("steps", "period"),
    [
        ([8, 8, 9], 25 / 3),
        ([8.5, 8.5, 8], 25 / 3),
        ([6, 8], 7),
        ([*(5 * [11.5, 2]), 11.5], 79 / 41),
        ([6.7, 6.8, 6.7, 6.7, 6.9], 6.7),
        ([7, 7, 14, 7], 7),
        ([*(5 * [5, 8]), 5], 70 / 11),
        ([*(5 * [8, 5]), 8], 73 / 11),
        ([3, 13.7, 6.3, 10.3, 9.7, 7, 13, 3.7, 16.3, 0.4, 16.6, 3, 13.7], 9),
    ],
)
def test_the_frame_period_is_what_uneven_steps_come_to(steps: list[float], period: float) -> None:
    assert usual_period(np.array(steps)) == pytest.approx(period, rel=0.01)


@pytest.mark.parametrize(("wave", "uneven"), [(0.2, False), (0.5, True)])
def test_steps_are_as_stamped_where_stamps_are_uneven(toss: Toss, wave: float, uneven: bool) -> None:
    steps = np.full(toss.frames - 1, toss.frame_period) + 1e-3 * wave * (-1.0) ** np.arange(toss.frames - 1)
    stamps = toss.stamps_ns[0] + np.concatenate([[0], np.rint(1e9 * np.cumsum(steps)).astype(np.int64)])
    stamped = replace(toss, stamps_ns=stamps)
    dt = transitions_of([stamped], HALF_WIDTH).dt
    np.testing.assert_allclose(dt, steps if uneven else toss.frame_period, atol=2e-9)
    np.testing.assert_array_equal(periods_of(stamped), np.arange(toss.frames))


def test_predictions_are_compared_at_the_nearest_frame_periods(toss: Toss) -> None:
    steps = np.resize([0.0137, 0.0063, 0.0103, 0.0057], toss.frames - 1)  # one by one they would be 2, 1, 1 and 1
    stamps = toss.stamps_ns[0] + np.concatenate([[0], np.rint(1e9 * np.cumsum(steps)).astype(np.int64)])
    uneven = replace(toss, stamps_ns=stamps, frame_period=usual_period(steps))
    times = (stamps - stamps[0]) / 1e9
    np.testing.assert_allclose(uneven.frame_period * periods_of(uneven), times, atol=0.501 * uneven.frame_period)
