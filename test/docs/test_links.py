"""Links between the pages lead somewhere."""

import re
from pathlib import Path

from test.conftest import REPOSITORY

LINK = re.compile(r"\]\((?!https?:|mailto:|#)([^)#\s]+)(?:#([^)\s]*))?\)")
FOLDERS = ("docs", "bags", "conformance")
PAGES = sorted([*REPOSITORY.glob("*.md"), *(page for folder in FOLDERS for page in (REPOSITORY / folder).rglob("*.md"))])


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ +(.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def broken_links(page: Path) -> list[str]:
    """The links of a page that lead to no file, or to no heading of it."""
    broken = []
    for target, anchor in LINK.findall(page.read_text(encoding="utf-8")):
        path = (page.parent / target).resolve()
        if not path.exists() or (anchor and anchor not in anchors(path)):
            broken.append(f"{target}#{anchor}" if anchor else target)
    return broken


def test_every_link_of_a_page_leads_to_a_file_and_a_heading_in_it() -> None:
    broken = {str(page.relative_to(REPOSITORY)): broken_links(page) for page in PAGES}
    assert {page: links for page, links in broken.items() if links} == {}


PATHS = re.compile(r"`((?:[\w.]+/)+[\w.]+\.(?:py|cpp|hpp)|test_\w+\.py)`")
ROOTS = (REPOSITORY, REPOSITORY / "contact_curation", REPOSITORY / "conformance")


def missing_files(page: Path) -> list[str]:
    """The files of the repository that a page names and that are not there."""
    named = PATHS.findall(page.read_text(encoding="utf-8"))
    return [path for path in named if not any((root / path).exists() for root in ROOTS)]


def test_every_file_of_the_repository_that_a_page_names_is_there() -> None:
    missing = {str(page.relative_to(REPOSITORY)): missing_files(page) for page in PAGES if page.parent != REPOSITORY}
    assert {page: files for page, files in missing.items() if files} == {}
