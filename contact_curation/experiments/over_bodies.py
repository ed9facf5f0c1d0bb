"""Experiments over `bodies.BODIES`: a line of a file per cell, from which the same command goes on, then their tables."""

import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import torch

from contact_curation.cli.options.types import Arguments
from contact_curation.cli.progress import Progress
from contact_curation.cli.report import print_json, warn
from contact_curation.errors import ContactCurationError, InvalidValueError
from contact_curation.experiments.cell import Planned
from contact_curation.experiments.cell_run import Row
from contact_curation.experiments.ledger import Ledger
from contact_curation.experiments.run import make_folder
from contact_curation.experiments.tables import csv_of
from contact_curation.files import write_atomically
from contact_curation.pipeline.wording import counted
from contact_curation.pipeline.workers import Advance, each, unheard
from contact_curation.version import __version__

type Tables = Callable[[list[Row]], Mapping[str, Sequence[Row] | str]]
"""From an experiment's rows to the tables and pages that it writes, by the names of their files."""


class _Done(NamedTuple):
    row: Row
    error: str
    seconds: float


def run_over_bodies[Cell: Planned](
    arguments: Arguments, cells: Sequence[Cell], row_of: Callable[[Cell], Row], tables: Tables
) -> int:
    """Runs the cells that are not finished and writes the tables; the exit status is 1 where a cell failed.

    Args:
        arguments: of `reproduce`.
        cells: in the order in which they are run.
        row_of: the row of a cell, in a process of its own.
        tables: of all rows.

    Raises:
        InvalidValueError: not one cell was finished, or the folder belongs to another experiment.
    """
    torch.set_num_threads(1)
    began, experiment = time.monotonic(), arguments.experiment
    make_folder(arguments.out)
    ledger = Ledger(arguments.out / "cells.jsonl", {"experiment": experiment, "package version": __version__})
    left, failed = [cell for cell in cells if cell.key not in ledger], dict[str, None]()
    with Progress("running", "cells", len(cells), len(cells) - len(left)) as bar:
        for cell, done in zip(left, each(partial(_finished, row_of), left, arguments.jobs, unheard), strict=True):
            if done.error:
                failed[f"{cell.fields['body']}: {done.error}"] = None
            else:
                ledger.add(cell.key, [done.row], done.seconds)
            bar.advance()
    rows = [{**cell.fields, **row} for cell in cells if cell.key in ledger for row in ledger.rows(cell.key)]
    if not rows:
        raise InvalidValueError("finished cells", "none", f"at least one ({next(iter(failed), 'no cell')})")
    files = {arguments.out / name: table for name, table in tables(rows).items()}
    for path, table in files.items():
        write_atomically(path, table.encode() if isinstance(table, str) else csv_of(table))
    warn(list(failed))
    seconds, paths = round(time.monotonic() - began, 1), [str(path) for path in files]
    if arguments.json:
        print_json({"experiment": experiment, "cells": len(cells), "run": len(left), "failed": len(failed),
                    "seconds": seconds, "files": paths})  # fmt: skip
    else:
        print(f"{experiment}: {counted(len(rows), 'cell')} of {len(cells)}, in {seconds} s")
        print("\n".join(paths))
    return 1 if failed else 0


def _finished[Cell: Planned](row_of: Callable[[Cell], Row], cell: Cell, advance: Advance) -> _Done:
    torch.set_num_threads(1)
    began = time.process_time()
    try:
        row, error = row_of(cell), ""
    except ContactCurationError as problem:
        row, error = {}, str(problem)
    return _Done(row, error, time.process_time() - began)
