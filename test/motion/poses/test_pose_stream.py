"""A measurement that is no pose is kept apart with its reason, never repaired; a state that is none is refused."""

import json
from collections.abc import Iterator
from math import inf, nan
from typing import Any

import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.scalars import ScalarPose
from contact_curation.motion.body_tracker import BodyTracker, TrackerConfig
from contact_curation.motion.even_stamps import StampEvener
from contact_curation.motion.ingest import IngestConfig, TossIngest
from contact_curation.motion.pose_noise import PoseNoise
from contact_curation.motion.pose_stream import BadPose, FramePose, checked_pose
from contact_curation.motion.segmenter import TossSegmenter
from contact_curation.motion.segmenter_config import SegmenterConfig
from test.motion.streams import CUBE, board_in_map, in_map, stream

GOOD = ((0.1, 0.2, 0.3), (0.5, 0.5, -0.5, 0.5))


def test_a_pose_comes_through_untouched() -> None:
    assert checked_pose(7, "map", "body", *GOOD) == FramePose(7, "map", "body", ScalarPose(*GOOD))
    assert checked_pose(7, "map", "body", *GOOD, static=True) == FramePose(7, "map", "body", ScalarPose(*GOOD), static=True)


@pytest.mark.parametrize("norm", [1.0009, 0.9991])
def test_a_norm_within_the_tolerance_is_not_normalised_away(norm: float) -> None:
    checked = checked_pose(7, "map", "body", GOOD[0], (norm, 0.0, 0.0, 0.0))
    assert isinstance(checked, FramePose)
    assert checked.pose.orientation_wxyz == (norm, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("position", "orientation", "why"),
    [
        ((nan, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), "pose: found (nan, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0), expected finite numbers"),
        ((0.0, 0.0, 0.0), (1.0, nan, 0.0, 0.0), "expected finite numbers"),
        ((0.0, inf, 0.0), (1.0, 0.0, 0.0, 0.0), "expected finite numbers"),
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0), "quaternion norm: found 0, expected 1 within 0.001"),
        ((0.0, 0.0, 0.0), (1.0011, 0.0, 0.0, 0.0), "quaternion norm: found 1.0011, expected 1 within 0.001"),
        ((0.0, -2e6, 0.0), (1.0, 0.0, 0.0, 0.0), "position: found (0.0, -2000000.0, 0.0), expected one within 1e+06 m"),
    ],
)
def test_what_is_no_pose_says_why(
    position: tuple[float, float, float], orientation: tuple[float, float, float, float], why: str
) -> None:
    checked = checked_pose(7, "map", "body", position, orientation)
    assert isinstance(checked, BadPose)
    assert (checked.stamp_ns, checked.child, checked.kind) == (7, "body", "far" if "within 1e+06 m" in why else "pose")
    assert why in checked.why


CONFIG = IngestConfig(TrackerConfig("body_cube"))
IN_FLIGHT = 60
OPTIONAL: dict[type, set[str]] = {
    BodyTracker: {"parents", "last_pose"},
    TossSegmenter: {"tracker"},
    TossIngest: {"stamps", "noise"},
}
"""What states of earlier releases lack."""
NONSENSE: tuple[Any, ...] = (None, "seven", [], {}, [[]], float("nan"), 10**400)


def fresh() -> TossIngest:
    return TossIngest(CONFIG, CUBE, source="/odom")


@pytest.fixture(scope="module")
def state() -> dict[str, Any]:
    """Of an ingest with a toss in the air."""
    ingest = fresh()
    for measured in [board_in_map(), *in_map(stream())][:IN_FLIGHT]:
        ingest.push(measured)
    assert ingest.tossing
    found: dict[str, Any] = json.loads(json.dumps(ingest.snapshot()))
    return found


def places(state: Any, place: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Where something stands in a state; of a list the last entry is as good as any."""
    if place:
        yield place
    entries = state.items() if isinstance(state, dict) else [*enumerate(state)][-1:] if isinstance(state, list) else ()
    for key, entry in entries:
        yield from places(entry, (*place, key))


def changed(state: dict[str, Any], place: tuple[Any, ...], to: Any) -> dict[str, Any]:
    copy = json.loads(json.dumps(state))
    parent = copy
    for key in place[:-1]:
        parent = parent[key]
    parent[place[-1]] = to
    return copy  # type: ignore[no-any-return]


@pytest.mark.parametrize("nonsense", NONSENSE, ids=repr)
def test_a_state_with_anything_changed_is_refused_in_one_line_or_goes_on(state: dict[str, Any], nonsense: Any) -> None:
    refused: list[str] = []
    rest = in_map(stream())[IN_FLIGHT - 1 : IN_FLIGHT + 3]
    for place in places(state):
        ingest = fresh()
        try:
            ingest.restore(changed(state, place, nonsense))
        except InvalidValueError as error:
            refused.append(str(error))
            continue
        for measured in rest:
            ingest.push(measured)
        ingest.flush()
        json.dumps(ingest.snapshot())
    assert len(refused) > len(list(places(state))) // 3
    for line in refused:
        assert " state: found " in line
        assert line.endswith(".snapshot gave: begin with an empty store")
        assert len(line) < 400


@pytest.mark.parametrize(
    "stage",
    [
        BodyTracker(TrackerConfig("body_cube")),
        StampEvener("cube"),
        PoseNoise(),
        TossSegmenter(SegmenterConfig(), CUBE, source="/odom"),
        fresh(),
    ],
    ids=lambda stage: type(stage).__name__,
)
def test_a_state_that_lacks_something_is_refused_and_changes_nothing(stage: Any) -> None:
    before = stage.snapshot()
    optional = (
        ("tracker", "stamps", "noise", "parents", "last_pose") if not isinstance(stage, TossIngest) else ("stamps", "noise")
    )
    for name in set(before) - set(optional):
        with pytest.raises(
            InvalidValueError, match=rf"state: found .*KeyError: '{name}'.*{type(stage).__name__}\.snapshot gave"
        ):
            stage.restore({key: value for key, value in before.items() if key != name})
    nonsense: tuple[Any, ...] = (None, 5, [], "rows")
    for one in nonsense:
        with pytest.raises(InvalidValueError, match="state: found"):
            stage.restore(one)
    assert stage.snapshot() == before
