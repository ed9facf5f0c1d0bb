"""Colours: as Rerun takes them, and the same as matplotlib does."""

import pytest

from contact_curation.dashboard.style import BLUE, GREEN, INK, Colour


@pytest.mark.parametrize(("colour", "web"), [(BLUE, "#0072b2"), (GREEN, "#009e73"), (INK, "#222222")])
def test_a_colour_is_the_same_in_both_forms(colour: Colour, web: str) -> None:
    assert colour.web == web
    assert tuple(bytes.fromhex(colour.web[1:])) == colour
