"""What stages keep is read back as it was; what is newer or something else is refused in one line."""

import json
from pathlib import Path

import pytest

from contact_curation.design.designer import Realised
from contact_curation.design.throw import throw_of_state
from contact_curation.errors import UnreadableInputError
from contact_curation.stages.records import (
    FORMAT,
    AnnouncedTosses,
    BufferRecord,
    CuratorPosition,
    Cursor,
    IngestSnapshot,
    Proposal,
    ReferenceScores,
    Stamped,
    ThrowLogRecord,
    ThrowRecord,
    TossHeader,
    TrainingRecord,
    UsedTime,
    load_record,
    read_record,
    record_bytes,
    record_of,
    stored_records,
    write_record,
)
from contact_curation.storage.stores.state import StateStore
from test.design.cases import releases

THROW = throw_of_state("throw-0", "cube", releases(1)[0], 2.5, "theta")
MADE = ThrowRecord(THROW, THROW, 100, 90, None, "toss-0", Realised("throw-0", "toss-0", 2.0, 1.5))
LOST = ThrowRecord(THROW, THROW, 200, 190, "no theta", rejected=("gap: found 3", "depth"))
RECORDS = [
    AnnouncedTosses(3, 1),
    IngestSnapshot("digest", 7, {"tracker": [1.5, None, {"a": "b"}]}),
    CuratorPosition(Cursor(3, "toss-0"), Stamped(5, "board"), ("a", "b"), 7, "cube"),
    CuratorPosition(),
    TossHeader(Stamped(5, "board")),
    BufferRecord(2, ("b", "a"), "theta", "trace", 9),
    TrainingRecord(2, 800, False, "theta", 3, 9),
    ReferenceScores({"theta": (1.0, 0.1)}),
]


@pytest.mark.parametrize("record", RECORDS, ids=lambda record: type(record).__name__)
def test_a_record_is_read_back_as_it_was(record: object) -> None:
    assert record_of(type(record), record_bytes(record), "here") == record


def test_throws_are_read_back_bit_for_bit(tmp_path: Path) -> None:
    log = ThrowLogRecord(3, Proposal(THROW, "few tosses"), (MADE, LOST), "releases: found 0")
    with StateStore(tmp_path / "throws.sqlite") as states:
        states.save(stored_records(log))
        again = load_record(states.load, ThrowLogRecord)
    assert again is not None
    assert record_bytes(again) == record_bytes(log)
    assert (again.begun, again.no_throw, again.made[0].realised) == (3, "releases: found 0", MADE.realised)
    assert again.under_way is not None
    assert again.under_way.exploration == "few tosses"


@pytest.mark.parametrize("record", RECORDS, ids=lambda record: type(record).__name__)
def test_a_record_of_a_newer_format_is_refused_in_one_line(record: object) -> None:
    newer = json.dumps({**json.loads(record_bytes(record)), "format": FORMAT + 1, "more": 1}).encode()
    with pytest.raises(UnreadableInputError, match=r"^here: holds a \w+ of format 2, this package knows formats up to 1$"):
        record_of(type(record), newer, "here")


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"[0, 1]",
        b"{",
        b'{"format": 1, "tosses": 1.5}',
        b'{"format": 1, "tosses": true}',
        b'{"format": 1, "tossed": 1}',
        b'{"format": "1"}',
        b'{"format": 0}',
        b"\xff",
    ],
)
def test_what_is_no_record_is_refused_in_one_line(content: bytes) -> None:
    with pytest.raises(UnreadableInputError, match=r"^here: found no AnnouncedTosses of format 1 \(") as refused:
        record_of(AnnouncedTosses, content, "here")
    assert "\n" not in str(refused.value)


def test_records_from_before_there_were_formats_are_read_where_they_are_the_same() -> None:
    assert record_of(UsedTime, b'{"used_until_ns": 5}', "here") == UsedTime(5)


def test_a_record_in_a_file_of_its_own_may_not_be_there_yet(tmp_path: Path) -> None:
    path = tmp_path / "time.json"
    assert read_record(path, UsedTime) is None
    write_record(path, UsedTime(7))
    assert read_record(path, UsedTime) == UsedTime(7)


def test_a_throw_says_what_it_still_waits_for_and_what_it_gained() -> None:
    unseen = ThrowRecord(THROW, THROW, 300)
    assert [one.awaits_motion for one in (MADE, LOST, unseen)] == [False, False, True]
    assert [one.awaits_gain for one in (MADE, LOST, unseen)] == [False, False, False]
    assert ThrowRecord(THROW, THROW, 300, toss_id="toss-1").awaits_gain
    assert [(one.planned_gain, one.realised_gain) for one in (MADE, LOST, unseen)] == [(2.0, 1.5), (None, None), (2.5, None)]
    assert LOST.report.detail == "rejected: gap: found 3; depth"
