"""The pictures that the documents show, drawn from the rows in docs/results and from bags/golden.mcap.

python -m test.docs.pictures [--dashboard]          draws them again in docs/images; `make figures` does so

The dashboard's pictures, which need Chromium and a few minutes, are drawn only with `--dashboard`.
"""

import argparse
import csv
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

import contact_curation as cc
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.experiments.catalogue import Experiment
from contact_curation.experiments.cell_run import Row
from contact_curation.experiments.summary import summarised
from contact_curation.experiments.tables import LAYOUTS, save_results_figure
from contact_curation.experiments.thrown.cell import FIRM
from contact_curation.learning.evaluation.bootstrap import BootstrapConfig
from test.conftest import GOLDEN, REPOSITORY
from test.docs.learning_curves import Curve, save_learning_curves

RESULTS, IMAGES = REPOSITORY / "docs" / "results", REPOSITORY / "docs" / "images"
TRUE_CUBE = "true cube"
"""A row of online_training.csv that is no run."""

ERRORS = {"position": "position error [% of width]", "rotation": "rotation error [deg]", "loss": "held-out loss"}
TOP = 16
"""Tosses of the golden bag that are selected in the ranking's picture."""


def number(text: str) -> float | str:
    """A cell of a table."""
    try:
        return float(text)
    except ValueError:
        return text


def rows_of(name: str) -> list[Row]:
    """The rows of a table in docs/results."""
    with (RESULTS / f"{name}.csv").open(newline="") as file:
        return [{column: number(cell) for column, cell in row.items()} for row in csv.DictReader(file)]


def results(name: str, experiment: Experiment) -> Callable[[Path], None]:
    """What draws the results of an experiment in its usual world, whose rows may leave out fields that are the same in all."""

    def draw(path: Path) -> None:
        layout, rows = LAYOUTS[experiment], [row for row in rows_of(name) if row.get("world", FIRM) == FIRM]
        whole = [{**dict.fromkeys(layout.fields, ""), **row, **_off_described(row)} for row in rows]
        save_results_figure(
            experiment, summarised(whole, layout.fields, layout.measures, layout.baselines, BootstrapConfig()), path
        )

    return draw


def _off_described(row: Mapping[str, float | str]) -> Row:
    friction = row["friction"]
    off = abs(friction - CONTACTNETS_CUBE.friction) if isinstance(friction, float) else ""
    return {"friction_from_described": off}


def ranking(path: Path) -> None:
    """The golden bag, ranked."""
    cc.rank(GOLDEN, top=TOP).save_figure(path, overwrite=True)


def online_training(path: Path) -> None:
    """Held-out errors while a recording plays, of benchmarks/learning/online_training.py."""
    rows = rows_of("online_training")
    runs: dict[str, list[Curve]] = {}
    for rule, seed in dict.fromkeys((str(row["rule"]), row["seed"]) for row in rows if row["rule"] != TRUE_CUBE):
        own = [row for row in rows if (row["rule"], row["seed"]) == (rule, seed)]
        errors = {label: np.array([row[name] for row in own], dtype=float) for name, label in ERRORS.items()}
        runs.setdefault(rule, []).append(Curve(np.array([row["tosses"] for row in own], dtype=float), errors))
    true = next(row for row in rows if row["rule"] == TRUE_CUBE)
    seeds = len(next(iter(runs.values())))
    title = f"Held-out errors while a recording plays and 16 selected tosses are learned from ({seeds} random initialisations)"
    save_learning_curves(runs, title, path, {label: float(true[name]) for name, label in ERRORS.items()})


PICTURES: dict[str, Callable[[Path], None]] = {
    "ranking": ranking,
    "dataset_quality": results("dataset_quality", Experiment.DATASET_QUALITY),
    "published_protocol": results("published", Experiment.DATASET_QUALITY),
    "designed_throws": results("designed_throws", Experiment.DESIGNED_THROWS),
    "online_training": online_training,
}
"""By their names in docs/images."""


def main() -> int:
    """Draws all of them."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--dashboard", action="store_true", help="the dashboard's, too: a session in Chromium, a few minutes")
    arguments = parser.parse_args()
    for name, draw in PICTURES.items():
        draw(IMAGES / f"{name}.png")
        sys.stdout.write(f"{IMAGES / name}.png\n")
    if arguments.dashboard:
        subprocess.run([sys.executable, "-m", "test.browser.screenshot", str(IMAGES / "dashboard.png")], check=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
