"""What code and pages cite of docs/method.md is there, and what it names of the code is there, too."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "method.md"
FOLDERS = ("contact_curation", "test", "benchmarks", "docs", "msg_defs")
KINDS = {".py", ".hpp", ".cpp", ".md", ".yaml", ".msg", ".srv", ".action"}

NUMBER = r"\d+(?:\.\d+)?"
REFERENCE = rf"(?:checks? {NUMBER}|appendix [A-Z]|[AE]\d+|{NUMBER})"
CITATION = re.compile(rf"(?:METHOD|method\.md)(?:'s)?,? ({REFERENCE}(?:(?:, | and | to ){REFERENCE})*)")
"""One section or label, or several: `1.9, E11 to E14`, `2.8, check 6.16`, `checks 9 and 10`, `appendix A`."""

LINE_END = re.compile(r"\s*\n[\s#/]*")
"""With the mark of a comment on the next line."""


def headings(page: str) -> set[str]:
    """`1.2`, `E11`, `A1`, `appendix A`."""
    found = re.findall(rf"^#+ ({NUMBER}|[AE]\d+|Appendix [A-Z])\b", page, re.MULTILINE)
    return {name.replace("Appendix", "appendix") for name in found}


def cited(text: str) -> Iterator[str]:
    """The headings that a text cites."""
    for citation in CITATION.findall(LINE_END.sub(" ", text)):
        check = False
        for reference in re.findall(REFERENCE, citation):
            check = reference.startswith("check") or (check and reference.isdecimal())
            name = reference.removeprefix("checks ").removeprefix("check ")
            yield f"6.{name}" if check and "." not in name else name


def cited_by_all() -> list[tuple[str, str]]:
    """Files, and what each cites."""
    paths = [path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*")) if path.suffix in KINDS]
    texts = [(path, path.read_text()) for path in paths if path != Path(__file__).resolve()]
    return [(str(path.relative_to(ROOT)), name) for path, text in texts for name in cited(text)]


def test_every_citation_of_the_method_leads_to_a_heading() -> None:
    citations, there = cited_by_all(), headings(PAGE.read_text())
    assert len(citations) > 140
    assert [f"{path} cites {name}" for path, name in citations if name not in there] == []


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("(method.md 1.9, E11 to E14)", ["1.9", "E11", "E14"]),
        ("the floor of method.md 1.11.", ["1.11"]),
        ("unique (method.md\n// E5).", ["E5"]),
        ("method.md 6, checks 1 and 3, for every model", ["6", "6.1", "6.3"]),
        ("method.md 2.8, check 6.16", ["2.8", "6.16"]),
        ("method.md's check 11", ["6.11"]),
        ("(method.md, appendix A)", ["appendix A"]),
        ("as in [method.md](method.md)", []),
    ],
)
def test_citations_are_read_in_every_form_that_is_used(text: str, expected: list[str]) -> None:
    assert list(cited(text)) == expected


def test_every_class_and_function_that_the_method_names_is_in_the_package() -> None:
    paragraphs = re.findall(r"^Code: (.+?)\n\n", PAGE.read_text(), re.MULTILINE | re.DOTALL)
    names = {name for paragraph in paragraphs for name in re.findall(r"`(\w+)`", paragraph)}
    assert len(names) > 100
    package = ROOT / "contact_curation"
    sources = "\n".join(path.read_text() for kind in ("py", "hpp", "cpp") for path in package.rglob(f"*.{kind}"))
    defined = set(re.findall(r"^\s*(?:def|class|struct) (\w+)|^(\w+)\b.* = ", sources, re.MULTILINE))
    assert names - {name for pair in defined for name in pair} == set()
