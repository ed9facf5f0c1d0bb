"""No line of Markdown is wider than people read."""

from pathlib import Path

import pytest

from test.docs.test_links import PAGES

WIDEST = 120


def wide_lines(text: str) -> list[str]:
    return [line for line in text.splitlines() if len(line) > WIDEST]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_no_line_of_a_page_is_wider_than_120_characters(page: Path) -> None:
    assert wide_lines(page.read_text(encoding="utf-8")) == []


def test_a_line_of_121_characters_is_too_wide() -> None:
    assert wide_lines(f"{'a' * 120}\n{'b' * 121}") == ["b" * 121]
