"""From measured poses to tosses that may be scored, in one go."""

import json
from dataclasses import replace

import numpy as np
import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.scalars import IDENTITY, ScalarPose, compose, inverse
from contact_curation.motion.body_tracker import BodyPose, TrackerConfig
from contact_curation.motion.calibration import RigCalibration
from contact_curation.motion.gate_config import GateConfig
from contact_curation.motion.ingest import IngestConfig, IngestEvent, TossIngest
from contact_curation.motion.pose_noise import RIG
from contact_curation.motion.pose_stream import BadPose, FramePose
from contact_curation.motion.segmenter_config import SegmenterConfig
from contact_curation.motion.toss import Rejected, Toss
from test.motion.streams import CUBE, Throw, board_in_map, in_map, noisy, stream

CONFIG = IngestConfig(TrackerConfig("body_cube"))
MEASURED = [board_in_map(), *in_map(stream()), *in_map(stream(start_ns=9_000_000_000))]


def fresh(config: IngestConfig = CONFIG) -> TossIngest:
    return TossIngest(config, CUBE, source="/odom")


def ingested(measured: list[FramePose], ingest: TossIngest) -> list[IngestEvent]:
    return [*(event for one in measured for event in ingest.push(one)), *ingest.flush()]


def test_two_throws_in_a_map_are_two_tosses_on_the_board() -> None:
    ingest = fresh()
    events = ingested(MEASURED, ingest)
    assert [type(event) for event in events] == [Toss, Toss]
    assert ingest.counts == {"poses": len(MEASURED) - 1, "tosses": 2}
    (first, _) = (event for event in events if isinstance(event, Toss))
    assert abs(first.positions[-1, 2] - 0.0524) < 1e-6


def with_outliers(measured: list[FramePose], at: int) -> list[FramePose]:
    one = measured[at]
    x, y, z = one.pose.position
    moved = ScalarPose((x + 0.005, y, z), one.pose.orientation_wxyz)
    return [*measured[:at], FramePose(one.stamp_ns, one.parent, one.child, moved), *measured[at + 1 :]]


def test_an_outlier_of_the_tracker_on_the_board_is_rejected_with_its_reason_and_with_its_toss() -> None:
    ingest = fresh()
    first, second = ingested(with_outliers(MEASURED, 80), ingest)
    assert isinstance(first, Rejected)
    assert any(line.startswith("displacement beside the velocity") for line in first.reasons)
    assert isinstance(second, Toss)
    assert ingest.counts == {"poses": len(MEASURED) - 1, "tosses": 1, "rejected": 1}


def test_a_toss_is_heard_of_before_the_gates_have_judged_it() -> None:
    heard = list[Toss]()
    first, second = ingested(with_outliers(MEASURED, 80), TossIngest(CONFIG, CUBE, source="/odom", complete=heard.append))
    assert isinstance(first, Rejected)
    assert isinstance(second, Toss)
    assert [toss.digest() for toss in heard] == [first.toss.digest(), second.digest()]


def test_without_gates_the_outlier_passes() -> None:
    config = IngestConfig(CONFIG.tracker, gates=GateConfig(enabled=False))
    assert [type(event) for event in ingested(with_outliers(MEASURED, 80), fresh(config))] == [Toss, Toss]


def told(noise: float) -> IngestConfig:
    return IngestConfig(CONFIG.tracker, SegmenterConfig(tracker_noise=noise))


def held_and_dropped(rate: int) -> list[BodyPose]:
    """Two seconds in the hand, then let go."""
    flown = stream(
        Throw(position=(0.1, 0.2, 0.5), velocity=(0.0, 0.0, 0.0), spin=0.0, carried=0, seen=rate),
        start_ns=2 * 10**9,
        period_ns=10**9 // rate,
    )
    held = [BodyPose(flown[0].stamp_ns - k * 10**9 // rate, flown[0].pose) for k in range(2 * rate - 2, 0, -1)]
    return [*held, *flown]


@pytest.mark.parametrize(("rate", "multiple"), [(60, 6.0), (60, 24.0), (148, 3.0), (148, 12.0), (240, 12.0)])
def test_a_noisier_tracker_loses_its_toss_until_it_is_told_of_or_measured(rate: int, multiple: float) -> None:
    poses = held_and_dropped(rate)
    measured = [board_in_map(), *in_map(noisy(poses, multiple))]
    assert not any(isinstance(event, Toss) for event in ingested(measured, fresh(told(1.0))))
    (toss,) = ingested(measured, fresh(told(multiple)))
    assert isinstance(toss, Toss)
    assert -0.05e9 < toss.stamps_ns[0] - 2e9 < 0.06e9
    by_itself = fresh()
    (found,) = ingested(measured, by_itself)
    assert isinstance(found, Toss)
    assert -0.05e9 < found.stamps_ns[0] - 2e9 < 0.06e9
    assert by_itself.noise_done.startswith("positions that scatter by ")
    assert by_itself.noise_warning() == ""


def test_a_motion_that_noise_began_before_it_was_known_is_looked_at_again() -> None:
    """Noise of 6 times the rig's looks like free fall in the first second."""
    measured = [board_in_map(), *in_map(noisy(held_and_dropped(240), 6.0, seed=1))]
    ingest = fresh()
    tossing = []
    events: list[IngestEvent] = []
    for one in measured:
        events += ingest.push(one)
        tossing.append(ingest.tossing)
    assert any(tossing[:240])
    (toss,) = [*events, *ingest.flush()]
    assert isinstance(toss, Toss)
    assert toss.stamps_ns[0] > 1.9e9


def test_what_a_tracker_with_faults_does_never_widens_the_bounds() -> None:
    """Bursts of 5 mm, drift and outliers: bounds stay those for ContactNets' rig, and the toss is rejected."""
    clean, rng = noisy(held_and_dropped(148), 1.0), np.random.default_rng(0)
    offsets = {
        "bursts": 0.005 * (rng.random(len(clean)) < 0.02).repeat(5)[: len(clean)],
        "drift": np.linspace(0.0, 0.03, len(clean)),
        "outliers": 0.005 * (rng.random(len(clean)) < 0.05),
    }
    for offset in offsets.values():
        ingest = fresh()
        for one, off in zip(clean, offset.tolist(), strict=True):
            x, y, z = one.pose.position
            ingest.push(in_map([BodyPose(one.stamp_ns, ScalarPose((x, y + off, z + off), one.pose.orientation_wxyz))])[0])
        ingest.flush()
        assert ingest.noise.scale == RIG
        assert ingest.noise_done == ""


@pytest.mark.parametrize("multiple", [1.0, 5.0, 8.0])
def test_a_noisier_trackers_toss_ends_where_the_body_lies_and_not_where_it_slides(multiple: float) -> None:
    poses = stream()
    (toss,) = ingested([board_in_map(), *in_map(noisy(poses, multiple))], fresh(told(multiple)))
    assert isinstance(toss, Toss)
    last = next(one for one in poses if one.stamp_ns == toss.stamps_ns[-1])
    assert np.linalg.norm(np.subtract(last.pose.position, poses[-1].pose.position)) < 1e-3


def test_a_noisier_trackers_board_is_still_seen_to_lie_elsewhere() -> None:
    lifted = [
        BodyPose(one.stamp_ns, ScalarPose((x, y, z + 0.005), one.pose.orientation_wxyz))
        for one in held_and_dropped(148)
        for x, y, z in [one.pose.position]
    ]
    (rejected,) = ingested([board_in_map(), *in_map(noisy(lifted, 5.0))], fresh(told(5.0)))
    assert isinstance(rejected, Rejected)
    assert any(line.startswith("height at rest") for line in rejected.reasons)


@pytest.mark.parametrize("multiple", [3.0, 12.0, 24.0])
def test_what_a_noisier_tracker_gets_wrong_is_still_seen(multiple: float) -> None:
    measured = [board_in_map(), *in_map(noisy(stream(), multiple))]
    (rejected,) = ingested(with_outliers(measured, 80), fresh(told(multiple)))
    assert isinstance(rejected, Rejected)
    assert any(line.startswith("displacement beside the velocity") for line in rejected.reasons)


def test_a_gap_that_the_segmenter_takes_is_taken_by_the_gates() -> None:
    lost = [*MEASURED[:60], *MEASURED[61:171]]
    for largest_gap, kind in ((1.5, Rejected), (2.5, Toss)):
        (event,) = ingested(lost, fresh(IngestConfig(CONFIG.tracker, SegmenterConfig(largest_gap=largest_gap))))
        assert isinstance(event, kind)


def test_a_pose_that_is_none_makes_a_gap_and_no_toss() -> None:
    ingest = fresh()
    events: list[IngestEvent] = []
    for number, one in enumerate(MEASURED[:171]):
        events += ingest.push(BadPose(one.stamp_ns, "body_cube", "pose: found nan") if number == 50 else one)
    assert [type(event) for event in events] == [BadPose, Rejected]
    assert ingest.counts["pose"] == 1


def test_a_bag_that_loops_in_flight_rejects_the_toss_and_goes_on() -> None:
    late = in_map(stream(start_ns=60_000_000_000))
    events = ingested([board_in_map(), *late[:60], *MEASURED], fresh())
    assert isinstance(events[0], Rejected)
    assert events[0].reasons[0].startswith("clock: found a jump back by 55.")
    assert [type(event) for event in events[1:]] == [Toss, Toss]


@pytest.mark.parametrize("killed_at", [1, 100, 250, 420])
def test_an_ingest_of_a_noisy_tracker_killed_anywhere_goes_on_with_the_bounds_it_had(killed_at: int) -> None:
    measured = [board_in_map(), *in_map(noisy(held_and_dropped(148), 4.0))]
    before, after = fresh(), fresh()
    events = [event for one in measured[:killed_at] for event in before.push(one)]
    after.restore(json.loads(json.dumps(before.snapshot())))
    events += ingested(measured[killed_at:], after)
    whole = fresh()
    expected = ingested(measured, whole)
    assert [event.digest() for event in events if isinstance(event, Toss)] == [
        event.digest() for event in expected if isinstance(event, Toss)
    ]
    assert len(expected) == 1
    assert after.noise_done == whole.noise_done != ""


@pytest.mark.parametrize("killed_at", [1, 22, 60, 180, 260])
def test_an_ingest_killed_anywhere_goes_on_from_its_written_state(killed_at: int) -> None:
    before, after = fresh(), fresh()
    events = [event for one in MEASURED[:killed_at] for event in before.push(one)]
    after.restore(json.loads(json.dumps(before.snapshot())))
    assert after.tossing is before.tossing
    events += ingested(MEASURED[killed_at:], after)
    expected = ingested(MEASURED, fresh())
    assert [event.digest() for event in events if isinstance(event, Toss)] == [
        event.digest() for event in expected if isinstance(event, Toss)
    ]
    assert after.counts == {"poses": len(MEASURED) - 1, "tosses": 2}


def test_a_state_that_is_none_is_refused() -> None:
    with pytest.raises(InvalidValueError, match="ingest state: found"):
        fresh().restore({"tracker": {}})


def test_a_throw_that_leaves_the_view_is_rejected_at_the_end() -> None:
    (event,) = ingested([board_in_map(), *in_map(stream(Throw(seen=30)))], fresh())
    assert isinstance(event, Rejected)


def test_a_toss_is_expected_with_its_last_pose_and_comes_with_the_next_one() -> None:
    rig = RigCalibration(normal=(0.004, -0.008, 1.0), centre=(0.2, 0.1, 0.0), scale=1.01)
    ingest, expected, came = fresh(IngestConfig(CONFIG.tracker, rig=rig)), list[Toss](), 0
    assert ingest.expected() is None
    for one in MEASURED:
        events = ingest.push(one)
        assert bool(events) == (len(expected) > came)  # one pose later, and never without
        for toss in events:
            assert isinstance(toss, Toss)
            ahead = expected[came]
            came += 1
            assert ahead.toss_id == toss.toss_id
            assert ahead.frame_period == toss.frame_period
            for name in ("stamps_ns", "positions", "orientations_wxyz"):
                assert getattr(ahead, name).tobytes() == getattr(toss, name).tobytes()
            for name in ("linear_velocities", "angular_velocities"):
                assert getattr(ahead, name)[:-1].tobytes() == getattr(toss, name)[:-1].tobytes()
        if (next_one := ingest.expected()) is not None:
            expected.append(next_one)
    assert came == len(expected) == 2


def test_a_toss_nears_its_end_once_before_it_is_expected() -> None:
    ingest, seen = fresh(), list[Toss | str]()
    for one in MEASURED:
        ingest.push(one)
        seen += [each for each in (ingest.nearing_end(), ingest.expected()) if each is not None]
    for near, ahead in (seen[:2], seen[2:]):
        assert isinstance(near, Toss)
        assert isinstance(ahead, Toss)
        assert near.frames == ahead.frames - 5
        assert near.toss_id == ahead.toss_id
        assert near.linear_velocities[:-1].tobytes() == ahead.linear_velocities[: near.frames - 1].tobytes()


def test_a_marker_beside_the_body_leaves_the_velocities_of_its_centre_of_mass() -> None:
    beside, turned = (0.03, -0.02, 0.04), (0.2, 0.0, 1.5)
    rig = RigCalibration(marker_turn=turned, marker_offset=beside, scale=1.02)
    marker = inverse(rig.marker)
    marked = [
        replace(one, pose=compose(one.pose, marker)) if one.child == CONFIG.tracker.body_frame else one for one in MEASURED
    ]
    seen = ingested(marked, fresh(replace(CONFIG, rig=rig)))
    level = ingested(MEASURED, fresh(replace(CONFIG, rig=rig.without_marker)))
    assert [type(one) for one in seen] == [type(one) for one in level]
    for one, other in zip(map(toss_of, seen), map(toss_of, level), strict=True):
        np.testing.assert_allclose(one.positions, other.positions, atol=1e-9)
        np.testing.assert_allclose(one.linear_velocities, other.linear_velocities, atol=1e-7)
        np.testing.assert_allclose(one.angular_velocities, other.angular_velocities, atol=1e-6)


def test_a_centre_of_mass_is_described_in_true_metres_whatever_the_length_scale() -> None:
    beside, rig = (0.03, -0.02, 0.04), RigCalibration(scale=1.02)
    x, y, z = beside
    tracked = inverse(ScalarPose((x / rig.scale, y / rig.scale, z / rig.scale), IDENTITY.orientation_wxyz))
    moved = [
        replace(one, pose=compose(one.pose, tracked)) if one.child == CONFIG.tracker.body_frame else one for one in MEASURED
    ]
    described = replace(CONFIG.tracker, center_of_mass=beside)
    seen = ingested(moved, fresh(replace(CONFIG, tracker=described, rig=rig)))
    central = ingested(MEASURED, fresh(replace(CONFIG, rig=rig)))
    for one, other in zip(map(toss_of, seen), map(toss_of, central), strict=True):
        np.testing.assert_allclose(one.positions, other.positions, atol=1e-9)


def toss_of(event: IngestEvent) -> Toss:
    assert not isinstance(event, BadPose)
    return event.toss if isinstance(event, Rejected) else event
