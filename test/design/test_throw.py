"""A throw is checked when it is made, whoever made it."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contact_curation.design.throw import Throw, throw_of_state
from contact_curation.errors import ContactCurationError, InvalidValueError, UnreadableInputError
from contact_curation.storage.throws_file import read_throws, write_throws

RELEASE = np.array([-0.3, 0.1, 0.14, 0.6, 0.0, 0.8, 0.0, 1.1, 0.2, -0.05, 0.5, 3.0, -0.2])


def a_throw(name: str = "throw-0") -> Throw:
    return throw_of_state(name, "cube", RELEASE, 1.25, "abc")


def test_a_state_goes_into_a_throw_and_comes_back_in_any_length() -> None:
    throw = a_throw()
    np.testing.assert_array_equal(throw.release, RELEASE)
    scaled = throw.state(0.05)
    np.testing.assert_allclose(scaled[[0, 7]], [-6.0, 22.0])
    np.testing.assert_array_equal(scaled[3:7], RELEASE[3:7])
    np.testing.assert_array_equal(scaled[10:], RELEASE[10:])


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("throw_id", ""),
        ("throw_id", 7),
        ("body", "two\nlines"),
        ("body", "x" * 201),
        ("position", [0.0, 0.0]),
        ("position", [0.0, 0.0, np.nan]),
        ("position", "here"),
        ("position", [[0.0], [0.0, 1.0], 2.0]),
        ("position", [True, False, True]),
        ("linear_velocity", [np.inf, 0.0, 0.0]),
        ("orientation_wxyz", [1.0, 0.0, 0.0, 0.1]),
        ("angular_velocity", None),
        ("expected_information", np.nan),
        ("expected_information", "much"),
        ("expected_information", True),
        ("parameters_version", None),
    ],
)
def test_what_is_no_throw_is_refused_in_one_line(field: str, value: object) -> None:
    with pytest.raises(InvalidValueError, match=field.replace("orientation_wxyz", "quaternion norm")) as caught:
        replace(a_throw(), **{field: value})  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)


def test_throws_come_back_from_their_file_bit_for_bit(tmp_path: Path) -> None:
    throws = (a_throw("a"), throw_of_state("b", "cube", RELEASE * 1.0, 0.1 + 0.2))
    write_throws(tmp_path / "throws.json", throws)
    back = read_throws(tmp_path / "throws.json")
    assert [throw.to_mapping() for throw in back] == [throw.to_mapping() for throw in throws]


def test_a_throw_of_a_user_needs_no_plan(tmp_path: Path) -> None:
    given = a_throw().to_mapping()
    for name in ("expected_information", "parameters_version"):
        given.pop(name)
    assert Throw.from_mapping(given).expected_information == 0.0


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "is not JSON"),
        ("[" * 100_000, "is not JSON"),
        ("[]", "holds no throws"),
        ('{"version": 1}', "holds no throws"),
        ('{"version": 2, "throws": [{}]}', "found version 2 of throws, expected at most 1: update contact_curation"),
        ('{"version": 1, "throws": []}', "found 0 throws"),
        ('{"version": 1, "throws": [7]}', "throw 0: found a JSON int"),
        ('{"version": 1, "throws": [{}]}', "throw 0: throw: found no angular_velocity"),
        ('{"version": 1, "throws": [{"speed": 1}]}', "unknown speed"),
    ],
)
def test_a_file_without_throws_is_refused_in_one_line(tmp_path: Path, text: str, why: str) -> None:
    path = tmp_path / "throws.json"
    path.write_text(text)
    with pytest.raises(UnreadableInputError, match=why) as caught:
        read_throws(path)
    assert "\n" not in str(caught.value)


def _not_finite(text: str) -> str:
    return text.replace("-0.3", "NaN")


def _twice(text: str) -> str:
    return text.replace('"b"', '"a"')


@pytest.mark.parametrize(("damage", "why"), [(_not_finite, "a value that is not finite"), (_twice, "found a twice")])
def test_damage_inside_a_throw_is_named(tmp_path: Path, damage: Callable[[str], str], why: str) -> None:
    path = tmp_path / "throws.json"
    write_throws(path, (a_throw("a"), a_throw("b")))
    path.write_text(damage(path.read_text()))
    with pytest.raises(ContactCurationError, match=why):
        read_throws(path)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(UnreadableInputError, match="cannot be read"):
        read_throws(tmp_path / "nowhere.json")
