"""What the hook of the documentation site makes of a page; `make check` builds the whole site strictly."""

import importlib.util
import re
from pathlib import Path
from types import SimpleNamespace

import pytest

from test.conftest import REPOSITORY

PAGES = sorted((REPOSITORY / "docs").rglob("*.md"))


def as_on_the_site(text: str) -> str:
    """The Markdown that mkdocs gets."""
    path = REPOSITORY / "docs" / "hooks.py"
    spec = importlib.util.spec_from_file_location("hooks", path)
    assert spec is not None
    assert spec.loader is not None
    hooks = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(hooks)
    found = hooks.on_page_markdown(text, page=SimpleNamespace(file=SimpleNamespace(src_uri="tutorial.md")))
    assert isinstance(found, str)
    return found


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_code_blocks_are_code_on_the_site(page: Path) -> None:
    """superfences takes a block whose opening line has a second word for text."""
    fences = re.findall(r"^```.*$", as_on_the_site(page.read_text()), re.MULTILINE)
    assert [fence for fence in fences if not re.fullmatch(r"```\w*", fence)] == []


def test_a_mark_for_the_tests_is_left_out_and_the_language_stays() -> None:
    assert as_on_the_site("```sh background\nls\n```\n") == "```sh\nls\n```\n"
