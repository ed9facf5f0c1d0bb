"""Runs of poses give what their poses give one by one, bit for bit: events and states, wherever streams are cut into runs."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from unittest.mock import Mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from contact_curation.geometry.scalars import ScalarPose
from contact_curation.motion.body_tracker import BodyPose, BodyTracker, TrackerConfig, body_poses
from contact_curation.motion.ingest import IngestConfig, IngestEvent, TossIngest
from contact_curation.motion.pose_stream import BadPose, FramePose, FrameRun, PoseRun
from contact_curation.motion.segmenter import TossSegmenter
from contact_curation.motion.segmenter_config import SegmenterConfig
from contact_curation.motion.toss import Rejected
from test.motion.streams import CUBE, PERIOD_NS, Throw, board_in_map, in_map, noisy, stream

TOSS = stream()
LOUD = noisy(TOSS, 4.0)
FAST_NS = 1_000_000
FAST = noisy(stream(Throw(carried=120, seen=1000), period_ns=FAST_NS), 1.0)
TRACKER = TrackerConfig("body_cube", largest_wait=0.1)
CONFIGS = (
    IngestConfig(TRACKER),
    IngestConfig(replace(TRACKER, center_of_mass=(0.01, 0.0, -0.02))),
    IngestConfig(TRACKER, SegmenterConfig(region_x=(0.0, 1.0), most_frames=60)),
    IngestConfig(TRACKER, SegmenterConfig(tracker_noise=3.0, frame_period=1.0 / 148.0)),
    IngestConfig(replace(TRACKER, largest_speed=3.0)),
)


def run_of(poses: Sequence[FramePose]) -> FrameRun:
    stamps = np.array([one.stamp_ns for one in poses], dtype=np.int64)
    positions, orientations = (np.array([one.pose[part] for one in poses]) for part in (0, 1))
    return FrameRun(poses[0].parent, poses[0].child, PoseRun(stamps, positions, orientations))


def said(events: Sequence[IngestEvent]) -> list[str]:
    tosses = [(one.toss.digest(), one.reasons) if isinstance(one, Rejected) else one for one in events]
    return [repr(one if isinstance(one, tuple | BadPose) else one.digest()) for one in tosses]


def assert_same(poses: Sequence[FramePose], cuts: Sequence[int], config: IngestConfig, known: int = 0) -> int:
    """Both ways, with the board known from pose `known` on; gives how many events there were."""
    by_run, one_by_one = (TossIngest(config, CUBE, source="/odom") for _ in range(2))
    count = 0
    for start, stop in pairwise(sorted({0, known, len(poses), *(cut % len(poses) for cut in cuts)})):
        if start == known:
            assert said(by_run.push(board_in_map())) == said(one_by_one.push(board_in_map()))
        found = said(by_run.push_run(run_of(poses[start:stop])))
        assert found == said([event for one in poses[start:stop] for event in one_by_one.push(one)])
        assert repr(by_run.snapshot()) == repr(one_by_one.snapshot())
        count += len(found)
    assert said(by_run.flush()) == said(one_by_one.flush())
    assert by_run.counts == one_by_one.counts
    return count


def tossed(number: int, poses: Sequence[BodyPose], period_ns: int = PERIOD_NS, apart_ns: int = 0) -> list[FramePose]:
    """Tosses one after the other, at a rate."""
    start_ns = TOSS[0].stamp_ns
    again = [pose for _ in range(number) for pose in poses]
    stamps = [start_ns + n * period_ns + n // len(poses) * apart_ns for n in range(len(again))]
    return in_map([replace(pose, stamp_ns=stamp_ns) for pose, stamp_ns in zip(again, stamps, strict=True)])


@st.composite
def streams(draw: st.DrawFn) -> list[FramePose]:
    """Tosses with missing, late, repeated and wild poses, pauses, jumps of the clock and jitter."""
    period_ns = draw(st.sampled_from([PERIOD_NS, 1_000_000_000 // 240, 1_000_000_000 // 60]))
    apart_ns = draw(st.sampled_from([0, 100_000_000, 5_000_000_000, -4_000_000_000]))
    poses = tossed(draw(st.integers(1, 3)), draw(st.sampled_from([TOSS, LOUD])), period_ns, apart_ns)
    if draw(st.integers(0, 3)) == 0:
        period_ns = FAST_NS
        poses = tossed(1, FAST, period_ns, apart_ns)
    jitter = draw(st.sampled_from([0, 0, 100_000, 3_000_000]))
    late = np.random.default_rng(draw(st.integers(0, 99))).integers(0, jitter + 1, len(poses)).tolist()
    poses = [replace(one, stamp_ns=one.stamp_ns + by) for one, by in zip(poses, late, strict=True)]
    for place in draw(st.lists(st.integers(0, len(poses) - 2), max_size=4)):
        fault = draw(st.sampled_from(["missing", "late", "twice", "swapped", "back", "still", "wild"]))
        one, other = poses[place : place + 2]
        if fault == "missing":
            poses[place : place + 1] = []
            poses.append(replace(poses[-1], stamp_ns=poses[-1].stamp_ns + period_ns))
        elif fault == "late":
            poses[place] = replace(one, stamp_ns=one.stamp_ns + period_ns // 3)
        elif fault == "twice":
            poses[place + 1] = one
        elif fault == "swapped":
            poses[place : place + 2] = [other, one]
        elif fault == "back":
            poses[place:] = [replace(each, stamp_ns=each.stamp_ns - 10**10) for each in poses[place:]]
        elif fault == "still":
            poses[place:] = [replace(each, pose=one.pose) for each in poses[place:]]
        else:
            poses[place] = replace(one, pose=ScalarPose((0.0, -0.0, 9.0), one.pose.orientation_wxyz))
    return poses


@pytest.mark.slow
@settings(max_examples=12, deadline=None)
@given(streams(), st.lists(st.integers(0, 10_000), max_size=6), st.sampled_from(CONFIGS), st.integers(0, 40))
def test_faulty_streams_cut_anywhere(poses: list[FramePose], cuts: list[int], config: IngestConfig, known: int) -> None:
    assert_same(poses, cuts, config, known)


@pytest.mark.slow
@settings(max_examples=400, deadline=None)
@given(streams(), st.lists(st.integers(0, 10_000), max_size=6), st.sampled_from(CONFIGS), st.integers(0, 40))
def test_many_faulty_streams_cut_anywhere(poses: list[FramePose], cuts: list[int], config: IngestConfig, known: int) -> None:
    assert_same(poses, cuts, config, known)


@pytest.mark.parametrize("config", CONFIGS)
@pytest.mark.parametrize("poses", [TOSS, LOUD])
def test_tosses_in_one_run(poses: list[BodyPose], config: IngestConfig) -> None:
    assert assert_same(tossed(3, poses), [], config)


@pytest.mark.parametrize("config", CONFIGS[:2])
def test_tosses_at_1000_hz_in_one_run(config: IngestConfig) -> None:
    assert assert_same(tossed(2, FAST, FAST_NS), [700, 1500], config) == 2


def test_a_body_that_is_caught_in_the_air_in_one_run() -> None:
    falling = [0.4 - 0.5 * 9.81 * (n * PERIOD_NS * 1e-9) ** 2 for n in range(8)]
    heights = [*[0.4] * 40, *falling, *(falling[-1] + 0.004 * n for n in range(60))]
    poses = [BodyPose(0, ScalarPose((0.0, 0.0, height), (1.0, 0.0, 0.0, 0.0))) for height in heights]
    for config in CONFIGS:
        assert assert_same(tossed(1, poses), [], config) <= 1


def test_a_marker_on_the_body_in_a_frame_of_the_rig() -> None:
    half = 0.5**0.5
    by_run, one_by_one = (BodyTracker(TRACKER) for _ in range(2))
    for tracker in (by_run, one_by_one):
        tracker.push(board_in_map())
        tracker.push(FramePose(0, "marker", "body_cube", ScalarPose((0.01, 0.0, -0.03), (half, half, 0.0, 0.0)), static=True))
        tracker.push(FramePose(0, "map", "camera", ScalarPose((0.1, 0.2, 0.3), (half, 0.0, 0.0, -half)), static=True))
    poses = [replace(one, parent="camera", child="marker") for one in tossed(1, TOSS)]
    found = by_run.push_run(run_of(poses))
    assert found is not None
    assert repr(body_poses(found)) == repr([event for one in poses for event in one_by_one.push(one)])
    assert repr(by_run.snapshot()) == repr(one_by_one.snapshot())


def test_a_segmenter_ends_a_motion_at_a_gap_in_a_run() -> None:
    by_run, one_by_one = (TossSegmenter(SegmenterConfig(), CUBE, source="/odom") for _ in range(2))
    poses = [pose for n, pose in enumerate(TOSS) if n % 70 != 69]
    stamps, (positions, orientations) = [one.stamp_ns for one in poses], zip(*(one.pose for one in poses), strict=True)
    ended = by_run.push_run(PoseRun(np.array(stamps), np.array(positions), np.array(orientations)))
    others = [end for one in poses for end in one_by_one.push(one.stamp_ns, *one.pose)]
    assert said(ended) == said(others) != []
    assert by_run.snapshot() == one_by_one.snapshot()


def test_most_poses_of_an_even_stream_are_not_pushed_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    ingest = TossIngest(CONFIGS[0], CUBE, source="/odom")
    pushed = Mock(wraps=ingest._segmenter.push)
    monkeypatch.setattr(ingest._segmenter, "push", pushed)
    poses = tossed(3, TOSS)
    ingest.push(board_in_map())
    assert len(ingest.push_run(run_of(poses))) == 3
    assert pushed.call_count < 0.5 * len(poses)
