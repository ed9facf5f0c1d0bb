"""Pages that are written from the code say what the code says now, and the page on the nodes has their defaults."""

import re
from typing import Any

import pytest
import yaml

from test.docs import schemas
from test.docs.reference import PAGE, page
from test.graph.parts.declared_parameters import all_declared


def test_the_reference_is_that_of_the_nodes_and_messages_as_they_are() -> None:
    assert PAGE.read_text() == page(), "write it anew with `python -m test.docs.reference`"


DEFAULT = re.compile(r"`([a-z_.]+)` \(default `?([\w.-]+)`?(?: s)?[),;:]")
WORDS = {"infinite": float("inf"), "none": ""}


def test_the_page_on_the_nodes_states_the_defaults_that_they_have() -> None:
    sections = (PAGE.parent / "nodes.md").read_text().split("\n## ")
    of_node = {name: text for name, _, text in (section.partition("\n") for section in sections) if name in all_declared()}
    stated = {
        (node, name): WORDS.get(value, yaml.safe_load(value))
        for node in of_node
        for name, value in DEFAULT.findall(of_node[node])
    }
    declared: dict[tuple[str, str], Any] = {
        (node, one.name): one.default for node, all_of in all_declared().items() for one in all_of
    }
    assert len(stated) > 25
    assert stated == {parameter: declared.get(parameter) for parameter in stated}


@pytest.mark.parametrize("name", schemas.PAGES)
def test_the_page_of_a_format_describes_the_records_that_are_written(name: str) -> None:
    assert (schemas.FOLDER / name).read_text() == schemas.PAGES[name](), "write it anew with `python -m test.docs.schemas`"


@pytest.mark.slow
@pytest.mark.parametrize("name", schemas.SLOW_PAGES)
def test_the_outlines_of_json_are_those_of_the_commands_output(name: str) -> None:
    assert (schemas.FOLDER / name).read_text() == schemas.SLOW_PAGES[name](), "write it anew with `python -m test.docs.schemas`"


def test_an_outline_names_keys_types_and_what_lists_hold() -> None:
    assert list(schemas.outline({"a": [{"b": 1.5, "c": None}, {"b": 2, "c": "x"}], "d": [[1]], "e": True})) == [
        "a: list of object",
        "    b: number",
        "    c: null or text",
        "d: list of list of integer",
        "e: true or false",
    ]
