"""A recording carries the rules it was cut by, and who reads it may still set others."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.motion.segmenter_config import CONTACTNETS_RULES, SegmenterConfig
from contact_curation.storage.bags.reader import BagReader, recorded_notes
from contact_curation.storage.bags.writer import BagWriter
from contact_curation.storage.inputs.recording_notes import note_of_rules, with_recorded_rules


def test_the_rules_that_differ_come_back_exactly() -> None:
    note = note_of_rules(CONTACTNETS_RULES)
    assert note == {"rest_height": "0.052", "frame_period": repr(1.0 / 148.0)}
    assert with_recorded_rules(SegmenterConfig(), note) == CONTACTNETS_RULES


def test_a_part_has_the_noise_of_the_whole() -> None:
    quiet = SegmenterConfig(tracker_noise=1.0)
    assert with_recorded_rules(SegmenterConfig(), note_of_rules(quiet)) == quiet
    own = SegmenterConfig(tracker_noise=3.0)
    assert with_recorded_rules(own, note_of_rules(quiet)) == own


def test_usual_rules_need_no_note() -> None:
    assert note_of_rules(SegmenterConfig()) == {}
    assert with_recorded_rules(SegmenterConfig(), {}) == SegmenterConfig()


def test_what_the_user_has_set_stays() -> None:
    own = SegmenterConfig(rest_height=0.06, frame_period=0.01, shortest=0.2)
    assert with_recorded_rules(own, note_of_rules(CONTACTNETS_RULES)) == own
    half = SegmenterConfig(rest_height=0.06)
    assert with_recorded_rules(half, note_of_rules(CONTACTNETS_RULES)) == replace(half, frame_period=1.0 / 148.0)


@pytest.mark.parametrize("value", ["low", "", "-1.0", "nan"])
def test_a_note_without_positive_numbers_is_refused(value: str) -> None:
    with pytest.raises(InvalidValueError):
        with_recorded_rules(SegmenterConfig(), {"rest_height": value})


def test_rules_that_this_version_does_not_know_are_passed_over() -> None:
    assert with_recorded_rules(SegmenterConfig(), {"colour": "3"}) == SegmenterConfig()


def noted(bag: Path, **notes: str) -> Path:
    with BagWriter(bag) as writer:
        writer.note("first", notes)
        writer.note("second", {"a": "other"})
    return bag


def test_a_note_in_a_bag_comes_back_by_its_name(tmp_path: Path) -> None:
    bag = noted(tmp_path / "bag.mcap", a="1", b="ü")
    with BagReader(bag) as reader:
        assert reader.note("first") == {"a": "1", "b": "ü"}
        assert reader.note("second") == {"a": "other"}
        assert reader.note("third") == {}


def test_a_note_in_a_folder_comes_back_too(tmp_path: Path) -> None:
    with BagReader(noted(tmp_path / "bag", a="1")) as reader:
        assert reader.note("first") == {"a": "1"}


def test_files_without_notes_have_none(tmp_path: Path) -> None:
    other = tmp_path / "bag.db3"
    other.write_bytes(b"SQLite format 3\0")
    assert recorded_notes(other) == {}


def test_of_a_bag_that_was_cut_off_the_notes_are_lost_and_nothing_else(tmp_path: Path) -> None:
    bag = noted(tmp_path / "bag.mcap", a="1")
    whole = bag.read_bytes()
    for length in (8, len(whole) // 2, len(whole) - 9):
        bag.write_bytes(whole[:length])
        assert recorded_notes(bag) == {}


def test_a_damaged_bag_gives_a_note_or_none_but_no_error_of_the_readers(tmp_path: Path) -> None:
    bag = noted(tmp_path / "bag.mcap", a="1")
    whole, rng = bag.read_bytes(), np.random.default_rng(0)
    lost = 0
    for place in rng.integers(len(whole), size=400).tolist():
        bag.write_bytes(whole[:place] + bytes([rng.integers(256)]) + whole[place + 1 :])
        lost += not recorded_notes(bag).get("first")
    assert 0 < lost < 400
