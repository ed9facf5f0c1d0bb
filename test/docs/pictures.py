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
from tempfile import TemporaryDirectory

import numpy as np

from contact_curation.cli.main import main as contact_curation
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.dashboard.figures.learning_curves import Curve, save_learning_curves
from contact_curation.experiments.catalogue import Experiment
from contact_curation.experiments.cell_run import Row
from contact_curation.experiments.tables import LAYOUTS, save_results_figure
from contact_curation.experiments.summary import summarised
from contact_curation.learning.evaluation.bootstrap import BootstrapConfig
from test.conftest import GOLDEN, REPOSITORY

RESULTS, IMAGES = REPOSITORY / "docs" / "results", REPOSITORY / "docs" / "images"
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
    """What draws the results of an experiment, whose rows may leave out fields that are the same in all."""

    def draw(path: Path) -> None:
        layout, rows = LAYOUTS[experiment], rows_of(name)
        whole = [{**dict.fromkeys(layout.fields, ""), **row, **_off_described(row)} for row in rows]
        save_results_figure(experiment, summarised(whole, layout.fields, layout.measures, layout.baselines, BootstrapConfig()), path)

    return draw


def _off_described(row: Mapping[str, float | str]) -> Row:
    friction = row["friction"]
    off = abs(friction - CONTACTNETS_CUBE.friction) if isinstance(friction, float) else ""
    return {"friction_from_described": off}


def ranking(path: Path) -> None:
    """The golden bag, ranked."""
    with TemporaryDirectory() as folder:
        manifest = str(Path(folder) / "manifest.json")
        contact_curation(["rank", str(GOLDEN), "--top", str(TOP), "--out", manifest, "--figure", str(path)])


PICTURES: dict[str, Callable[[Path], None]] = {
    "ranking": ranking,
    "dataset_quality": results("dataset_quality", Experiment.DATASET_QUALITY),
    "published_protocol": results("published", Experiment.DATASET_QUALITY),
    "designed_throws": results("designed_throws", Experiment.DESIGNED_THROWS),
}
"""By their names in docs/images."""
