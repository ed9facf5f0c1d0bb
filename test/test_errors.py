"""Messages for names that do not exist."""

import pytest

from contact_curation.errors import InvalidValueError, UnknownNameError, did_you_mean


def test_the_nearest_known_name_is_offered_whatever_its_case() -> None:
    assert did_you_mean("'vertexes'", ["'mass'", "'vertices'"]) == "did you mean 'vertices'?"
    assert did_you_mean("MASS", ["mass", "vertices"]) == "did you mean mass?"


def test_without_a_near_name_all_known_ones_are_listed() -> None:
    assert did_you_mean("colour", ["mass", "friction"]) == "expected one of friction, mass"


def test_an_unknown_name_is_an_invalid_value_in_one_line() -> None:
    with pytest.raises(InvalidValueError) as caught:
        raise UnknownNameError("field", "gates.dpth", ["gates.depth", "gates.spin"])
    assert str(caught.value) == "unknown field gates.dpth: did you mean gates.depth?"
