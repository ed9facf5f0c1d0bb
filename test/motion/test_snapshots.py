"""States that the stages of a stream write down: every part of one that is changed is refused in one line, or goes on."""

import json
from collections.abc import Iterator
from typing import Any

import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.motion.body_tracker import BodyTracker, TrackerConfig
from contact_curation.motion.even_stamps import StampEvener
from contact_curation.motion.ingest import IngestConfig, TossIngest
from contact_curation.motion.pose_noise import PoseNoise
from contact_curation.motion.segmenter import TossSegmenter
from contact_curation.motion.segmenter_config import SegmenterConfig
from test.motion.streams import CUBE, board_in_map, in_map, stream

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
    for nothing in (None, 5, [], "rows"):
        with pytest.raises(InvalidValueError, match="state: found"):
            stage.restore(nothing)
    assert stage.snapshot() == before
