"""How much poses scatter, told by themselves."""

import json
import sys
from collections.abc import Sequence
from dataclasses import replace
from threading import Thread

import numpy as np
import pytest

from contact_curation.geometry import quaternions
from contact_curation.geometry.scalars import ScalarPose
from contact_curation.motion.body_tracker import BodyPose
from contact_curation.motion.pose_noise import KEPT, MOST, RIG, RIG_NOISE, RIG_TURN, SPAN_NS, PoseNoise, TrackerScale
from contact_curation.motion.pose_stream import PoseRun
from test.motion.streams import stream, yawed

PERIOD_NS = 10**9 // 148


def follow(poses: Sequence[BodyPose], noise: PoseNoise | None = None) -> PoseNoise:
    noise = noise or PoseNoise()
    for one in poses:
        noise.push(one.stamp_ns, one.pose.position, one.pose.orientation_wxyz)
    return noise


def followed(multiple: float, period_ns: int = PERIOD_NS, frames: int | None = None) -> PoseNoise:
    return follow(noisy(stream(period_ns=period_ns), multiple)[:frames])


def carried(seconds: float, rate: int = 148) -> list[BodyPose]:
    """About in a hand, turning."""
    times = np.arange(round(seconds * rate)) / rate
    places = [(0.3 * float(np.sin(2.0 * t)), 0.2 * float(np.cos(9.0 * t)), 0.4) for t in times]
    return [BodyPose(round(t * 1e9), ScalarPose(place, yawed(5.0 * t))) for t, place in zip(times, places, strict=True)]


def noisy(poses: Sequence[BodyPose], multiple: float, turn: float | None = None) -> list[BodyPose]:
    """With white noise of so many times that of ContactNets' rig, of orientations `turn` times if given."""
    rng, turns = np.random.default_rng(3), (multiple if turn is None else turn) * RIG_TURN
    places = np.array([one.pose.position for one in poses]) + multiple * RIG_NOISE * rng.standard_normal((len(poses), 3))
    about = quaternions.exp(turns * rng.standard_normal((len(poses), 3)))
    turned = quaternions.multiply(np.array([one.pose.orientation_wxyz for one in poses]), about)
    rows = zip(poses, places.tolist(), turned.tolist(), strict=True)
    return [BodyPose(one.stamp_ns, ScalarPose((x, y, z), (a, b, c, d))) for one, (x, y, z), (a, b, c, d) in rows]


@pytest.mark.parametrize("multiple", [1.0, 3.0, 10.0])
@pytest.mark.parametrize("rate", [60, 148, 240])
def test_the_noise_of_a_toss_is_found_at_any_rate(multiple: float, rate: int) -> None:
    assert followed(multiple, 10**9 // rate).multiple == pytest.approx(multiple, rel=0.3)


@pytest.mark.parametrize("rate", [30, 60, 148, 240])
@pytest.mark.parametrize(("multiple", "taken"), [(0.0, 1.0), (1.0, 1.0), (1.3, 1.0), (3.5, 4.0), (7.0, 8.0), (20.0, 2.0**4.5)])
def test_bounds_are_taken_for_the_noise_of_a_body_in_the_hand_at_any_rate(rate: int, multiple: float, taken: float) -> None:
    scale = follow(noisy(carried(10.0, rate), multiple)).scale
    assert scale == TrackerScale(taken, taken)


def test_positions_and_orientations_have_their_own_noise() -> None:
    assert follow(noisy(carried(5.0), 1.0, turn=3.5)).scale == TrackerScale(1.0, 4.0)
    assert follow(noisy(carried(5.0), 3.5, turn=1.0)).scale == TrackerScale(4.0, 1.0)


def test_poses_without_noise_and_too_few_poses_say_nothing() -> None:
    assert followed(0.0).multiple < 0.05
    few = followed(5.0, frames=20)
    assert (few.multiple, few.scale, few.warning(1.0)) == (0.0, RIG, "")


def test_a_second_of_poses_comes_before_bounds_are_taken() -> None:
    poses = noisy([one for one in carried(3.0) if one.stamp_ns >= 0.2e9], 4.0)
    before = follow([one for one in poses if one.stamp_ns < 2 * SPAN_NS])
    assert before.scale == RIG
    assert before.multiple == pytest.approx(4.0, rel=0.3)
    assert follow(poses).scale.position > 2.0


def test_more_noise_than_any_bounds_are_for_changes_none() -> None:
    noise = follow(noisy(carried(5.0), 2.0 * MOST))
    assert noise.multiple > MOST
    assert noise.scale == RIG


def test_far_more_noise_than_was_told_is_a_line_that_says_what_to_tell() -> None:
    noise = followed(5.0)
    line = noise.warning(1.0)
    assert line.startswith("found positions that scatter by 0.1")
    assert "expected 0.022 mm" in line
    assert "say segmenter.tracker_noise=" in line
    assert followed(2.0 * MOST).warning(1.0).endswith("smooth them, or take fewer a second")
    assert noise.warning(5.0) == followed(1.0).warning(1.0) == ""


def test_outliers_and_some_bad_seconds_are_no_noise_of_the_tracker() -> None:
    rng, poses = np.random.default_rng(0), carried(12.0)
    worse = [*noisy(poses[:600], 1.0), *noisy(poses[600:1100], 6.0), *noisy(poses[1100:], 1.0)]
    jumping = []
    for one in noisy(poses, 1.0):
        x, y, z = one.pose.position
        off = 0.005 * (rng.random() < 0.05)
        jumping.append(BodyPose(one.stamp_ns, ScalarPose((x + off, y, z - off), one.pose.orientation_wxyz)))
    for seen in (worse, jumping):
        noise = PoseNoise()
        for one in seen:
            follow([one], noise)
            assert noise.scale == RIG


def test_who_begins_later_finds_the_same_noise() -> None:
    """As a node does that starts late, against the recording."""
    poses = noisy(carried(20.0), 2.9)
    early, late = PoseNoise(), PoseNoise()
    follow(poses[:333], early)
    for first in range(333, len(poses), 100):
        follow(poses[first : first + 100], early)
        follow(poses[first : first + 100], late)
        if poses[first].stamp_ns - poses[333].stamp_ns > (KEPT + 2) * SPAN_NS:
            assert early.multiple == late.multiple
            assert early.scale == late.scale != RIG
    assert poses[first].stamp_ns > poses[333].stamp_ns + (KEPT + 2) * SPAN_NS


def test_what_is_written_down_goes_on_with_the_same_digits() -> None:
    poses = noisy(carried(4.0), 3.0)
    before, after = PoseNoise(), PoseNoise()
    follow(poses[:300], before)
    after.restore(json.loads(json.dumps(before.snapshot())))
    assert after.scale == before.scale
    for first in range(300, len(poses), 50):
        assert follow(poses[first : first + 50], before).multiple == follow(poses[first : first + 50], after).multiple


@pytest.mark.parametrize("length", [1, 40, 333, 10_000])
def test_poses_in_runs_leave_the_same_state_and_a_run_ends_where_the_scale_changes(length: int) -> None:
    quiet, gap, loud = noisy(carried(3.0), 1.0), 10 * SPAN_NS, noisy(carried(20.0), 2.9)
    poses = quiet + [BodyPose(one.stamp_ns + gap, one.pose) for one in loud]
    singly, in_runs, changes, at = PoseNoise(), PoseNoise(), 0, 0
    while at < len(poses):
        part = poses[at : at + length]
        before, stamps = in_runs.scale, np.array([one.stamp_ns for one in part])
        places, turns = (np.array([getattr(one.pose, name) for one in part]) for name in ("position", "orientation_wxyz"))
        taken = in_runs.push_run(PoseRun(stamps, places, turns))
        follow(part[: taken - 1], singly)
        assert singly.scale == before
        follow(part[taken - 1 : taken], singly)
        assert singly.snapshot() == in_runs.snapshot()
        assert taken == len(part) or in_runs.scale != before
        changes, at = changes + (in_runs.scale != before), at + taken
    assert changes == 1


def test_rounded_poses_scatter_by_what_is_rounded_and_poses_told_twice_are_no_rest() -> None:
    rounded, twice = PoseNoise(), PoseNoise()
    for number, one in enumerate(noisy(stream(), 5.0)):
        x, y, z = (round(each, 3) for each in one.pose.position)
        rounded.push(one.stamp_ns, (x, y, z), one.pose.orientation_wxyz)
        if number < 165:
            follow([one], twice)
    for number in range(500):
        twice.push(10**11 + number * PERIOD_NS, (0.0, 0.0, 0.05), (1.0, 0.0, 0.0, 0.0))
    assert rounded.multiple > 5.0
    assert twice.multiple == pytest.approx(5.0, rel=0.4)


def test_poses_that_come_slowly_say_nothing() -> None:
    assert followed(5.0, 10**9 // 20).multiple == 0.0


def test_neither_a_gap_nor_a_jump_of_the_clock_is_noise() -> None:
    noise = PoseNoise()
    for toss, start_ns in enumerate((5 * 10**9, 9 * 10**9, 2 * 10**9)):
        if toss == 2:
            noise.reset()
        for one in stream(start_ns=start_ns)[:: 1 + toss % 2]:
            x, y, z = one.pose.position
            noise.push(one.stamp_ns, (x + 10.0 * toss, y, z), one.pose.orientation_wxyz)
    assert noise.multiple < 0.5


def test_a_quaternion_of_the_other_sign_is_the_same_turn() -> None:
    noise = PoseNoise()
    for number, one in enumerate(noisy(carried(3.0), 3.5)):
        w, x, y, z = one.pose.orientation_wxyz
        sign = (-1.0) ** (number // 7)
        noise.push(one.stamp_ns, one.pose.position, (sign * w, sign * x, sign * y, sign * z))
    assert noise.scale == TrackerScale(4.0, 4.0)


def test_another_thread_may_ask_while_poses_come_in() -> None:
    noise, poses = PoseNoise(), [replace(one, stamp_ns=10**6 * k) for k, one in enumerate(carried(3.3))]  # in one span

    def feed() -> None:
        for _ in range(20):
            noise.reset()
            follow(poses, noise)

    interval, feeding = sys.getswitchinterval(), Thread(target=feed)
    sys.setswitchinterval(1e-5)
    try:
        feeding.start()
        while feeding.is_alive():
            assert noise.multiple >= 0.0
    finally:
        feeding.join()
        sys.setswitchinterval(interval)
