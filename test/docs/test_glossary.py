"""The glossary defines each term before it uses it."""

import re

from test.conftest import REPOSITORY

PAGE = REPOSITORY / "docs" / "glossary.md"
ENTRY = re.compile(r"^- (.+(?:\n  .+)*)", re.MULTILINE)
TERM = re.compile(r"\*\*([^*]+)\*\*")


def entries(page: str) -> list[tuple[list[str], str]]:
    """The terms of each entry, and its text."""
    found = [" ".join(entry.split()) for entry in ENTRY.findall(page)]
    return [([part.strip() for term in TERM.findall(entry) for part in term.split(",")], entry) for entry in found]


def used_too_early(page: str) -> list[str]:
    """`term in the entry of other`, for each term that stands in an entry above its own."""
    listed = entries(page)
    return [
        f"{term} in the entry of {above[0]}"
        for number, (terms, _) in enumerate(listed)
        for term in terms
        for above, text in listed[:number]
        if re.search(rf"\b{re.escape(term.lower())}s?\b", TERM.sub("", text).lower())
    ]


def test_no_term_is_used_above_its_definition() -> None:
    page = PAGE.read_text()
    assert len(entries(page)) > 50
    assert used_too_early(page) == []


def test_a_term_that_is_used_too_early_is_found() -> None:
    page = "- **Toss**: a motion of the body.\n- **Body**: what is\n  thrown.\n"
    assert used_too_early(page) == ["Body in the entry of Toss"]
