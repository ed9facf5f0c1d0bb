"""Pages that are written from the code say what the code says now."""

import pytest

from test.docs import schemas
from test.docs.reference import PAGE, page


def test_the_reference_is_that_of_the_nodes_and_messages_as_they_are() -> None:
    assert PAGE.read_text() == page(), "write it anew with `python -m test.docs.reference`"


@pytest.mark.parametrize("name", schemas.PAGES)
def test_the_page_of_a_format_describes_the_records_that_are_written(name: str) -> None:
    assert (schemas.FOLDER / name).read_text() == schemas.PAGES[name](), "write it anew with `python -m test.docs.schemas`"


@pytest.mark.slow
@pytest.mark.parametrize("name", schemas.SLOW_PAGES)
def test_the_outlines_of_json_are_those_of_the_commands_output(name: str) -> None:
    assert (schemas.FOLDER / name).read_text() == schemas.SLOW_PAGES[name](), "write it anew with `python -m test.docs.schemas`"


def test_an_outline_names_keys_types_and_what_lists_hold() -> None:
    assert list(schemas.outline({"a": [{"b": 1.5, "c": None}], "d": [[1]], "e": True})) == [
        "a: list of object",
        "    b: number",
        "    c: null",
        "d: list of list of integer",
        "e: true or false",
    ]
