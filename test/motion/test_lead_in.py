"""Made-up frames around a stored toss let the segmenter cut the same toss out again."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.motion.lead_in import surrounded
from contact_curation.motion.segmenter import TossSegmenter
from contact_curation.motion.segmenter_config import SegmenterConfig
from contact_curation.motion.smoothing import kinematics
from contact_curation.motion.toss import NANOSECONDS, Rejected, Toss
from test.motion.recorded_tosses import PERIOD, shaken
from test.motion.streams import CUBE, Throw, stream
from test.motion.test_segmenter import cut, tossed

RULES = SegmenterConfig()


def cut_again(toss: Toss, before: int = 12, after: int = 3) -> tuple[list[Toss | Rejected], int]:
    """What the segmenter finds in the toss and its surroundings, and the stamp of the toss's own first frame."""
    made = surrounded(toss, before, after, RULES)
    stamps = NANOSECONDS + made.stamps_ns
    segmenter = TossSegmenter(RULES, CUBE, source="s")
    rows = zip(stamps.tolist(), made.positions.tolist(), made.orientations_wxyz.tolist())
    found = [event for stamp, (x, y, z), (w, a, b, c) in rows for event in segmenter.push(stamp, (x, y, z), (w, a, b, c))]
    return [*found, *segmenter.flush()], int(stamps[made.before])


@pytest.mark.parametrize("upward", [-0.5, 0.0, 0.4])
def test_the_same_frames_with_the_same_velocities_come_out(upward: float) -> None:
    toss = tossed(cut(stream(Throw(position=(0.1, 0.2, 0.3), velocity=(0.9, 0.3, upward)))))
    found, first_ns = cut_again(toss)
    again = tossed(found)
    assert again.frames == toss.frames
    assert int(again.stamps_ns[0]) == first_ns, "neither a frame of the lead-in nor one less than the toss"
    np.testing.assert_array_equal(again.positions, toss.positions)
    np.testing.assert_allclose(again.linear_velocities, toss.linear_velocities, atol=1e-6)
    np.testing.assert_allclose(again.angular_velocities, toss.angular_velocities, atol=1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_of_a_jittering_stream_every_velocity_comes_out_the_first_and_the_last_too(seed: int) -> None:
    toss = replace(tossed(cut(shaken(seed))), frame_period=PERIOD)
    found, first_ns = cut_again(toss)
    again = tossed(found)
    assert (again.frames, int(again.stamps_ns[0])) == (toss.frames, first_ns)
    np.testing.assert_array_equal(np.diff(again.stamps_ns), np.diff(toss.stamps_ns))
    np.testing.assert_allclose(again.linear_velocities, toss.linear_velocities, atol=1e-10)
    np.testing.assert_allclose(again.angular_velocities, toss.angular_velocities, atol=1e-10)


@pytest.mark.parametrize("second", [0.2, 0.5, 0.8])
def test_where_the_second_velocity_asks_for_another_release_that_is_taken(second: float) -> None:
    """In x the raw rates of frames 0, 1 and 2 are unknown, 1 and 0: the first median is 1, the second decides the unknown."""
    toss = tossed(cut(stream()))
    dt = np.diff(toss.stamps_ns[:3]) / NANOSECONDS
    positions, velocities = toss.positions.copy(), toss.linear_velocities.copy()
    positions[1, 0] = positions[0, 0] + dt[0]
    positions[2, 0] = positions[1, 0]
    velocities[:2, 0] = [1.0, second]
    made = surrounded(replace(toss, positions=positions, linear_velocities=velocities), 12, 3, RULES)
    rates = kinematics(made.stamps_ns, made.positions, made.orientations_wxyz)
    np.testing.assert_allclose(rates.linear_velocities[12:14, 0], [1.0, second], atol=1e-6)


@pytest.mark.parametrize(("before", "after"), [(4, 1), (30, 20)])
def test_few_and_many_frames_around_it_do(before: int, after: int) -> None:
    toss = tossed(cut(stream()))
    assert tossed(cut_again(toss, before, after)[0]).frames == toss.frames


def test_the_body_is_carried_to_the_release_and_lies_still_after_the_rest() -> None:
    toss = tossed(cut(stream()))
    made = surrounded(toss, 12, 3, RULES)
    carried = np.diff(made.positions[:12], axis=0)
    np.testing.assert_allclose(carried, np.tile(carried[0], (11, 1)), atol=1e-12)
    np.testing.assert_allclose(
        made.positions[11] + toss.frame_period * toss.linear_velocities[0], toss.positions[0], atol=1e-12
    )
    assert (np.diff(made.positions[-3:], axis=0) == 0.0).all()


@pytest.mark.parametrize("rate", [60, 120])
def test_a_toss_of_a_slow_camera_comes_out_with_its_plain_velocities(rate: int) -> None:
    period = round(NANOSECONDS / rate)
    toss = tossed(cut(stream(Throw(position=(0.1, 0.2, 0.3), carried=12, seen=90), period_ns=period)))
    again = tossed(cut_again(toss)[0])
    np.testing.assert_array_equal(again.positions, toss.positions)
    np.testing.assert_allclose(again.linear_velocities, toss.linear_velocities, atol=1e-6)
    np.testing.assert_allclose(again.angular_velocities, toss.angular_velocities, atol=1e-6)
