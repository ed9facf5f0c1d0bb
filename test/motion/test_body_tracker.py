"""Whatever the frames a tracker measures in, out come poses of the body on the board; what is left out says why."""

import json
from collections.abc import Iterable, Sequence

import numpy as np
import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.scalars import ScalarPose, compose, inverse
from contact_curation.motion.body_tracker import BodyPose, BodyTracker, ClockJump, TrackerConfig, TrackerEvent
from contact_curation.motion.pose_stream import BadPose, FramePose
from test.motion.streams import BOARD, PERIOD_NS, board_in_map, in_map, stream, yawed

TRUTH = stream()[:40]
CONFIG = TrackerConfig("body_cube")


def tracked(measured: Iterable[FramePose | BadPose], config: TrackerConfig = CONFIG) -> list[TrackerEvent]:
    tracker = BodyTracker(config)
    return [*(event for one in measured for event in tracker.push(one)), *tracker.flush()]


def assert_poses(found: Sequence[TrackerEvent], expected: Sequence[BodyPose]) -> None:
    assert [event.stamp_ns for event in found if isinstance(event, BodyPose)] == [one.stamp_ns for one in expected]
    for event, one in zip(found, expected, strict=True):
        assert isinstance(event, BodyPose)
        np.testing.assert_allclose(event.pose.position, one.pose.position, atol=1e-12)
        assert quaternions.angle_between(event.pose.orientation_wxyz, one.pose.orientation_wxyz) < 1e-7


def test_poses_in_the_map_of_a_static_board_come_out_on_the_board() -> None:
    assert_poses(tracked([board_in_map(), *in_map(TRUTH)]), TRUTH)


def test_poses_given_on_the_board_come_out_as_they_are() -> None:
    given = [FramePose(one.stamp_ns, "body_surface", "body_cube", one.pose) for one in TRUTH]
    assert tracked(given) == TRUTH


def test_without_a_board_frame_the_parent_of_the_poses_is_the_board() -> None:
    given = [FramePose(one.stamp_ns, "mocap", "body_cube", one.pose) for one in TRUTH]
    assert tracked(given, TrackerConfig("body_cube", board_frame="")) == TRUTH


def moving_board(number: int) -> ScalarPose:
    return compose(BOARD, ScalarPose((0.01 * number, 0.0, 0.0), yawed(0.02 * number)))


def test_a_board_that_is_measured_with_the_body_may_move_and_may_come_late() -> None:
    """TagSLAM gives both with one stamp, in either order."""
    measured: list[FramePose] = []
    for number, one in enumerate(TRUTH):
        board = FramePose(one.stamp_ns, "map", "body_surface", moving_board(number))
        body = FramePose(one.stamp_ns, "map", "body_cube", compose(moving_board(number), one.pose))
        measured += [body, board] if number % 2 else [board, body]
    assert_poses(tracked(measured), TRUTH)


def test_a_camera_that_moves_between_the_frames_is_interpolated() -> None:
    """The camera reports at another rate; the board stands still in the map, the body is measured in the camera."""
    camera = {number: ScalarPose((0.02 * number, 1.0, 0.5), yawed(0.03 * number)) for number in range(-4, 48)}
    measured: list[FramePose] = [board_in_map()]
    for number, one in enumerate(TRUTH):
        measured.append(
            FramePose(one.stamp_ns, "camera", "body_cube", compose(inverse(camera[number]), compose(BOARD, one.pose)))
        )
    for number in range(-4, 48, 3):
        measured.append(FramePose(TRUTH[0].stamp_ns + number * PERIOD_NS, "map", "camera", camera[number]))
    assert_poses(tracked(measured), TRUTH)


def seen_by_an_arm(every: int, *, twice: bool = False) -> tuple[list[FramePose], list[FramePose]]:
    """What a camera measures that an arm swings, and where that is at every so many of the poses; each once more if asked."""

    def camera(number: float) -> ScalarPose:
        phase = 2.0 * np.pi * 0.5 * number * PERIOD_NS / 1e9
        w, x, y, z = quaternions.exp([0.2 * np.sin(phase), 0.1 * np.cos(1.3 * phase), 0.2 * phase]).tolist()
        return ScalarPose((float(0.2 * np.sin(phase)), float(0.1 * np.cos(phase)), 0.6), (w, x, y, z))

    body = [
        FramePose(one.stamp_ns, "camera", "body_cube", compose(inverse(camera(number)), compose(BOARD, one.pose)))
        for number, one in enumerate(TRUTH)
    ]
    moved: list[FramePose] = []
    for number in range(-10, 60, every):
        stamp_ns = TRUTH[0].stamp_ns + number * PERIOD_NS + 1_300_000
        place = camera(number + 1_300_000 / PERIOD_NS)
        moved.append(FramePose(stamp_ns, "map", "camera", place))
        if twice:
            (px, py, pz), turn = place
            moved.append(FramePose(stamp_ns + 2_000, "map", "camera", ScalarPose((px + 2e-5, py, pz), turn)))
    return body, moved


@pytest.mark.parametrize(("every", "millimetres"), [(1, 1e-5), (5, 0.005)])
def test_a_camera_that_an_arm_swings_is_not_taken_to_move_along_straight_lines(every: int, millimetres: float) -> None:
    """Straight lines between its poses at 30 Hz would be 0.4 mm off, more than ten times the noise of tracking."""
    found = tracked([board_in_map(), *(one for part in seen_by_an_arm(every) for one in part)])
    places = [event.pose.position for event in found if isinstance(event, BodyPose)]
    assert len(places) == len(TRUTH)
    assert np.abs(np.array(places) - [one.pose.position for one in TRUTH]).max() < 1e-3 * millimetres


def test_a_camera_whose_place_is_sent_twice_gives_no_more_noise_than_its_places_have() -> None:
    found = tracked([board_in_map(), *(one for part in seen_by_an_arm(1, twice=True) for one in part)])
    places = [event.pose.position for event in found if isinstance(event, BodyPose)]
    assert np.abs(np.array(places) - [one.pose.position for one in TRUTH]).max() < 6e-5


def test_where_a_moving_camera_is_does_not_depend_on_when_that_is_said() -> None:
    body, moved = seen_by_an_arm(5)
    at_last = tracked([board_in_map(), *body, *moved])
    by_turns = sorted([*body, *moved], key=lambda one: one.stamp_ns)
    assert tracked([board_in_map(), *moved, *body]) == at_last
    assert tracked([board_in_map(), *by_turns]) == at_last


def test_a_camera_that_says_no_more_where_it_is_costs_the_poses_after_that_and_no_others() -> None:
    body, moved = seen_by_an_arm(5)
    last = moved[6]
    found = tracked([board_in_map(), *sorted([*body, *moved[:7]], key=lambda one: one.stamp_ns)])
    known = [one for one in TRUTH if one.stamp_ns <= last.stamp_ns]
    assert [event.stamp_ns for event in found if isinstance(event, BodyPose)] == [one.stamp_ns for one in known]
    assert len(found) == len(TRUTH) > len(known)


def test_where_a_camera_was_is_remembered_until_a_recording_says_late_what_leads_to_the_board() -> None:
    """The lens is fixed to a camera that moves; that and the board's place are logged after all poses."""
    camera = {number: ScalarPose((0.02 * number, 1.0, 0.5), yawed(0.03 * number)) for number in range(-1, 3000)}
    lens = ScalarPose((0.0, 0.0, 0.02), yawed(0.5))
    measured: list[FramePose] = []
    for number, pose in camera.items():
        stamp_ns = TRUTH[0].stamp_ns + number * PERIOD_NS
        measured.append(FramePose(stamp_ns, "map", "camera", pose))
        if 0 <= number < len(TRUTH):
            seen = compose(inverse(compose(pose, lens)), compose(BOARD, TRUTH[number].pose))
            measured.append(FramePose(stamp_ns, "lens", "body_cube", seen))
    measured += [FramePose(0, "camera", "lens", lens, static=True), board_in_map()]
    assert_poses(tracked(measured, TrackerConfig("body_cube", recorded=True)), TRUTH)


def test_poses_of_a_recording_wait_for_the_transforms_of_a_moving_camera_that_were_logged_late() -> None:
    """They come out as if these had been logged in time; the other link on the way comes in time, and fast."""
    number_of, late, fast = range(3000), 1000, 8

    def rig(number: float, child: str) -> FramePose:
        pose = ScalarPose((0.01 * np.sin(0.05 * number), 1.0, 0.5), yawed(0.001 * number))
        return FramePose(int(number * PERIOD_NS), "map" if child == "arm" else "arm", child, pose)

    def logged(delay: int) -> list[FramePose]:
        arm = [(number / fast, rig(number / fast, "arm")) for number in range(-fast, fast * len(number_of) + fast)]
        camera = [(number + delay, rig(number + 0.3, "camera")) for number in range(-2, len(number_of) + 3)]
        body = [(number, FramePose(number * PERIOD_NS, "camera", "body_cube", TRUTH[0].pose)) for number in number_of]
        board = (-3.0, FramePose(0, "map", "body_surface", BOARD, static=True))
        return [one for _, one in sorted([*arm, *camera, *body, board], key=lambda timed: timed[0])]

    config = TrackerConfig("body_cube", recorded=True)
    in_time = tracked(logged(0), config)
    assert len(in_time) == len(number_of)
    assert all(isinstance(event, BodyPose) for event in in_time)
    assert tracked(logged(late), config) == in_time
    live = tracked(logged(late), TrackerConfig("body_cube"))
    whys = {event.why for event in live if isinstance(event, BadPose)}
    assert any("around its time, found them only before it: they come late" in why for why in whys)


def test_the_body_may_hang_under_a_tag_that_is_measured() -> None:
    tag_on_body = ScalarPose((0.0, 0.05, 0.0), yawed(1.0))
    static = FramePose(0, "tag_3", "body_cube", inverse(tag_on_body), static=True)
    tags = [FramePose(one.stamp_ns, "body_surface", "tag_3", compose(one.pose, tag_on_body)) for one in TRUTH]
    assert_poses(tracked([static, *tags]), TRUTH)


def test_what_comes_out_does_not_depend_on_when_the_static_board_arrives() -> None:
    body = in_map(TRUTH)
    assert tracked([*body[:20], board_in_map(), *body[20:]]) == tracked([board_in_map(), *body])
    assert tracked([*body, board_in_map()]) == tracked([board_in_map(), *body])


def test_without_a_board_every_pose_is_counted_and_says_what_is_missing() -> None:
    tracker = BodyTracker(TrackerConfig("body_cube", largest_wait=0.1))
    events = [*(event for one in in_map(TRUTH) for event in tracker.push(one)), *tracker.flush()]
    assert {type(event) for event in events} == {BadPose}
    assert tracker.counts == {"frame": len(TRUTH)}
    said = [event.why for event in events if isinstance(event, BadPose)]
    assert said[0] == (
        "board: found none within 0.1 s, expected poses that lead from frame 'body_surface' to frame 'map' at its time; "
        "frames here: none; where poses are given on the board, use --board-frame '' (of a node: board_frame:=none)"
    )
    assert "found the stream ended" in said[-1]


def test_a_hole_in_a_moving_board_loses_the_poses_in_it_and_no_others() -> None:
    config = TrackerConfig("body_cube", largest_rig_gap=2.5 * PERIOD_NS / 1e9, largest_wait=0.1)
    boards = [FramePose(one.stamp_ns, "map", "body_surface", BOARD) for one in TRUTH]
    measured = [one for pair in zip(boards[:10] + boards[13:], in_map(TRUTH)) for one in pair] + in_map(TRUTH)[37:]
    found = tracked(measured, config)
    assert [event.stamp_ns for event in found if isinstance(event, BadPose)] == [one.stamp_ns for one in TRUTH[10:13]]
    assert_poses([event for event in found if not isinstance(event, BadPose)], TRUTH[:10] + TRUTH[13:])


def test_poses_behind_one_that_waits_in_vain_are_placed_at_the_end_all_the_same() -> None:
    config = TrackerConfig("body_cube", largest_rig_gap=2.5 * PERIOD_NS / 1e9)
    boards = [FramePose(one.stamp_ns, "map", "body_surface", BOARD) for one in TRUTH]
    measured = [one for pair in zip(boards[:20] + boards[25:], in_map(TRUTH)) for one in pair] + in_map(TRUTH)[35:]
    found = tracked(measured, config)  # nothing waits for as long as `largest_wait`
    bad = [event for event in found if isinstance(event, BadPose)]
    assert [event.stamp_ns for event in bad] == [one.stamp_ns for one in TRUTH[20:25]]
    assert "expected transforms between 'body_surface' and 'map' at most 0.0168919 s apart around its time" in bad[0].why
    assert_poses([event for event in found if not isinstance(event, BadPose)], TRUTH[:20] + TRUTH[25:])


@pytest.mark.parametrize(("back", "jumps"), [(1.01, True), (0.99, False)])
def test_a_clock_that_jumps_far_back_starts_anew(back: float, jumps: bool) -> None:
    once = in_map(TRUTH)
    back_ns = int(back * 1e9)
    again = [
        FramePose(once[-1].stamp_ns - back_ns + n * PERIOD_NS, one.parent, one.child, one.pose) for n, one in enumerate(once)
    ]
    events = tracked([board_in_map(), *once, *again])
    assert [event.back for event in events if isinstance(event, ClockJump)] == ([pytest.approx(back)] if jumps else [])
    assert [event.stamp_ns for event in events if isinstance(event, BodyPose)] == [one.stamp_ns for one in (*once, *again)]


def test_a_looping_bag_with_a_moving_board_gives_the_same_poses_again() -> None:
    shift = 3_000_000_000
    both = [
        one
        for pair in zip(
            [FramePose(one.stamp_ns + shift, "map", "body_surface", BOARD) for one in TRUTH],
            [FramePose(one.stamp_ns + shift, one.parent, one.child, one.pose) for one in in_map(TRUTH)],
        )
        for one in pair
    ]
    earlier = [FramePose(one.stamp_ns - shift, one.parent, one.child, one.pose) for one in both]
    events = tracked([*both, *earlier])
    assert sum(isinstance(event, ClockJump) for event in events) == 1
    assert_poses([event for event in events[len(TRUTH) :] if not isinstance(event, ClockJump)], TRUTH)


def test_after_a_clock_jump_the_board_is_not_where_it_was_at_those_times_before() -> None:
    """The same times are played again with the board elsewhere; the body's pose comes first."""
    elsewhere = ScalarPose((2.0, 0.0, 0.0), yawed(0.3))
    late = FramePose(TRUTH[-1].stamp_ns + 2_000_000_000, "map", "body_cube", BOARD)
    measured: list[FramePose] = []
    for board in (BOARD, elsewhere):
        for one in TRUTH:
            measured.append(FramePose(one.stamp_ns, "map", "body_cube", compose(board, one.pose)))
            measured.append(FramePose(one.stamp_ns, "map", "body_surface", board))
        measured += [late, FramePose(late.stamp_ns, "map", "body_surface", BOARD)][: 2 * (board is BOARD)]
    events = [event for event in tracked(measured) if isinstance(event, BodyPose)]
    assert_poses(events[-len(TRUTH) :], TRUTH)


def test_a_bad_pose_passes_through_and_is_counted() -> None:
    tracker = BodyTracker(CONFIG)
    bad = BadPose(5, "body_cube", "quaternion norm: found 2, expected 1 within 0.001")
    assert tracker.push(bad) == (bad,)
    assert tracker.counts == {"pose": 1}


@pytest.mark.parametrize("killed_at", [0, 1, 7, 30])
def test_a_tracker_killed_anywhere_goes_on_from_its_written_state(killed_at: int) -> None:
    measured = [
        one
        for number, truth in enumerate(TRUTH)
        for one in (
            FramePose(truth.stamp_ns, "map", "body_cube", compose(moving_board(number), truth.pose)),
            FramePose(truth.stamp_ns, "map", "body_surface", moving_board(number)),
        )
    ]
    before, after = BodyTracker(CONFIG), BodyTracker(CONFIG)
    events = [event for one in measured[:killed_at] for event in before.push(one)]
    after.restore(json.loads(json.dumps(before.snapshot())))
    events += [event for one in measured[killed_at:] for event in after.push(one)]
    assert events == tracked(measured)
    assert after.counts == {"poses": len(TRUTH)}


@pytest.mark.parametrize("broken", [{}, {"links": 3}, {"links": {"a": {}}, "waiting": [], "last_ns": 0, "counts": {}}])
def test_a_state_that_is_none_is_refused(broken: dict[str, object]) -> None:
    with pytest.raises(InvalidValueError, match="tracker state: found"):
        BodyTracker(CONFIG).restore(broken)


@pytest.mark.parametrize("config", [{"body_frame": ""}, {"body_frame": "body_surface"}, {"body_frame": "b", "clock_jump": 0.0}])
def test_frames_and_times_that_make_no_sense_are_refused(config: dict[str, object]) -> None:
    with pytest.raises(InvalidValueError):
        TrackerConfig(**config)  # type: ignore[arg-type]


def test_a_body_that_two_cameras_measure_in_turn_needs_the_frames_above_both() -> None:
    tracker = BodyTracker(CONFIG)
    tracker.push(board_in_map())
    for number, camera in enumerate(("left", "right", "gripper")):
        tracker.push(FramePose(number, "map", camera, BOARD))
    needed = []
    for number, one in enumerate(in_map(TRUTH)[:6]):
        tracker.push(FramePose(one.stamp_ns, ("left", "right")[number % 2], "body_cube", one.pose))
        needed.append(tracker.needed_frames)
    assert needed[1] == {"body_cube", "body_surface", "map", "left", "right"}
    assert set(needed[1:]) == {needed[1]}  # what is stored does not change from pose to pose
