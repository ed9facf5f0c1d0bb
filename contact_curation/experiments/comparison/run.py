"""`reproduce criteria`: the family of rules on several bodies, a line of a file per training; then a table of differences."""

import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch

from contact_curation.cli.options.types import Arguments
from contact_curation.cli.progress import Progress
from contact_curation.cli.report import print_json, warn
from contact_curation.errors import ContactCurationError, InvalidValueError
from contact_curation.experiments.bodies import BODIES
from contact_curation.experiments.cell_run import Row
from contact_curation.experiments.comparison.baselines import BASELINES
from contact_curation.experiments.comparison.compared import COUNTERFACTUAL, Compared, compared_row
from contact_curation.experiments.comparison.intervals import AGAINST, MEASURES, differences
from contact_curation.experiments.comparison.page import pages_of
from contact_curation.experiments.ledger import Ledger
from contact_curation.experiments.run import make_folder
from contact_curation.experiments.tables import csv_of
from contact_curation.files import write_atomically
from contact_curation.learning.evaluation.bootstrap import BootstrapConfig
from contact_curation.pipeline.wording import counted
from contact_curation.pipeline.workers import Advance, each, unheard
from contact_curation.version import __version__

SIZES, SEEDS = (4, 8, 16, 32), 10
CRITERIA = ("random", "longest", "trace", "log-det", "v-optimal", "herding", "facility-location", "representative")
RULES_COMPARED = (*CRITERIA, *BASELINES, COUNTERFACTUAL)


class _Done(NamedTuple):
    row: Row
    error: str
    seconds: float


def run_comparison(arguments: Arguments) -> int:
    """What `reproduce criteria` does; see `reproduce`."""
    torch.set_num_threads(1)
    began = time.monotonic()
    make_folder(arguments.out)
    cells = _cells(arguments)
    ledger = Ledger(arguments.out / "cells.jsonl", {"experiment": "criteria", "package version": __version__})
    left, failed = [cell for cell in cells if cell.key not in ledger], dict[str, None]()
    with Progress("running", "cells", len(cells), len(cells) - len(left)) as bar:
        for cell, done in zip(left, each(finished, left, arguments.jobs, unheard), strict=True):
            if done.error:
                failed[f"{cell.body}: {done.error}"] = None
            else:
                ledger.add(cell.key, [done.row], done.seconds)
            bar.advance()
    rows = [{**cell.fields, **row} for cell in cells if cell.key in ledger for row in ledger.rows(cell.key)]
    if not rows:
        raise InvalidValueError("finished cells", "none", f"at least one ({next(iter(failed), 'no cell')})")
    paths = tuple(arguments.out / name for name in ("rows.csv", "differences.csv", "means.csv", "tables.md"))
    _write(rows, *paths)
    warn(list(failed))
    seconds = round(time.monotonic() - began, 1)
    if arguments.json:
        files = [str(path) for path in paths]
        print_json({"experiment": "criteria", "cells": len(cells), "run": len(left), "failed": len(failed),
                    "seconds": seconds, "files": files})  # fmt: skip
    else:
        print(f"criteria: {counted(len(rows), 'cell')} of {len(cells)}, in {seconds} s")
        print("\n".join(map(str, paths)))
    return 1 if failed else 0


def _cells(arguments: Arguments) -> list[Compared]:
    """Body by body and seed by seed, so that a body's tosses are made once for all rules."""
    bodies, rules = arguments.bodies or BODIES, arguments.rules or RULES_COMPARED
    sizes, seeds = ((2,), 2) if arguments.quick else (arguments.sizes or SIZES, arguments.seeds or SEEDS)
    return [
        Compared(body, rule, size, seed, arguments.at_fit)
        for body in dict.fromkeys(bodies)
        for seed in range(seeds)
        for size in dict.fromkeys(sizes)
        for rule in dict.fromkeys(rules)
    ]


def finished(cell: Compared, advance: Advance) -> _Done:
    """Runs one cell; in a process of its own."""
    torch.set_num_threads(1)
    began = time.process_time()
    try:
        row, error = compared_row(cell), ""
    except ContactCurationError as problem:
        row, error = {}, str(problem)
    return _Done(row, error, time.process_time() - began)


def _write(rows: list[Row], whole: Path, summary: Path, means: Path, page: Path) -> None:
    table = differences(rows, BootstrapConfig())
    write_atomically(whole, csv_of(rows))
    write_atomically(summary, csv_of(table))
    write_atomically(means, csv_of([_mean_over_judges(row) for row in rows]))
    write_atomically(page, pages_of(rows, table, AGAINST[0]).encode())


def _mean_over_judges(row: Row) -> Row:
    """The row with a mean in place of the values of all judging tosses."""
    means = {name: f"{np.nanmean(np.array(str(row[name]).split(), dtype=float)):.6g}" for name in MEASURES}
    return {name: value for name, value in row.items() if name != "selected"} | means
