"""The figure of motions: drawn for one and two models, for motions that end early, and for no more than it can tell apart."""

import struct
from pathlib import Path

import numpy as np
import pytest

from contact_curation.dashboard.figures.motion import MotionPicture, PicturedToss, Track, save_motion_figure
from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.polytopes import box

FRAMES = 30


def track(seed: int, broken_from: int = FRAMES) -> Track:
    times = np.arange(FRAMES) / 148.0
    positions = np.column_stack([1e3 * times, 10.0 * seed * times, 140.0 - 4905.0 * times**2])
    turns = quaternions.exp(np.outer(times, [3.0, float(seed), 0.0]))
    positions[broken_from:] = np.nan
    turns[broken_from:] = np.nan
    return Track(positions, turns, 52.4 * box([1.0, 1.0, 1.0]).vertices)


def toss(*predicted: Track) -> PicturedToss:
    return PicturedToss("a toss", np.arange(FRAMES) / 148.0, track(0), predicted)


def size_of_png(path: Path) -> tuple[int, int]:
    data = path.read_bytes()
    assert data.startswith(b"\x89PNG")
    width, height = struct.unpack(">II", data[16:24])
    return width, height


@pytest.mark.parametrize(
    "picture",
    [
        MotionPicture("one", ("polytope",), (toss(track(1)),)),
        MotionPicture("two", ("polytope", "deep"), (toss(track(1), track(2)), toss(track(3), track(4)))),
        MotionPicture("broken", ("polytope",), (toss(track(1, broken_from=12)),)),
        MotionPicture("gone", ("polytope",), (toss(track(1, broken_from=0)),)),
        MotionPicture("$^$ is no formula", ("a$^$",), (toss(track(1)),)),
        MotionPicture("no text", ("a\udcff",), (toss(track(1)),)),
    ],
    ids=lambda picture: picture.title,
)
def test_it_has_a_row_for_every_toss(picture: MotionPicture, tmp_path: Path) -> None:
    save_motion_figure(picture, tmp_path / "figure.png")
    assert size_of_png(tmp_path / "figure.png") == (1600, 90 + 390 * len(picture.tosses))


def test_a_toss_that_stands_still_has_a_direction_too(tmp_path: Path) -> None:
    still = Track(np.full((FRAMES, 3), 52.4), np.tile(quaternions.IDENTITY, (FRAMES, 1)), 52.4 * box([1.0] * 3).vertices)
    picture = MotionPicture("still", ("polytope",), (PicturedToss("a toss", np.arange(FRAMES) / 148.0, still, (still,)),))
    save_motion_figure(picture, tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 10_000


@pytest.mark.parametrize("models", [(), ("a", "b", "c")])
def test_more_models_than_there_are_lines_and_none_are_refused(models: tuple[str, ...]) -> None:
    with pytest.raises(InvalidValueError, match="models"):
        MotionPicture("title", models, (toss(track(1)),))


def test_a_figure_of_nothing_is_refused() -> None:
    with pytest.raises(InvalidValueError, match="tosses"):
        MotionPicture("title", ("polytope",), ())


def test_a_place_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    with pytest.raises(InvalidValueError, match="can be written"):
        save_motion_figure(MotionPicture("one", ("polytope",), (toss(track(1)),)), tmp_path / "no" / "figure.png")
