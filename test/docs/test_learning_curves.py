"""Learning curves as a picture."""

from pathlib import Path

import numpy as np
import pytest

from contact_curation.errors import InvalidValueError
from test.docs.learning_curves import Curve, _median, save_learning_curves


def curve(offset: float, *tosses: int) -> Curve:
    places = np.array(tosses)
    return Curve(places, {"error": offset + 1.0 / (1.0 + places)})


def test_the_median_is_over_the_curves_that_have_begun_and_holds_until_the_next_point() -> None:
    curves = [curve(0.0, 0, 4), curve(1.0, 2)]
    places, middle = _median(curves, "error")
    assert places.tolist() == [0, 2, 4]
    assert middle == pytest.approx([1.0, (1.0 + 4.0 / 3.0) / 2.0, (0.2 + 4.0 / 3.0) / 2.0])


def test_a_figure_is_drawn_with_one_panel_an_error(tmp_path: Path) -> None:
    path = tmp_path / "curves.png"
    save_learning_curves(
        {"log-det": [curve(0.0, 0, 4), curve(1.0, 2)], "random": [curve(2.0, 0, 9)]}, "title", path, {"error": 0.1}
    )
    assert path.read_bytes().startswith(b"\x89PNG")


def test_no_curve_and_no_place_are_one_line(tmp_path: Path) -> None:
    with pytest.raises(InvalidValueError, match="learning curves: found none"):
        save_learning_curves({"log-det": []}, "title", tmp_path / "curves.png")
    with pytest.raises(InvalidValueError, match=r"output: found .*nowhere"):
        save_learning_curves({"log-det": [curve(0.0, 0)]}, "title", tmp_path / "nowhere" / "curves.png")
