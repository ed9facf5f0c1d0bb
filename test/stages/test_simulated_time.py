"""Stamps that never go back, whatever end the run before came to."""

from pathlib import Path

import pytest

from contact_curation.errors import InvalidValueError, UnreadableInputError
from contact_curation.stages.simulated_time import BLOCK, SimulatedTime

EPOCH = 1_000_000_000


def test_stamps_begin_at_the_epoch_and_count_nanoseconds(tmp_path: Path) -> None:
    for path in (None, tmp_path / "time.json"):
        time = SimulatedTime(path, EPOCH)
        assert time.stamp_ns(0.0) == EPOCH
        assert time.stamp_ns(1.5) == EPOCH + 1_500_000_000


@pytest.mark.parametrize("last", [0.0, 3.0, 59.99, 60.0, 1234.5])
def test_after_a_kill_stamps_go_on_behind_the_last_one_even_if_the_clock_went_back(tmp_path: Path, last: float) -> None:
    path = tmp_path / "time.json"
    killed = SimulatedTime(path, EPOCH)
    stamps = [killed.stamp_ns(seconds) for seconds in (0.0, 0.5 * last, last)]
    again = SimulatedTime(path, EPOCH - 500)
    assert stamps[-1] < again.stamp_ns(0.0) <= stamps[-1] + BLOCK
    third = SimulatedTime(path, EPOCH)
    assert third.stamp_ns(0.0) > again.stamp_ns(0.0)


def test_an_orderly_end_gives_back_what_was_reserved(tmp_path: Path) -> None:
    path = tmp_path / "time.json"
    time = SimulatedTime(path, EPOCH)
    last = time.stamp_ns(7.0)
    time.stamp_ns(2.0)
    time.close()
    assert SimulatedTime(path, 0).stamp_ns(0.0) == last + 1
    assert SimulatedTime(path, EPOCH * 100).stamp_ns(0.0) == EPOCH * 100


def test_time_is_reserved_in_blocks_and_not_for_every_stamp(tmp_path: Path) -> None:
    path = tmp_path / "time.json"
    time = SimulatedTime(path, EPOCH)
    contents = set()
    for frame in range(148 * 130):
        time.stamp_ns(frame / 148.0)
        if frame % 148 == 0:
            contents.add(path.read_text())
    assert len(contents) == 3


@pytest.mark.parametrize(
    "content", ["", "[]", '{"used_until_ns": 1.5}', '{"used_until_ns": -1}', '{"used_until_ns": true}', "{}"]
)
def test_a_file_that_holds_something_else_is_refused(tmp_path: Path, content: str) -> None:
    path = tmp_path / "time.json"
    path.write_text(content)
    with pytest.raises(UnreadableInputError, match=r"time\.json"):
        SimulatedTime(path, EPOCH)


def test_a_place_that_cannot_be_written_is_refused_before_any_stamp(tmp_path: Path) -> None:
    with pytest.raises(InvalidValueError, match="a path that can be written"):
        SimulatedTime(tmp_path / "nowhere" / "time.json", EPOCH)
