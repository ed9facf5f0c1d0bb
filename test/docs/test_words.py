"""The project's own former words for things that have a standard name stay out of code, docs and messages."""

import re
from functools import cache

import pytest

from test.conftest import REPOSITORY
from test.graph.parts.declared_parameters import all_declared

FORBIDDEN = {
    r"\bkept[ _]back\b|\bkeeps?[ _]back\b": "rejected",
    r"\b(?:not |un)kept\b|\bkept[ _](?:toss(?:es)?|sets?|manifest|gram|transitions)\b": "selected, not selected",
    r"glitch": "tracking outlier",
    r"\b(?:put|puts|putting)[ _](?:\w+ )?right\b": "corrected, calibrated",
    r"canar(?:y|ies)": "readiness check, or staleness of a selection",
    r"\bwarm[-_ ]?ups?\b": "exploration throws",
    r"\btwins?\b": "duplicate recordings",
    r"\bout of sweeps\b": "iteration limit reached",
    r"\b(?:drawn|made|begins?|computed|fitted|predicted) anew\b": "re-drawn, regenerated, starts over, recomputed",
    r"\bless random\b": "difference to random",
    r"\bteach(?:es|ing)?\b|\btaught\b": "information about, estimated from, learned from",
    r"\brub(?:s|bed)?\b": "friction acts at",
    r"\breal rig\b": "ContactNets' rig",
    r"\bcomplaints?\b|\bculprits?\b|\bsaid_of\b": "what it holds",
    r"\bdoors? of the\b": "entry point",
}
"""Patterns, and what to write instead."""

OF_OLD_FILES = {
    "contact_curation/cli/options/one_line_parser.py",
    "contact_curation/session/node_parameters.py",
    "contact_curation/storage/manifest/file.py",
    "contact_curation/learning/checkpoints/selection_document.py",
    "test/cli/test_main.py",
    "test/session/test_former_names.py",
    "test/storage/test_format_versions.py",
}
"""They name what version 0.1 wrote or accepted."""

SUFFIXES = {".py", ".md", ".yaml", ".msg", ".srv", ".action", ".cpp", ".hpp", ".xml", ".toml"}
ROOTS = ("contact_curation", "msg_defs", "test", "benchmarks", "bags", "examples", "docs", "README.md", "CONTRIBUTING.md")
EXCEPT = {"docs/method.md", "test/docs/test_words.py", *OF_OLD_FILES}
"""Beside older files: the method cites the paper and its studies."""


@cache
def texts() -> dict[str, str]:
    """The project's texts by name."""
    tops = [REPOSITORY / root for root in ROOTS]
    paths = [path for top in tops for path in ([top] if top.is_file() else sorted(top.rglob("*"))) if path.suffix in SUFFIXES]
    named = {path.relative_to(REPOSITORY).as_posix(): path for path in paths}
    return {name: path.read_text() for name, path in named.items() if name not in EXCEPT}


@pytest.mark.parametrize("pattern", FORBIDDEN)
def test_a_standard_word_is_used_in_place_of_ours(pattern: str) -> None:
    word = re.compile(pattern, re.IGNORECASE)
    found = [
        f"{name}:{number}: {line.strip()}"
        for name, text in texts().items()
        if word.search(text)
        for number, line in enumerate(text.splitlines(), start=1)
        if word.search(line)
    ]
    assert not found, f"write {FORBIDDEN[pattern]} instead:\n" + "\n".join(found)


def test_descriptions_of_parameters_name_no_constant_of_the_code() -> None:
    page = (REPOSITORY / "docs" / "ros" / "reference.md").read_text().partition("## contact_curation_msgs")[0]
    leaked = [line for line in page.splitlines() if re.search(r"`[A-Z][A-Z_]{3,}`|\bCRITERIA\b|\bMETHOD\b|method\.md", line)]
    assert not leaked, "\n".join(leaked)


INTERNAL = {
    r"\bNone\b": "a ROS parameter has no None: say what is the default",
    r"`\w+`": "a name in backticks is one of the code",
    r"\b\w+\.py\b|contact_curation\.": "a module is one of the code",
    r"\b[a-z]+_(?:max|tol|min)\b|\bdelta\b": "a symbol of a formula needs the formula",
}
"""What no description of a parameter holds, and why."""

MESSAGES_AND_FILES = {"`body_<name>`", "`throw n of N`"}


@pytest.mark.parametrize("pattern", INTERNAL)
def test_descriptions_of_parameters_need_nothing_of_the_code(pattern: str) -> None:
    described = [(node, one) for node, found in all_declared().items() for one in found]
    assert len(described) > 200
    told = [(f"{node} {one.name}", one.description) for node, one in described]
    leaked = [f"{name}: {text}" for name, text in told if set(re.findall(pattern, text)) - MESSAGES_AND_FILES]
    assert not leaked, f"{INTERNAL[pattern]}\n" + "\n".join(leaked)


def test_descriptions_of_parameters_stand_alone() -> None:
    """`ros2 param describe` shows one of them at a time."""
    told = [(f"{node} {one.name}", one.description) for node, found in all_declared().items() for one in found]
    begun_elsewhere = re.compile(r"(?:and|or|the same|of|of the|in the|so many|likewise)\b|.*,[;.]?$")
    assert [f"{name}: {text}" for name, text in told if len(text.split()) < 3 or begun_elsewhere.match(text)] == []
