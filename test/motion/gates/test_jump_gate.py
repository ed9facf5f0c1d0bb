"""The tracker leaves out poses that a body cannot have come to, and goes on when it is back; states survive a restart."""

import json
from dataclasses import replace

import numpy as np
import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.scalars import Quaternion, ScalarPose, angle_between
from contact_curation.motion.body_tracker import BodyPose, BodyTracker, TrackerConfig, TrackerEvent
from contact_curation.motion.pose_stream import BadPose, FramePose

PERIOD_NS = 6_756_757
CONFIG = TrackerConfig("body", "", largest_speed=10.0, largest_spin=60.0)


def quaternion(turn: list[float]) -> Quaternion:
    w, x, y, z = quaternions.exp(turn).tolist()
    return w, x, y, z


def measured(frame: int, x: float = 0.0, turn: float = 0.0) -> FramePose:
    return FramePose(frame * PERIOD_NS, "board", "body", ScalarPose((x, 0.0, 0.0), quaternion([turn, 0.0, 0.0])))


def pushed(tracker: BodyTracker, *poses: FramePose) -> list[TrackerEvent]:
    return [event for pose in poses for event in tracker.push(pose)]


def kinds(events: list[TrackerEvent]) -> list[str]:
    return [event.kind if isinstance(event, BadPose) else type(event).__name__ for event in events]


@pytest.mark.parametrize("jump", [measured(1, x=0.1), measured(1, turn=0.6)], ids=["place", "turn"])
def test_a_jump_is_left_out_with_its_reason_and_the_next_pose_is_taken(jump: FramePose) -> None:
    tracker = BodyTracker(CONFIG)
    events = pushed(tracker, measured(0), jump, measured(2, x=0.01))
    assert kinds(events) == ["BodyPose", "jump", "BodyPose"]
    bad = events[1]
    assert isinstance(bad, BadPose)
    assert "10 m/s and 60 rad/s at most" in bad.why
    assert tracker.counts == {"poses": 2, "jump": 1}


@pytest.mark.parametrize("far", [measured(1, x=0.05), measured(1, turn=0.35)], ids=["place", "turn"])
def test_what_a_thrown_body_can_do_is_no_jump(far: FramePose) -> None:
    assert kinds(pushed(BodyTracker(CONFIG), measured(0), far)) == ["BodyPose", "BodyPose"]


def test_a_body_that_was_away_for_a_while_may_be_elsewhere() -> None:
    assert kinds(pushed(BodyTracker(CONFIG), measured(0), measured(40, x=1.0, turn=2.0))) == ["BodyPose", "BodyPose"]


def test_a_tracker_without_limits_takes_every_pose() -> None:
    free = replace(CONFIG, largest_speed=float("inf"), largest_spin=float("inf"))
    assert kinds(pushed(BodyTracker(free), measured(0), measured(1, x=100.0, turn=3.0))) == ["BodyPose", "BodyPose"]


def test_after_a_clock_that_jumped_back_the_body_may_be_anywhere() -> None:
    tracker = BodyTracker(CONFIG)
    assert kinds(pushed(tracker, measured(1000), measured(0, x=5.0))) == ["BodyPose", "ClockJump", "BodyPose"]


def test_a_restarted_tracker_judges_as_the_one_before() -> None:
    tracker, restarted = BodyTracker(CONFIG), BodyTracker(CONFIG)
    pushed(tracker, measured(0))
    restarted.restore(json.loads(json.dumps(tracker.snapshot())))
    for one in (tracker, restarted):
        assert kinds(pushed(one, measured(1, x=0.1), measured(2))) == ["jump", "BodyPose"]
    assert tracker.snapshot() == restarted.snapshot()


def test_a_state_from_before_there_was_a_gate_is_taken_up() -> None:
    tracker = BodyTracker(CONFIG)
    pushed(tracker, measured(0))
    old = {key: value for key, value in tracker.snapshot().items() if key != "last_pose"}
    restarted = BodyTracker(CONFIG)
    restarted.restore(old)
    assert [type(event) for event in pushed(restarted, measured(1, x=5.0))] == [BodyPose]


@pytest.mark.parametrize("field", ["largest_speed", "largest_spin"])
def test_limits_of_nothing_are_refused(field: str) -> None:
    with pytest.raises(InvalidValueError, match=field):
        replace(CONFIG, **{field: 0.0})  # type: ignore[arg-type]


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-4, 1.0, 3.1, np.pi])
def test_angles_between_scalar_quaternions_are_those_of_arrays(angle: float) -> None:
    start = quaternion([0.3, -0.2, 0.9])
    end = quaternions.multiply(start, quaternion([0.0, angle, 0.0])).tolist()
    assert angle_between(start, tuple(end)) == pytest.approx(angle, abs=1e-12, rel=1e-7)
    assert angle_between(start, tuple(-np.array(end))) == pytest.approx(angle, abs=1e-12, rel=1e-7)
