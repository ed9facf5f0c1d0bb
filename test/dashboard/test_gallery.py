"""Every figure is as it was when somebody last looked at it; `python -m test.dashboard.gallery` keeps new ones."""

import ast
from pathlib import Path

import pytest
from PIL import Image, ImageDraw

import contact_curation
from test.dashboard.gallery import FIGURES, REFERENCES, TOLERANCE, largest_difference, small


@pytest.mark.slow
@pytest.mark.parametrize("name", FIGURES)
def test_a_figure_is_as_it_was_kept(name: str, tmp_path: Path) -> None:
    FIGURES[name](tmp_path / f"{name}.png")
    kept, drawn = Image.open(REFERENCES / f"{name}.png").convert("L"), small(tmp_path / f"{name}.png")
    difference = largest_difference(kept, drawn)
    assert difference < TOLERANCE, (
        f"{tmp_path / name}.png differs by {difference:.0f}; python -m test.dashboard.gallery keeps it"
    )


def test_nothing_is_kept_that_is_not_drawn() -> None:
    assert {path.stem for path in REFERENCES.glob("*.png")} == set(FIGURES)


def test_every_part_that_draws_a_figure_is_in_the_gallery() -> None:
    package, drawing = Path(contact_curation.__file__).parent, set()
    for path in package.rglob("*.py"):
        imported = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.ImportFrom)]
        if any("save_figure" in [name.name for name in node.names] for node in imported):
            drawing.add(path.stem)
    assert drawing == {"ranking", "motion", "experiment", "report_data", "body"}, "draw it in test/dashboard/gallery.py"


@pytest.mark.parametrize(
    "change", ["a word is another", "a line is missing", "a point has moved", "nothing"], ids=lambda change: str(change)
)
def test_a_change_that_a_reader_would_see_is_found_and_noise_at_edges_is_not(change: str) -> None:
    kept = Image.open(REFERENCES / "experiment.png").convert("L")
    changed = kept.copy()
    pen = ImageDraw.Draw(changed)
    if change == "a word is another":
        pen.text((60, 30), "other", fill=0)
    elif change == "a line is missing":
        pen.rectangle((60, 60, 90, 90), fill=255)
    elif change == "a point has moved":
        pen.ellipse((200, 40, 208, 48), fill=0)
    else:
        changed = changed.point(lambda value: max(0, value - 8))
    assert (largest_difference(kept, changed) > TOLERANCE) == (change != "nothing")
