"""Every figure that the package draws, and one of the docs, from small data, and how a picture is compared with the kept one.

python -m test.dashboard.gallery          draws the kept pictures in test/dashboard/references again: look at them

Pictures are compared as small grey ones, tile by tile: what another FreeType or CPU does at the edges of letters is far less
than another word or curve, which changes its tile however large the picture is.
"""

import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from contact_curation.dashboard.figures.body import BodyPicture, save_body_figure
from contact_curation.dashboard.figures.experiment import Panel, Series, save_experiment_figure
from contact_curation.dashboard.figures.motion import MotionPicture, PicturedToss, Track, save_motion_figure
from contact_curation.dashboard.figures.ranking import RankingPicture, save_ranking_figure
from contact_curation.dashboard.figures.report_data import ReportData, ReportedEvent, ReportedThrow, save_figures
from contact_curation.geometry import quaternions
from contact_curation.geometry.polytopes import box
from test.docs.learning_curves import Curve, save_learning_curves

REFERENCES = Path(__file__).parent / "references"
SMALLER = 2
"""Kept pictures have so many times fewer dots a side."""

LEVEL = 15
"""Of 255: the steps of grey in kept pictures."""

TILE = 12
"""[dots] of a kept picture, a side."""

TOLERANCE = 10.0
"""Of 255, the mean difference of a tile; rounding to a `LEVEL` makes at most 7.5."""

POSITION = "position error [% of width]"


def ranking(path: Path) -> None:
    """Gains over many decades, rejected tosses."""
    count, selected = 40, 8
    scores = 4.0 * np.exp(-0.1 * np.arange(count))
    gains = 2000.0 * np.exp(-0.9 * np.arange(count))
    shares = {"vertices_normal": (0.8, 0.7), "friction": (0.2, 0.3)}
    outcomes = (("selected", selected), ("not selected", count - selected), ("displacement beside the velocity", 3))
    spectrum = np.geomspace(0.02, 1.4, 52)
    picture = RankingPicture("40 tosses ranked", "log-det", scores, gains, selected, spectrum, 0.98, shares, outcomes)
    save_ranking_figure(picture, path)


def ranking_of_both_signs(path: Path) -> None:
    """Scores over many decades of both signs; all tosses are selected; no blocks."""
    scores = np.concatenate([np.geomspace(1e3, 1.0, 20), -np.geomspace(1.0, 1e6, 20)])
    outcomes = (("selected", 40), ("not selected", 0))
    everything = RankingPicture("40 of 40", "representative", scores, np.ones(40), 40, np.ones(9), 0.0, {}, outcomes)
    save_ranking_figure(everything, path)


def motion(path: Path) -> None:
    """Two models, of which one ends early."""
    times = np.arange(60) / 148.0

    def track(turn: float, shift: float, until: int = 60) -> Track:
        heights = 52.4 + np.abs(120.0 * np.cos(14.0 * times)) * np.exp(-5.0 * times)
        positions = np.column_stack([900.0 * times + shift * times, shift * times, heights])
        positions[until:] = np.nan
        return Track(positions, quaternions.exp(np.outer(times, [0.0, turn, 0.0])), 52.4 * box([1.0, 1.0, 1.0]).vertices)

    toss = PicturedToss(
        "median: toss 7, off by 4.1 % and 9 %", times, track(6.0, 0.0), (track(5.0, 80.0), track(4.0, -150.0, 40))
    )
    save_motion_figure(MotionPicture("Predicted and measured motion of cube", ("polytope", "deep"), (toss,)), path)


def experiment(path: Path) -> None:
    """Rules over numbers, given in disorder, with a level; as many panels as leave a place for the legend."""

    def series(name: str, scale: float) -> Series:
        values = scale / np.array([5.5, 16.0, 5.0])
        return Series(name, [8.0, 16.0, 4.0], values, 0.8 * values, 1.3 * values, name == "representative")

    rules = (series("random", 90.0), series("representative", 60.0), series("longest", 80.0))
    names = ("position error [% of width]", "rotation error [deg]", "vertices off the described body [mm RMS]", "friction off")
    panels = [Panel(name, rules, logarithmic=True, level=3.0, level_name="all tosses") for name in names]
    save_experiment_figure(panels, "Errors after learning: medians over 10 seeds with 95 % intervals", "selected tosses", path)


def experiment_over_faults(path: Path) -> None:
    """Rules over categories."""
    faults = ["clean", "spike 5 %", "drift 5 %"]

    def series(rule: str, least: float) -> Series:
        values = least + np.arange(3.0)
        return Series(rule, faults, values, values - 1.0, values + 2.0, rule == "representative")

    rules = (series("random", 12.0), series("representative", 10.0))
    panels = [
        Panel("position error [%]", rules),
        Panel("found / predicted", rules, level=1.0, level_name="as predicted", aim=1.0),
    ]
    save_experiment_figure(panels, "Errors after learning from a faulty pool", "fault and share of bad tosses", path)


def learning_curves(path: Path) -> None:
    """Two runs of one rule, one of another, and a level."""

    def curve(scale: float) -> Curve:
        places = np.array([0.0, 20.0, 50.0, 100.0])
        return Curve(
            places, {"position error [% of width]": scale * np.exp(-places / 25.0) + 15.0, "loss": scale / (1.0 + places)}
        )

    runs = {"representative": [curve(400.0), curve(90.0)], "random": [curve(700.0)]}
    save_learning_curves(runs, "Held-out errors while a recording plays", path, {POSITION: 14.0})


def body(path: Path) -> None:
    """A pyramid whose centre of mass is not the tracked frame's origin."""
    corners = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.08, 0.0], [0.1, 0.08, 0.0], [0.03, 0.03, 0.05]])
    center = np.array([0.05, 0.04, 0.015])
    save_body_figure(BodyPicture("pyramid", corners - center, center, 0.2, np.diag([1e-4, 2e-4, 3e-4])), path)


STORY = ReportData(
    title="Session of 4 throws",
    facts=[],
    throws=[
        ReportedThrow(1, "exploration", None, None, ""),
        ReportedThrow(2, "exploration", None, 3.0, ""),
        ReportedThrow(3, "designed", 8.0, 5.0, ""),
        ReportedThrow(4, "designed", 6.0, 4.5, ""),
    ],
    ranking=[],
    rejected=[],
    events=[
        ReportedEvent(0.0, "started", "curator"),
        ReportedEvent(1.0, "started", "trainer"),
        ReportedEvent(5.0, "died", "curator", "signal SIGKILL"),
        ReportedEvent(6.0, "restarted", "curator"),
        ReportedEvent(10.0, "stopped", "curator", "status 0"),
    ],
    seconds=12.0,
    errors={POSITION: np.array([80.0, 30.0, 20.0]), "held-out loss": np.array([0.8, 0.1, 0.02])},
    throws_then=np.array([1, 2, 4]),
    spectrum=np.array([0.4, 1.1, 1.6]),
    epsilon=0.6,
)


def report(name: str) -> Callable[[Path], None]:
    """One of the figures of a session's report."""

    def draw(path: Path) -> None:
        with TemporaryDirectory() as folder:
            save_figures(STORY, Path(folder))
            path.write_bytes((Path(folder) / f"{name}.png").read_bytes())

    return draw


FIGURES: dict[str, Callable[[Path], None]] = {
    "ranking": ranking,
    "ranking_of_both_signs": ranking_of_both_signs,
    "motion": motion,
    "experiment": experiment,
    "experiment_over_faults": experiment_over_faults,
    "learning_curves": learning_curves,
    "body": body,
    **{f"report_{name}": report(name) for name in ("held_out", "gains", "spectrum", "nodes")},
}
"""By name, what draws each into a PNG file."""


def small(path: Path) -> Image.Image:
    """A picture as it is kept: grey, and smaller."""
    picture = Image.open(path).convert("L")
    return picture.reduce(SMALLER)


def largest_difference(one: Image.Image, other: Image.Image) -> float:
    """Of two small pictures, the mean difference of the tile that differs most, of 255; of unequal sizes 255."""
    if one.size != other.size:
        return 255.0
    difference = np.abs(np.asarray(one, dtype=float) - np.asarray(other, dtype=float))
    return float(_tiles(difference).max())


def _tiles(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Means over tiles; the rest at the edges is a tile, too."""
    rows, columns = (-(-side // TILE) for side in values.shape)
    padded = np.zeros((rows * TILE, columns * TILE))
    padded[: values.shape[0], : values.shape[1]] = values
    return np.asarray(padded.reshape(rows, TILE, columns, TILE).mean(axis=(1, 3)))


def main() -> int:
    """Draws the kept pictures."""
    REFERENCES.mkdir(exist_ok=True)
    with TemporaryDirectory() as folder:
        for name, draw in FIGURES.items():
            draw(Path(folder) / "figure.png")
            few = np.round(np.asarray(small(Path(folder) / "figure.png")) / LEVEL).clip(max=255 // LEVEL) * LEVEL
            kept = Image.fromarray(few.astype(np.uint8)).quantize(256 // LEVEL, dither=Image.Dither.NONE)
            kept.save(REFERENCES / f"{name}.png", optimize=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
