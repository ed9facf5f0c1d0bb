"""Experiments over `bodies.BODIES`: a line of a file per cell, from which the same command goes on, then their tables."""

import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial

import torch

from contact_curation.cli.options.types import Arguments
from contact_curation.cli.report import warn
from contact_curation.experiments.bodies import data_digest
from contact_curation.experiments.cell import Planned
from contact_curation.experiments.cell_run import Row
from contact_curation.experiments.ledger import Ledger, identity_of
from contact_curation.experiments.run import make_folder, report_run, rows_of, run_cells
from contact_curation.experiments.tables import csv_of
from contact_curation.files import write_atomically

type Tables = Callable[[list[Row]], Mapping[str, Sequence[Row] | str]]
"""From an experiment's rows to the tables and pages that it writes, by the names of their files."""


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
    began = time.monotonic()
    make_folder(arguments.out)
    ledger = Ledger(arguments.out / "cells.jsonl", identity_of(arguments.experiment))
    for body in dict.fromkeys(str(cell.fields["body"]) for cell in cells):
        if data := data_digest(body):
            ledger.belongs_to(f"data of {body}", data)
    left = sum(cell.key not in ledger for cell in cells)
    failed = run_cells(cells, partial(_rows, row_of=row_of), ledger, arguments.jobs)
    failed = [one._replace(error=f"{one.cell.fields['body']}: {one.error}") for one in failed]
    files = {arguments.out / name: table for name, table in tables(rows_of(cells, ledger, failed)).items()}
    for path, table in files.items():
        write_atomically(path, table.encode() if isinstance(table, str) else csv_of(table))
    warn(list(dict.fromkeys(one.error for one in failed)))
    report_run(arguments, len(cells), left, len(failed), time.monotonic() - began, list(files))
    return 1 if failed else 0


def _rows[Cell: Planned](cell: Cell, row_of: Callable[[Cell], Row]) -> list[Row]:
    return [row_of(cell)]
