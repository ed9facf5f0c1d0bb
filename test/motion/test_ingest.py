"""From measured poses to tosses that may be scored, in one go."""

import json

import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.scalars import ScalarPose
from contact_curation.motion.body_tracker import TrackerConfig
from contact_curation.motion.gates import GateConfig
from contact_curation.motion.ingest import IngestConfig, IngestEvent, TossIngest
from contact_curation.motion.pose_stream import BadPose, FramePose
from contact_curation.motion.toss import Rejected, Toss
from test.motion.streams import CUBE, Throw, board_in_map, in_map, noisy, stream

CONFIG = IngestConfig(TrackerConfig("body_cube"))
MEASURED = [board_in_map(), *in_map(stream()), *in_map(stream(start_ns=9_000_000_000))]


def fresh(config: IngestConfig = CONFIG) -> TossIngest:
    return TossIngest(config, CUBE, body="cube", source="/odom")


def ingested(measured: list[FramePose], ingest: TossIngest) -> list[IngestEvent]:
    return [*(event for one in measured for event in ingest.push(one)), *ingest.flush()]


def test_two_throws_in_a_map_are_two_tosses_on_the_board() -> None:
    ingest = fresh()
    events = ingested(MEASURED, ingest)
    assert [type(event) for event in events] == [Toss, Toss]
    assert ingest.counts == {"poses": len(MEASURED) - 1, "tosses": 2}
    (first, _) = (event for event in events if isinstance(event, Toss))
    assert abs(first.positions[-1, 2] - 0.0524) < 1e-6


def spiked(measured: list[FramePose], at: int) -> list[FramePose]:
    one = measured[at]
    x, y, z = one.pose.position
    moved = ScalarPose((x + 0.005, y, z), one.pose.orientation_wxyz)
    return [*measured[:at], FramePose(one.stamp_ns, one.parent, one.child, moved), *measured[at + 1 :]]


def test_a_glitch_of_the_tracker_on_the_board_is_kept_back_with_its_reason_and_with_its_toss() -> None:
    ingest = fresh()
    first, second = ingested(spiked(MEASURED, 80), ingest)
    assert isinstance(first, Rejected)
    assert any(line.startswith("displacement beside the velocity") for line in first.reasons)
    assert isinstance(second, Toss)
    assert ingest.counts == {"poses": len(MEASURED) - 1, "tosses": 1, "rejected": 1}


def test_without_gates_the_glitch_passes() -> None:
    config = IngestConfig(CONFIG.tracker, gates=GateConfig(enabled=False))
    assert [type(event) for event in ingested(spiked(MEASURED, 80), fresh(config))] == [Toss, Toss]


@pytest.mark.parametrize(("rate", "multiple"), [(60, 10.0), (148, 3.0), (148, 5.0), (240, 5.0)])
def test_a_noisier_tracker_loses_its_toss_until_it_is_told_of(rate: int, multiple: float) -> None:
    period_ns = 10**9 // rate
    throw = Throw(carried=rate // 7 + 4, seen=rate)
    measured = [board_in_map(), *in_map(noisy(stream(throw, period_ns=period_ns), multiple))]
    assert not any(isinstance(event, Toss) for event in ingested(measured, fresh()))
    (toss,) = ingested(measured, fresh(CONFIG.of_tracker(multiple)))
    assert isinstance(toss, Toss)


def test_what_a_noisier_tracker_glitches_is_still_seen() -> None:
    measured = [board_in_map(), *in_map(noisy(stream(), 3.0))]
    (kept_back,) = ingested(spiked(measured, 80), fresh(CONFIG.of_tracker(3.0)))
    assert isinstance(kept_back, Rejected)
    assert any(line.startswith("displacement beside the velocity") for line in kept_back.reasons)


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
