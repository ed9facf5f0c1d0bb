"""No line of Markdown is wider than people read."""

from test.conftest import REPOSITORY
from test.docs.test_links import PAGES

WIDEST = 120


def wide_lines(text: str) -> list[str]:
    return [line for line in text.splitlines() if len(line) > WIDEST]


def test_no_line_of_a_page_is_wider_than_120_characters() -> None:
    wide = {str(page.relative_to(REPOSITORY)): wide_lines(page.read_text(encoding="utf-8")) for page in PAGES}
    assert {page: lines for page, lines in wide.items() if lines} == {}


def test_a_line_of_121_characters_is_too_wide() -> None:
    assert wide_lines(f"{'a' * 120}\n{'b' * 121}") == ["b" * 121]
