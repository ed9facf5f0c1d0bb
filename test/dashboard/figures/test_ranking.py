"""The ranking's figure: drawn for every criterion and for pools at the edges of what there is."""

import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib import rc_context

from contact_curation.dashboard.figures.ranking import RankingPicture, save_ranking_figure
from contact_curation.errors import InvalidValueError
from contact_curation.information.ranker import criterion_named, criterion_names


def picture(count: int = 40, selected: int = 8) -> RankingPicture:
    rng = np.random.default_rng(0)
    return RankingPicture(
        title=f"{count} tosses",
        criterion="log-det",
        scores=np.sort(rng.lognormal(size=count))[::-1],
        gains=np.sort(rng.lognormal(size=count))[::-1],
        selected=selected,
        spectrum=rng.uniform(0.01, 0.5, 52),
        epsilon=0.99,
        shares={"vertices_normal": (0.8, 0.7), "friction": (0.2, 0.3)},
        outcomes=(("selected", selected), ("ranked, not selected", count - selected), ("impulse outside the friction cone", 3)),
    )


def size_of_png(path: Path) -> tuple[int, int]:
    data = path.read_bytes()
    assert data.startswith(b"\x89PNG")
    width, height = struct.unpack(">II", data[16:24])
    return width, height


def test_it_is_1600_by_1000(tmp_path: Path) -> None:
    save_ranking_figure(picture(), tmp_path / "figure.png")
    assert size_of_png(tmp_path / "figure.png") == (1600, 1000)


@pytest.mark.slow
def test_settings_of_the_user_do_not_change_it(tmp_path: Path) -> None:
    """Of a matplotlibrc, such as text by LaTeX, which need not be installed and takes names of files for formulas."""
    save_ranking_figure(picture(), tmp_path / "plain.png")
    with rc_context({"text.usetex": True, "savefig.dpi": 30, "axes.facecolor": "black"}):
        save_ranking_figure(picture(), tmp_path / "own.png")
    assert (tmp_path / "own.png").read_bytes() == (tmp_path / "plain.png").read_bytes()


def test_every_criterion_has_its_unit() -> None:
    labels = {name: criterion_named(name).axis_label() for name in criterion_names()}
    assert labels["log-det"] == "log-det gain of the toss alone [nats]"
    assert labels["random"] == "random number"
    assert len(set(labels.values())) == len(labels)
    assert criterion_named("longest").axis_label("gain") == "gain [s]"


UNUSUAL = {
    "one toss": picture(1, 1),
    "wide of both signs": replace(picture(), scores=np.concatenate([np.geomspace(1e3, 1.0, 20), -np.geomspace(1.0, 1e6, 20)])),
    "no spectrum": replace(picture(), spectrum=np.zeros(0)),
}
OTHERS = {
    "all selected": picture(5, 5),
    "equal": replace(picture(), scores=np.ones(40)),
    "no gains": replace(picture(), scores=np.zeros(40), gains=np.zeros(40)),
    "negative": replace(picture(), scores=np.linspace(3.0, -3.0, 40)),
    "wide": replace(picture(), scores=np.geomspace(1e12, 1e-9, 40)),
    "mostly nothing": replace(picture(), scores=np.concatenate([np.zeros(30), np.full(10, -1e6)])),
    "empty directions": replace(picture(), spectrum=np.array([0.0, 0.0, 1.0]), epsilon=1.0),
    "no blocks": replace(picture(), shares={}, criterion="longest"),
}
"""Drawn by the same code, and no cheaper."""


@pytest.mark.parametrize(
    "unusual",
    [
        *(pytest.param(one, id=name) for name, one in UNUSUAL.items()),
        *(pytest.param(one, id=name, marks=pytest.mark.slow) for name, one in OTHERS.items()),
    ],
)
def test_unusual_pools_are_drawn_without_a_warning(tmp_path: Path, unusual: RankingPicture) -> None:
    save_ranking_figure(unusual, tmp_path / "figure.png")
    assert size_of_png(tmp_path / "figure.png") == (1600, 1000)


@pytest.mark.slow
def test_the_same_picture_gives_the_same_bytes_and_other_numbers_others(tmp_path: Path) -> None:
    for name, drawn in (("a", picture()), ("b", picture()), ("c", picture(40, 9))):
        save_ranking_figure(drawn, tmp_path / f"{name}.png")
    first, second, third = ((tmp_path / f"{name}.png").read_bytes() for name in "abc")
    assert first == second != third


def test_a_path_that_cannot_be_written_is_one_clear_error(tmp_path: Path) -> None:
    with pytest.raises(InvalidValueError, match="figure"):
        save_ranking_figure(picture(), tmp_path / "missing" / "figure.png")
