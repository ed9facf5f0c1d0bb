"""The examples of the site print and draw today what their pages show."""

from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from test.docs.executed import BLOCK, FIGURES, PAGES, executed

SAME_PICTURE = 0.05
"""Largest root mean square difference of two pictures, of 1: fonts may differ by a release."""


def test_there_are_three_examples_with_code_output_and_a_figure() -> None:
    assert len(PAGES) == 3
    for page in PAGES:
        blocks = BLOCK.findall(page.read_text())
        assert len(blocks) >= 3
        assert sum(bool(output) for _, output in blocks) >= 2
        assert any("savefig" in code or "save_figure" in code for code, _ in blocks)


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_an_example_prints_and_draws_what_its_page_shows(page: Path) -> None:
    with executed(page) as (text, figures):
        assert text == page.read_text(), "run `python -m test.docs.executed`"
        assert figures
        for figure in figures:
            made, shown = (matplotlib.image.imread(path)[..., :3] for path in (figure, FIGURES / figure.name))
            assert made.shape == shown.shape
            assert np.sqrt(np.mean((made - shown) ** 2)) < SAME_PICTURE
