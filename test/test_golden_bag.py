"""The golden bag is what its generator makes, and the tosses in it come out as golden.json says."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bags import make_golden
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.body_tracker import TrackerConfig
from contact_curation.motion.ingest import IngestConfig, TossIngest
from contact_curation.motion.pose_stream import BadPose, FramePose, checked_pose
from contact_curation.motion.toss import NANOSECONDS, Rejected, Toss
from contact_curation.storage.bags.reader import BagReader
from test.simulated import FRAME_PERIOD, release_states

BAGS = Path(make_golden.__file__).parent
MEGABYTE = 1_000_000

REASONS = {"spike": "displacement beside the velocity", "gap": "gap", "drift": "lowest corner of the toss"}


@pytest.fixture(scope="module")
def contents() -> dict[str, Any]:
    return dict(json.loads((BAGS / "golden.json").read_text()))


@pytest.fixture(scope="module")
def outcomes() -> list[Toss | Rejected]:
    """What the whole way from messages to tosses makes of the bag."""
    tracker = TrackerConfig(body_frame=make_golden.BODY_FRAME, board_frame=make_golden.BOARD_FRAME)
    ingest = TossIngest(IngestConfig(tracker), CONTACTNETS_CUBE, source=make_golden.TOPIC)
    events = [event for measured in measurements(BAGS / "golden.mcap") for event in ingest.push(measured)]
    events += ingest.flush()
    assert not any(isinstance(event, BadPose) for event in events)
    return [event for event in events if not isinstance(event, BadPose)]


def test_the_bag_is_small() -> None:
    assert (BAGS / "golden.mcap").stat().st_size < MEGABYTE


def test_making_it_twice_gives_the_same_bytes(tmp_path: Path) -> None:
    folders = [tmp_path / "first", tmp_path / "second"]
    for folder in folders:
        folder.mkdir()
        make_golden.make(folder)
    for name in ("golden.mcap", "golden.json"):
        assert (folders[0] / name).read_bytes() == (folders[1] / name).read_bytes()


def test_the_bag_is_the_session_that_its_generator_makes(contents: dict[str, Any]) -> None:
    recorded = make_golden.session()
    assert contents == json.loads(json.dumps(make_golden.contents(recorded)))
    board, *moving = measurements(BAGS / "golden.mcap")
    assert board.static
    assert {measured.parent for measured in (board, *moving)} == {contents["map_frame"]}
    assert [measured.stamp_ns for measured in moving] == recorded.stamps_ns.tolist()
    stored = np.array([[*measured.pose.position, *measured.pose.orientation_wxyz] for measured in moving])
    np.testing.assert_allclose(stored, make_golden.in_map(recorded.poses), atol=1e-6)


def test_the_segmenter_and_the_gates_find_each_toss_and_reject_the_faults(
    contents: dict[str, Any], outcomes: list[Toss | Rejected]
) -> None:
    planned = contents["tosses"]
    assert len(outcomes) == len(planned) == 24
    for outcome, plan in zip(outcomes, planned, strict=True):
        if plan["fault"]:
            assert isinstance(outcome, Rejected)
            assert len(outcome.reasons) == 1
            assert outcome.reasons[0].startswith(REASONS[plan["fault"]])
        else:
            assert isinstance(outcome, Toss), outcome.reasons
            frame_ns = contents["frame_period"] * NANOSECONDS
            assert 0 <= outcome.stamps_ns[0] - plan["release_stamp_ns"] < 1.5 * frame_ns
            assert -10.0 * frame_ns < outcome.stamps_ns[-1] - plan["end_stamp_ns"] <= 0


def test_the_tosses_are_in_the_boards_frame_again(outcomes: list[Toss | Rejected]) -> None:
    recorded = make_golden.session()
    for toss in (outcome for outcome in outcomes if isinstance(outcome, Toss)):
        first = int(np.searchsorted(recorded.stamps_ns, toss.stamps_ns[0]))
        poses = recorded.poses[first : first + toss.frames]
        np.testing.assert_allclose(toss.positions, poses[:, :3], atol=1e-6)
        assert quaternions.angle_between(toss.orientations_wxyz, poses[:, 3:]).max() < 1e-6


def test_the_hand_never_lets_the_body_fall_or_pushes_it_into_the_board() -> None:
    rng = np.random.default_rng(0)
    lying = np.array([0.1, -0.2, CONTACTNETS_CUBE.length_scale, 1.0, *np.zeros(9)])
    for release in release_states(20, rng):
        hand = make_golden.carried(lying, release)
        poses = np.concatenate([hand, release[None]])
        rates = np.diff(poses[:, :3], axis=0) / FRAME_PERIOD
        upward = np.diff(rates[:, 2]) / FRAME_PERIOD
        assert upward.min() > -0.6 * CONTACTNETS_CUBE.gravity
        assert lowest(poses).min() > -1e-9
        np.testing.assert_allclose(rates[-1], release[7:10], atol=0.02)
        turns = quaternions.log(quaternions.multiply(quaternions.conjugate(poses[:-1, 3:7]), poses[1:, 3:7]))
        np.testing.assert_allclose(turns[-1] / FRAME_PERIOD, release[10:], atol=0.4)
        assert np.linalg.norm(np.diff(turns, axis=0), axis=1).max() < 2e-2


def lowest(states: Array) -> Array:
    return np.asarray(CONTACTNETS_CUBE.polytope.corner_heights(states[:, :3], states[:, 3:7]).min(axis=1))


def measurements(bag: Path) -> Iterator[FramePose]:
    """Every pose in the bag, in order of log time."""
    with BagReader(bag) as reader:
        for message in reader.messages():
            for one in message.message.transforms if message.topic == "/tf_static" else [message.message]:
                measured = transform_of(one) if message.topic == "/tf_static" else odometry_of(one)
                assert isinstance(measured, FramePose)
                yield measured


def transform_of(stamped: Any) -> FramePose | BadPose:
    place, turn = stamped.transform.translation, stamped.transform.rotation
    position, orientation = (place.x, place.y, place.z), (turn.w, turn.x, turn.y, turn.z)
    return checked_pose(stamp_of(stamped), stamped.header.frame_id, stamped.child_frame_id, position, orientation, static=True)


def odometry_of(message: Any) -> FramePose | BadPose:
    place, turn = message.pose.pose.position, message.pose.pose.orientation
    position, orientation = (place.x, place.y, place.z), (turn.w, turn.x, turn.y, turn.z)
    return checked_pose(stamp_of(message), message.header.frame_id, message.child_frame_id, position, orientation)


def stamp_of(message: Any) -> int:
    return int(message.header.stamp.sec * NANOSECONDS + message.header.stamp.nanosec)
