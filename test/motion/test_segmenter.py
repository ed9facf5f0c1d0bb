"""Streams are cut where the published rules say, and nothing is lost without a reason."""

import json
import re
import statistics
import time
from collections.abc import Iterable, Sequence
from dataclasses import replace
from math import cos, inf, nan, sin

import numpy as np
import pytest

from contact_curation.contact.body import Body
from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.polytopes import box
from contact_curation.geometry.scalars import ScalarPose, compose, rotate
from contact_curation.motion.body_tracker import BodyPose
from contact_curation.motion.calibration import RigCalibration
from contact_curation.motion.pose_stream import PoseRun
from contact_curation.motion.segmenter import TossSegmenter
from contact_curation.motion.segmenter_config import SegmenterConfig
from contact_curation.motion.smoothing import is_filtered, kinematics
from contact_curation.motion.toss import NANOSECONDS, Rejected, Toss
from contact_curation.motion.toss_rules import Frame
from contact_curation.motion.toss_rules import cut as rules_cut
from test.motion.streams import CUBE, PERIOD_NS, Throw, noisy, stream

Outcome = Toss | Rejected


def fresh(config: SegmenterConfig | None = None) -> TossSegmenter:
    return TossSegmenter(config or SegmenterConfig(), CUBE, source="/odom")


def pushed(segmenter: TossSegmenter, poses: Iterable[BodyPose]) -> list[Outcome]:
    return [outcome for one in poses for outcome in segmenter.push(one.stamp_ns, one.pose.position, one.pose.orientation_wxyz)]


def cut(poses: Iterable[BodyPose], config: SegmenterConfig | None = None) -> list[Outcome]:
    segmenter = fresh(config)
    return [*pushed(segmenter, poses), *segmenter.flush()]


def only(outcomes: Sequence[Outcome]) -> Outcome:
    assert len(outcomes) == 1, [outcome.reasons if isinstance(outcome, Rejected) else outcome.toss_id for outcome in outcomes]
    return outcomes[0]


def tossed(outcomes: Sequence[Outcome]) -> Toss:
    outcome = only(outcomes)
    assert isinstance(outcome, Toss), outcome.reasons
    return outcome


def reasons(outcomes: Sequence[Outcome]) -> str:
    outcome = only(outcomes)
    assert isinstance(outcome, Rejected)
    return "; ".join(outcome.reasons)


def moved(one: BodyPose, by: float) -> BodyPose:
    """The same pose, higher by so many metres."""
    x, y, z = one.pose.position
    return BodyPose(one.stamp_ns, ScalarPose((x, y, z + by), one.pose.orientation_wxyz))


def shifted(one: BodyPose, by: float) -> BodyPose:
    """The same pose, further along x by so many metres."""
    x, y, z = one.pose.position
    return BodyPose(one.stamp_ns, ScalarPose((x + by, y, z), one.pose.orientation_wxyz))


def number_of(toss: Toss, poses: Sequence[BodyPose]) -> int:
    """Which pose of the stream the toss starts with."""
    return [one.stamp_ns for one in poses].index(int(toss.stamps_ns[0]))


@pytest.mark.parametrize("rate", [100, 120, 148])
def test_a_toss_begins_in_free_fall_and_ends_with_ten_frames_of_rest(rate: int) -> None:
    throw, period_ns = Throw(carried=20), round(NANOSECONDS / rate)
    poses = stream(throw, period_ns=period_ns)
    toss = tossed(cut(poses))
    assert 0 <= number_of(toss, poses) - throw.carried <= 2
    steps = np.linalg.norm(np.diff(toss.positions, axis=0), axis=1)
    assert (steps[-9:] <= 0.3e-3).all()
    assert steps[-10] > 0.3e-3
    assert toss.frame_period == pytest.approx(period_ns / NANOSECONDS)


def test_its_poses_are_the_streams_and_its_velocities_know_the_frames_around_it() -> None:
    poses = stream()
    toss = tossed(cut(poses))
    first = number_of(toss, poses)
    whole = kinematics(
        np.array([one.stamp_ns for one in poses]),
        np.array([one.pose.position for one in poses]),
        np.array([one.pose.orientation_wxyz for one in poses]),
    )
    frames = slice(first, first + toss.frames)
    np.testing.assert_array_equal(toss.positions, [one.pose.position for one in poses][frames])
    np.testing.assert_allclose(toss.linear_velocities, whole.linear_velocities[frames], atol=1e-12)
    np.testing.assert_allclose(toss.angular_velocities, whole.angular_velocities[frames], atol=1e-9)


@pytest.mark.parametrize("early_ns", [7_800_000, 7_600_000])
def test_velocities_are_filtered_where_the_toss_s_own_frame_period_says_so(early_ns: int) -> None:
    other_ns = 15_400_000 - early_ns  # of a camera of about 130 Hz whose stamps vary: one of both is filtered
    stamps = np.cumsum([*[early_ns] * 6, *[early_ns, other_ns] * 10, other_ns])
    positions = np.random.default_rng(1).normal(size=(len(stamps), 3))
    run = [Frame(int(stamp), (x, y, z), (1.0, 0.0, 0.0, 0.0)) for stamp, (x, y, z) in zip(stamps, positions.tolist())]
    toss = rules_cut(run, 6, len(run), "cube", "/odom", SegmenterConfig()).toss
    assert toss.frame_period == pytest.approx(np.diff(toss.stamps_ns).mean() / NANOSECONDS, rel=1e-3)
    plain = np.diff(toss.positions, axis=0) / np.diff(toss.stamps_ns)[:, np.newaxis] * NANOSECONDS
    assert np.allclose(toss.linear_velocities[1:], plain) != is_filtered(toss.frame_period)


def test_a_toss_comes_out_one_frame_after_its_last() -> None:
    poses = stream()
    last = int(tossed(cut(poses)).stamps_ns[-1])
    segmenter = fresh()
    upto = [one.stamp_ns for one in poses].index(last)
    assert pushed(segmenter, poses[: upto + 1]) == []
    assert segmenter.tossing
    assert len(pushed(segmenter, poses[upto + 1 : upto + 2])) == 1
    assert not segmenter.tossing


def test_a_recording_that_ends_with_the_last_frame_of_rest_still_gives_the_toss() -> None:
    poses = stream()
    whole = tossed(cut(poses))
    upto = [one.stamp_ns for one in poses].index(int(whole.stamps_ns[-1]))
    np.testing.assert_array_equal(tossed(cut(poses[: upto + 1])).positions, whole.positions)


def test_two_throws_of_a_stream_are_two_tosses_with_ids_of_their_own() -> None:
    first = stream()
    second = stream(start_ns=first[-1].stamp_ns + PERIOD_NS)
    outcomes = cut([*first, *second])
    assert [type(outcome) for outcome in outcomes] == [Toss, Toss]
    assert len({outcome.toss_id for outcome in outcomes if isinstance(outcome, Toss)}) == 2


def test_a_missing_frame_inside_a_toss_rejects_it_and_says_where() -> None:
    poses = stream()
    toss = tossed(cut(poses))
    gone = number_of(toss, poses) + 30
    outcomes = cut(poses[:gone] + poses[gone + 1 :])
    assert "gap: found 0.01351 s before frame 30, expected at most 0.01014 s" in reasons(outcomes)
    rejected = only(outcomes)
    assert isinstance(rejected, Rejected)
    assert rejected.toss.frames == 30, "what was seen before the gap is kept"


@pytest.mark.parametrize(("stretch", "accepted"), [(1.45, True), (1.55, False)])
def test_the_largest_gap_holds_from_both_sides(stretch: float, accepted: bool) -> None:
    poses = stream()
    late = round((stretch - 1.0) * PERIOD_NS)
    delayed = [BodyPose(one.stamp_ns + (late if number > 90 else 0), one.pose) for number, one in enumerate(poses)]
    assert isinstance(only(cut(delayed)), Toss) is accepted


def test_a_gap_before_the_release_loses_nothing() -> None:
    poses = stream()
    assert tossed(cut(poses[:5] + poses[9:])).frames == tossed(cut(poses)).frames


def test_after_a_gap_in_flight_the_rest_of_the_fall_is_no_second_toss() -> None:
    high = Throw(position=(0.0, 0.0, 0.6), seen=220)
    poses = stream(high)
    start = number_of(tossed(cut(poses)), poses)
    outcomes = cut(poses[: start + 5] + poses[start + 7 :])
    assert "gap" in reasons(outcomes)


@pytest.mark.parametrize("rate", [30, 60, 240])
def test_a_stream_of_any_frame_rate_tells_its_own_period(rate: int) -> None:
    period_ns = round(NANOSECONDS / rate)
    toss = tossed(cut(stream(Throw(position=(0.0, 0.0, 0.4), carried=rate // 7 + 4, seen=2 * rate), period_ns=period_ns)))
    assert toss.frame_period == pytest.approx(1.0 / rate, rel=1e-6)


def test_bounds_so_wide_that_everything_falls_are_no_crash() -> None:
    poses = stream()
    assert "acceleration in the air" in reasons(cut(poses, SegmenterConfig(fall_tolerance=50.0, fall_mean_tolerance=50.0)))


@pytest.mark.parametrize("noise", [1.0, 5.0, 100.0])
def test_however_noisy_a_tracker_is_said_to_be_a_body_at_rest_does_not_fall(noise: float) -> None:
    resting = [BodyPose(round(k * PERIOD_NS), ScalarPose((0.0, 0.0, 0.3), (1.0, 0.0, 0.0, 0.0))) for k in range(40)]
    assert cut(resting, SegmenterConfig(tracker_noise=noise)) == []


@pytest.mark.parametrize("noise", [0.5, 0.0, -1.0, float("nan"), float("inf")])
def test_a_tracker_is_as_noisy_as_the_real_rigs_or_more(noise: float) -> None:
    with pytest.raises(InvalidValueError, match="tracker_noise: found"):
        SegmenterConfig(tracker_noise=noise)


def test_a_configured_frame_period_is_the_toss_s() -> None:
    assert tossed(cut(stream(), SegmenterConfig(frame_period=1.0 / 148.0))).frame_period == 1.0 / 148.0


def test_a_stream_of_another_rate_than_configured_is_all_gaps() -> None:
    assert cut(stream(period_ns=2 * PERIOD_NS), SegmenterConfig(frame_period=1.0 / 148.0)) == []


@pytest.mark.parametrize(("shortest", "accepted"), [(0.98, True), (1.02, False)])
def test_a_toss_shorter_than_the_shortest_is_rejected(shortest: float, accepted: bool) -> None:
    toss = tossed(cut(stream()))
    config = SegmenterConfig(shortest=shortest * toss.frames * toss.frame_period)
    outcomes = cut(stream(), config)
    if accepted:
        assert tossed(outcomes).frames == toss.frames
    else:
        assert "duration: found" in reasons(outcomes)


def test_a_toss_that_is_hardly_too_short_has_another_number_than_its_bound() -> None:
    toss = tossed(cut(stream()))
    said = reasons(cut(stream(), SegmenterConfig(shortest=toss.frames * toss.frame_period + 2e-4)))
    found, expected = re.findall(r"([0-9.]+) s", said)
    assert float(found) < float(expected)


@pytest.mark.parametrize(("height", "accepted"), [(6.9e-3, True), (7.1e-3, False), (-6.9e-3, True), (-7.1e-3, False)])
def test_a_toss_whose_lowest_corner_is_far_from_the_board_is_rejected(height: float, accepted: bool) -> None:
    outcomes = cut(moved(one, height) for one in stream())
    if accepted:
        assert isinstance(only(outcomes), Toss)
    else:
        assert "lowest corner of the toss: found" in reasons(outcomes)
        assert "expected within 7 mm of the board" in reasons(outcomes)


@pytest.mark.parametrize(("push", "accepted"), [(8.3, True), (8.7, False)])
def test_a_push_in_the_air_rejects_the_toss_and_names_the_frame(push: float, accepted: bool) -> None:
    poses = stream(Throw(velocity=(0.0, 0.0, 0.3)))
    kicked_at = number_of(tossed(cut(poses)), poses) + 8
    step = push * (PERIOD_NS / NANOSECONDS) ** 2
    outcomes = cut(shifted(one, step * min(max(0, number - kicked_at), 60)) for number, one in enumerate(poses))
    if accepted:
        assert isinstance(only(outcomes), Toss)
    else:
        assert "acceleration in the air beyond gravity: found 8.7 m/s^2 at frame 9" in reasons(outcomes)


def test_a_body_that_never_rests_is_given_up_at_the_cap() -> None:
    restless = [
        BodyPose(one.stamp_ns, ScalarPose((number * 1e-3, 0.0, one.pose.position[2]), one.pose.orientation_wxyz))
        for number, one in enumerate(stream(Throw(seen=400)))
    ]
    said = reasons(cut(restless, SegmenterConfig(most_frames=200)))
    assert "frames: found 201 without rest, expected rest within 200" in said


def test_a_stream_that_ends_in_flight_gives_what_it_saw_as_rejected() -> None:
    poses = stream()
    assert "end of the stream, expected the body at rest" in reasons(cut(poses[:40]))


def test_a_body_held_still_but_not_flat_is_not_at_rest() -> None:
    poses = stream()
    tilt = (float(np.cos(0.05)), float(np.sin(0.05)), 0.0, 0.0)
    tilted = [BodyPose(one.stamp_ns, ScalarPose(one.pose.position, tilt)) for one in poses]
    config = SegmenterConfig(lowest_corner=0.02)
    assert "expected the body at rest" in reasons(cut(tilted, config))
    assert isinstance(only(cut(tilted, replace(config, flat_tolerance=0.02))), Toss)


def caught(held: float, falls: int = 15, carried: int = Throw.carried) -> list[BodyPose]:
    """A body that is caught in mid-air, held for some seconds, and thrown again."""
    first = stream(Throw(position=(0.1, 0.2, 0.6), seen=falls))
    askew = compose(first[-1].pose, ScalarPose((0.0, 0.0, 0.0), (cos(0.3), sin(0.3), 0.0, 0.0)))
    still = [BodyPose(first[-1].stamp_ns + number * PERIOD_NS, askew) for number in range(1, round(held * 148))]
    return [*first, *still, *stream(Throw(carried=carried), still[-1].stamp_ns + PERIOD_NS)]


@pytest.mark.parametrize("falls", range(12, 30))
def test_a_body_that_is_caught_ends_its_motion_and_the_next_throw_is_a_toss(falls: int) -> None:
    poses = caught(0.6, falls)
    ended = cut(poses)
    assert [type(outcome) for outcome in ended] == [Rejected, Toss]
    assert reasons(ended[:1]).startswith("caught: found the body held for 0.3 s in the air")
    run = PoseRun(
        np.array([one.stamp_ns for one in poses]),
        np.array([one.pose.position for one in poses]),
        np.array([one.pose.orientation_wxyz for one in poses]),
    )
    segmenter = fresh()
    at_once = [*segmenter.push_run(run), *segmenter.flush()]
    assert [toss_of(one).digest() for one in at_once] == [toss_of(one).digest() for one in ended]


@pytest.mark.parametrize("held", [0.42, 0.46, 0.5])
def test_a_throw_soon_after_a_catch_is_another_motion(held: float) -> None:
    ended = cut(caught(held, carried=0))
    assert [type(outcome) for outcome in ended] == [Rejected, Toss]


def test_a_body_is_looked_at_for_some_frames_before_it_counts_as_held() -> None:
    """Of a settling time that is shorter than a frame period."""
    ended = cut(caught(0.6), SegmenterConfig(settle_time=0.001))
    assert [type(outcome) for outcome in ended] == [Rejected, Toss]


def test_noise_at_rest_does_not_put_off_the_next_throw() -> None:
    period = NANOSECONDS // 240
    poses = stream(Throw(carried=0, seen=600), period_ns=period)
    poses += stream(Throw(position=(0.1, 0.2, 0.3), carried=0, seen=300), poses[-1].stamp_ns + period, period)
    big = replace(CUBE, vertices=2.5 * CUBE.vertices)
    raised = [moved(one, 1.5 * CUBE.length_scale) for one in poses]
    for seed in range(8):
        segmenter = TossSegmenter(SegmenterConfig(tracker_noise=14.0), big, source="/odom")
        ended = [*pushed(segmenter, noisy(raised, 14.0, seed)), *segmenter.flush()]
        assert len(ended) == 2, (seed, [toss_of(one).toss_id for one in ended])


def test_a_long_fall_is_not_held() -> None:
    poses = stream(Throw(position=(0.1, 0.2, 2.5), velocity=(0.9, 0.3, 2.0), seen=300))
    assert isinstance(only(cut(poses)), Toss)


def toss_of(outcome: Outcome) -> Toss:
    return outcome.toss if isinstance(outcome, Rejected) else outcome


def test_on_a_board_that_is_known_to_be_tilted_a_toss_is_cut_as_on_a_level_one() -> None:
    turn = (float(np.cos(0.04)), float(np.sin(0.04)), 0.0, 0.0)
    tilted = [BodyPose(one.stamp_ns, compose(ScalarPose((0.0, 0.0, 0.0), turn), one.pose)) for one in stream()]
    rig = RigCalibration(rotate(turn, (0.0, 0.0, 1.0)))
    segmenter = TossSegmenter(SegmenterConfig(), CUBE, source="/odom", rig=rig)
    toss, level = tossed([*pushed(segmenter, tilted), *segmenter.flush()]), tossed(cut(stream()))
    np.testing.assert_array_equal(toss.stamps_ns, level.stamps_ns)


def test_the_rest_height_of_contactnets_is_an_option() -> None:
    assert "expected the body at rest" in reasons(cut(stream(), SegmenterConfig(rest_height=0.0524)))
    assert isinstance(only(cut(stream(), SegmenterConfig(rest_height=0.0525))), Toss)


def test_a_brick_may_rest_on_any_of_its_faces() -> None:
    brick = Body("brick", box([0.0524, 0.08, 0.02]).vertices, 0.37, np.array([8.4e-4, 3.9e-4, 1.13e-3]), 0.18, 0.05)
    upright = ScalarPose((0.0, 0.0, 0.0), (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0))
    segmenter = TossSegmenter(SegmenterConfig(), brick, source="/odom")
    standing = [
        BodyPose(one.stamp_ns, ScalarPose(moved(one, 0.08 - 0.0524).pose.position, upright.orientation_wxyz))
        for one in stream()
    ]
    assert isinstance(only([*pushed(segmenter, standing), *segmenter.flush()]), Toss)


def test_a_body_carried_about_is_no_toss() -> None:
    path = [(0.3 * np.sin(0.02 * number), 0.0, 0.2 + 0.1 * np.cos(0.05 * number)) for number in range(600)]
    swing = [BodyPose(number * PERIOD_NS, ScalarPose(place, (1.0, 0.0, 0.0, 0.0))) for number, place in enumerate(path)]
    assert cut(swing) == []


def test_a_drop_from_under_the_release_clearance_is_no_toss() -> None:
    low = Throw(position=(0.0, 0.0, 0.0524 + 0.010), velocity=(0.9, 0.3, 0.0))
    assert cut(stream(low)) == []


@pytest.mark.parametrize(("height", "starts"), [(0.034, True), (0.032, False)])
def test_every_corner_must_be_clear_of_the_board_in_both_first_frames(height: float, starts: bool) -> None:
    """The frames that are seen to fall come two and three after the release; thrown from 32 mm the second is under 10 mm."""
    thrown_down = Throw(position=(0.0, 0.0, 0.0524 + height), velocity=(0.9, 0.3, -1.0))
    assert bool(cut(stream(thrown_down))) is starts


def test_an_earlier_gap_does_not_hide_a_missing_frame() -> None:
    poses = stream()
    late = [BodyPose(one.stamp_ns + (NANOSECONDS if number > 15 else 0), one.pose) for number, one in enumerate(poses)]
    assert "gap: found 0.01351 s" in reasons(cut(late[:26] + late[27:]))


def test_orientations_of_a_raw_tracker_can_be_filtered_before_anything_else() -> None:
    poses = stream()
    outlier = ScalarPose(poses[60].pose.position, (0.9987503, 0.0499792, 0.0, 0.0))
    disturbed = [*poses[:60], BodyPose(poses[60].stamp_ns, outlier), *poses[61:]]
    raw, clean = tossed(cut(disturbed)), tossed(cut(poses))
    filtered = tossed(cut(disturbed, SegmenterConfig(filter_orientations=True)))
    frame = 60 - number_of(clean, poses)
    assert quaternions.angle_between(raw.orientations_wxyz[frame], clean.orientations_wxyz[frame]) > 0.09
    assert quaternions.angle_between(filtered.orientations_wxyz[frame], clean.orientations_wxyz[frame]) < 0.01


def test_inside_a_region_a_toss_needs_the_body_to_have_been_outside_before() -> None:
    poses = stream(Throw(carried=60))
    entered = SegmenterConfig(region_x=(-0.1, inf))
    assert isinstance(only(cut(poses, entered)), Toss)
    always_inside = SegmenterConfig(region_x=(-5.0, inf))
    assert cut(poses, always_inside) == []
    released_outside = SegmenterConfig(region_y=(-inf, 0.1))
    assert cut(poses, released_outside) == []


def test_a_clock_that_jumps_back_ends_the_run_and_the_next_toss_counts() -> None:
    segmenter = fresh()
    first = pushed(segmenter, stream()[:60])
    broken = segmenter.reset("clock: found a jump back by 3.000 s, expected stamps that go on")
    assert first == []
    assert "clock: found a jump back" in reasons(broken)
    assert isinstance(only(pushed(segmenter, stream(start_ns=0))), Toss)


def test_stamps_that_do_not_go_on_are_refused() -> None:
    segmenter = fresh()
    pose = stream()[0].pose
    segmenter.push(100, pose.position, pose.orientation_wxyz)
    with pytest.raises(InvalidValueError, match="stamp of a pose: found 100 ns, expected one after 100 ns"):
        segmenter.push(100, pose.position, pose.orientation_wxyz)


@pytest.mark.parametrize("killed_at", [3, 21, 24, 60, 107, 108, 109, 110, 111, 115, 169])
def test_a_segmenter_killed_at_any_frame_goes_on_from_its_written_state(killed_at: int) -> None:
    poses = stream()
    undisturbed = cut(poses)
    before = fresh()
    outcomes = pushed(before, poses[:killed_at])
    after = fresh()
    after.restore(json.loads(json.dumps(before.snapshot())))
    outcomes += [*pushed(after, poses[killed_at:]), *after.flush()]
    assert tossed(outcomes).digest() == tossed(undisturbed).digest()


@pytest.mark.parametrize("broken", [{}, {"run": [[1, 2]]}, {"run": 5}])
def test_a_state_that_is_none_is_refused(broken: dict[str, object]) -> None:
    with pytest.raises(InvalidValueError, match=r"segmenter state: found .* expected what TossSegmenter\.snapshot gave"):
        fresh().restore(broken)


@pytest.mark.parametrize(
    "changed", [{"gravity": 0.0}, {"shortest": -1.0}, {"region_x": (1.0, 0.0)}, {"largest_gap": nan}, {"frame_period": 0.0}]
)
def test_rules_that_make_no_sense_are_refused(changed: dict[str, object]) -> None:
    with pytest.raises(InvalidValueError, match=next(iter(changed))):
        replace(SegmenterConfig(), **changed)  # type: ignore[arg-type]


def test_a_frame_costs_less_than_a_hundredth_of_its_period() -> None:
    segmenter = fresh()
    costs = []
    for one in stream(Throw(seen=1500)):
        before = time.perf_counter()
        segmenter.push(one.stamp_ns, one.pose.position, one.pose.orientation_wxyz)
        costs.append(time.perf_counter() - before)
    assert statistics.median(costs) < 0.01 * PERIOD_NS / NANOSECONDS
