"""A recording says which files it was made of."""

import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.storage.inputs.recording_notes import RecordedNumbers, number_of_file, recorded_numbers


def test_a_toss_has_the_number_of_the_last_file_that_began_before_it() -> None:
    numbers = recorded_numbers(RecordedNumbers((100, 200, 300), (7, 417, 3)).note())
    assert [numbers.number_at(stamp) for stamp in (99, 100, 199, 200, 1000)] == [None, 7, 7, 417, 3]
    assert recorded_numbers({}).number_at(100) is None


def test_a_note_of_other_words_is_refused() -> None:
    with pytest.raises(InvalidValueError, match="stamps by number"):
        recorded_numbers({"7": "soon"})


def test_only_files_named_by_a_number_have_one() -> None:
    assert [number_of_file(name) for name in ("417.pt", "toss_417.pt", "417", "/tagslam/odom")] == [417, None, None, None]
