"""Links between the pages lead somewhere."""

import re
from pathlib import Path

import pytest

from test.conftest import REPOSITORY

LINK = re.compile(r"\]\((?!https?:|mailto:|#)([^)#\s]+)(?:#([^)\s]*))?\)")
FOLDERS = ("docs", "bags", "conformance")
PAGES = sorted([*REPOSITORY.glob("*.md"), *(page for folder in FOLDERS for page in (REPOSITORY / folder).rglob("*.md"))])


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ +(.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(REPOSITORY)))
def test_every_link_of_a_page_leads_to_a_file_and_a_heading_in_it(page: Path) -> None:
    for target, anchor in LINK.findall(page.read_text(encoding="utf-8")):
        path = (page.parent / target).resolve()
        assert path.exists(), target
        assert not anchor or anchor in anchors(path), f"{target}#{anchor}"


PATHS = re.compile(r"`((?:[\w.]+/)+[\w.]+\.(?:py|cpp|hpp))`")
ROOTS = (REPOSITORY, REPOSITORY / "contact_curation", REPOSITORY / "conformance")


@pytest.mark.parametrize("page", [page for page in PAGES if page.parent != REPOSITORY], ids=lambda page: page.name)
def test_every_file_of_the_repository_that_a_page_names_is_there(page: Path) -> None:
    named = PATHS.findall(page.read_text(encoding="utf-8"))
    assert [path for path in named if not any((root / path).exists() for root in ROOTS)] == []
