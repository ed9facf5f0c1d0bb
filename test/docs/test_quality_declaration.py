"""The quality declaration has every requirement of REP 2004 once, and what shows each is there."""

import re
from xml.etree import ElementTree

import pytest

from test.conftest import REPOSITORY

PAGE = REPOSITORY / "docs" / "ros" / "quality_declaration.md"
ENTRIES = re.findall(r"^- \*\*([\w.]+) [^*]+\*\*: (.+?)(?=\n- |\n\n|\Z)", PAGE.read_text(), re.MULTILINE | re.DOTALL)
REQUIREMENTS = {"1": "i ii iii iv v vi", "2": "i ii iii iv v", "3": "i ii iii iv v", "4": "i ii iii iv v", "5": "i ii iii"}
NUMBERS = [f"{part}.{one}" for part, ones in {**REQUIREMENTS, "6": "i", "7": "i"}.items() for one in ones.split()]


def test_every_requirement_has_one_line() -> None:
    assert [number for number, _ in ENTRIES] == NUMBERS


@pytest.mark.parametrize(("number", "text"), ENTRIES, ids=NUMBERS)
def test_what_shows_a_requirement_is_there_and_what_does_not_hold_says_so(number: str, text: str) -> None:
    shown = re.findall(r"`([^`]+)`", text)
    assert shown or text.startswith("no")
    for path in shown:
        assert (REPOSITORY / path).is_file(), path


def test_the_level_fits_the_version() -> None:
    manifests = [REPOSITORY / "package.xml", REPOSITORY / "msg_defs" / "package.xml"]
    versions = {str(ElementTree.parse(path).getroot().findtext("version")) for path in manifests}
    assert [f"this is {version}" in " ".join(PAGE.read_text().split()) for version in versions] == [True]
    stable = min(int(version.partition(".")[0]) for version in versions) >= 1
    assert ("Quality Level 4" in PAGE.read_text()) == (not stable)


def test_the_license_of_the_manifests_is_that_of_the_license_file() -> None:
    for folder in (REPOSITORY, REPOSITORY / "msg_defs"):
        assert ElementTree.parse(folder / "package.xml").getroot().findtext("license") == "BSD-3-Clause"
    assert (REPOSITORY / "LICENSE").read_text().startswith("BSD 3-Clause License")
