"""The experiments' figure: lines over sizes, points over categories, and what cannot be drawn."""

from pathlib import Path

import numpy as np
import pytest

from contact_curation.dashboard.figures.experiment import Panel, Series, Style, save_experiment_figure
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array


def series(name: str, places: list[float] | list[str], values: Array) -> Series:
    return Series(name, places, values, 0.8 * values, 1.3 * values)


OVER_SIZES = Panel("error", tuple(series(name, [4.0, 8.0], np.array([3.0, 1.0])) for name in "abcdefghij"), True, 0.7)
OVER_FAULTS = Panel("error", (series("a", ["clean", "spike"], np.array([1.0, np.nan])), series("b", ["spike"], np.ones(1))))


@pytest.mark.parametrize(
    "panels",
    [[OVER_SIZES] * 5, [OVER_FAULTS], [Panel("nothing", (series("a", [2.0], np.zeros(1)),), logarithmic=True)]],
    ids=["lines", "points", "zeros on a logarithmic axis"],
)
def test_it_is_a_picture(panels: list[Panel], tmp_path: Path) -> None:
    save_experiment_figure(panels, "title", "places", tmp_path / "figure.png")
    assert (tmp_path / "figure.png").read_bytes().startswith(b"\x89PNG")


def test_a_dozen_rules_are_told_apart_without_colours_and_without_markers() -> None:
    styles = [Style.of(number) for number in range(12)]
    assert len({style.marker for style in styles}) == 12
    assert len({(style.colour, style.line) for style in styles}) == 12


def test_nothing_and_no_place_are_refused(tmp_path: Path) -> None:
    for panels in ([], [Panel("error", ())]):
        with pytest.raises(InvalidValueError, match="panels of the figure"):
            save_experiment_figure(panels, "title", "places", tmp_path / "figure.png")
    with pytest.raises(InvalidValueError, match="output"):
        save_experiment_figure([OVER_SIZES], "title", "places", tmp_path / "missing" / "figure.png")
