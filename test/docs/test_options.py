"""Every option beside a `contact-curation VERB` or a `python -m MODULE` in the documentation is one that it has."""

import argparse
import re
from functools import cache
from pathlib import Path

import pytest

from contact_curation.cli.main import VERBS, build_parser
from test.conftest import REPOSITORY

PAGES = sorted([REPOSITORY / "README.md", REPOSITORY / "CONTRIBUTING.md", *(REPOSITORY / "docs").rglob("*.md")])
COMMAND = re.compile(r"contact-curation ([a-z]+)\b([^\n`]*(?:\\\n[^\n`]*)*)")
MODULE = re.compile(r"python\s+-m\s+((?:benchmarks|test)[\w.]*\w)([^`\n]*(?:\\\n[^`\n]*)*)")
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]*")


@cache
def options_of(verb: str) -> frozenset[str]:
    """What a verb takes, and what is below it."""
    words = [verb, "contactnets"]
    return frozenset(name for parser in below(build_parser(words)) if verb in parser.prog for name in named(parser))


def below(parser: argparse.ArgumentParser) -> list[argparse.ArgumentParser]:
    inner = [each for action in parser._actions if isinstance(action.choices, dict) for each in action.choices.values()]
    return [parser, *(one for each in inner for one in below(each))]


def named(parser: argparse.ArgumentParser) -> list[str]:
    return [name for action in parser._actions for name in action.option_strings]


def told(page: Path) -> list[tuple[str, str]]:
    """Verbs and options beside them."""
    commands = [(verb, words) for verb, words in COMMAND.findall(page.read_text()) if verb in VERBS]
    return [(verb, option) for verb, words in commands for option in OPTION.findall(words)]


@pytest.mark.parametrize("page", PAGES, ids=[page.name for page in PAGES])
def test_a_page_names_only_options_that_there_are(page: Path) -> None:
    assert [f"{verb} {option}" for verb, option in told(page) if option not in options_of(verb)] == []


def test_the_pages_do_name_options() -> None:
    assert {"rank", "train", "evaluate", "design", "simulate", "online"} <= {verb for page in PAGES for verb, _ in told(page)}
    assert "--tosses" in options_of("import")
    assert "--crit" not in options_of("rank")


def source(module: str) -> str:
    """What a module and those of the repository that it imports say; empty if there is none."""
    named = REPOSITORY.joinpath(*module.split("."))
    path = next((path for path in (named.with_suffix(".py"), named / "__main__.py") if path.exists()), None)
    text = path.read_text() if path else ""
    return text + "".join(source(name) for name in re.findall(r"^from (benchmarks[\w.]*) import", text, re.MULTILINE))


@pytest.mark.parametrize("page", PAGES, ids=[page.name for page in PAGES])
def test_a_page_names_only_options_that_a_module_has(page: Path) -> None:
    modules = MODULE.findall(page.read_text())
    assert [module for module, _ in modules if not source(module)] == []
    options = [(module, option) for module, words in modules for option in OPTION.findall(words)]
    assert [f"{module} {option}" for module, option in options if f'"{option}"' not in source(module)] == []


CUT_OFF = re.compile(r"^ {4}(?:contact-curation|python)\b(?:[^\n]*\\\n)*[^\n]*[^\\\n]\n {5,}--.*", re.MULTILINE)
"""A command that goes on in the next line, which a shell would not know."""


@pytest.mark.parametrize("page", PAGES, ids=[page.name for page in PAGES])
def test_a_command_of_several_lines_can_be_typed(page: Path) -> None:
    assert CUT_OFF.findall(page.read_text()) == []
