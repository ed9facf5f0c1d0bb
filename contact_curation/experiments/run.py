"""The run of an experiment: tosses in, finished cells into the ledger one by one, tables and a figure out."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch

from contact_curation.cli.options.body import chosen_body
from contact_curation.cli.options.reading import inputs_of, stages_of
from contact_curation.cli.options.types import Arguments
from contact_curation.cli.progress import Progress
from contact_curation.cli.report import print_json, warn
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.models.registry import model_class
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import ContactCurationError, InvalidValueError
from contact_curation.experiments.catalogue import (
    DEFAULTS,
    QUICK_STEPS,
    AnyCell,
    Experiment,
    ExperimentConfig,
    cells_of,
    quick,
    rows_of_cell,
)
from contact_curation.experiments.cell import Planned, Protocol
from contact_curation.experiments.cell_run import Bench, Row
from contact_curation.experiments.ledger import Ledger, identity_of
from contact_curation.experiments.rules import BUDGET, PUBLIC_HELD_OUT
from contact_curation.experiments.tables import write_tables
from contact_curation.experiments.thrown.cell import ThrowsCell
from contact_curation.information.scoring import parameters_version
from contact_curation.motion.calibration import calibration_of
from contact_curation.pipeline.division import DivisionConfig, held_out_rule, learning_tosses
from contact_curation.pipeline.reading import ReadingConfig
from contact_curation.pipeline.tosses import read_tosses
from contact_curation.pipeline.wording import counted
from contact_curation.pipeline.workers import Advance, each, unheard


class _Finished(NamedTuple):
    """What became of a cell: its rows, or one line on why there are none."""

    rows: Sequence[Row]
    error: str
    seconds: float


class Failed[Cell](NamedTuple):
    """A cell without result, and one line on why."""

    cell: Cell
    error: str


def run_experiment(arguments: Arguments) -> int:
    """What `reproduce` does; see there."""
    torch.set_num_threads(1)
    began = time.monotonic()
    experiment, config = Experiment(arguments.experiment), experiment_config(arguments)
    cells = cells_of(experiment, config)
    make_folder(arguments.out)
    bench = _bench(arguments)
    ledger = Ledger(arguments.out / "cells.jsonl", _identity(experiment, bench))
    left = [cell for cell in cells if cell.key not in ledger]
    if not all(isinstance(cell, ThrowsCell) for cell in left):
        _ = bench.reference  # once here, and not again in every process
    failed = run_cells(cells, partial(_rows, bench=bench), ledger, arguments.jobs)
    written = write_tables(experiment, rows_of(cells, ledger, failed), arguments.out)
    warn([one.error for one in failed])
    report_run(arguments, len(cells), len(left), len(failed), time.monotonic() - began, written)
    return 1 if failed else 0


def run_cells[Cell: Planned](
    cells: Sequence[Cell], rows_of_cell: Callable[[Cell], Sequence[Row]], ledger: Ledger, jobs: int
) -> list[Failed[Cell]]:
    """Runs the cells that a ledger lacks, each in a process of its own, and adds their rows to it; returns those that failed.

    Args:
        cells: in the order in which they are run.
        rows_of_cell: the rows of a cell.
        ledger: of the finished ones.
        jobs: number of processes.
    """
    left, failed = [cell for cell in cells if cell.key not in ledger], list[Failed[Cell]]()
    with Progress("running", "cells", len(cells), len(cells) - len(left)) as bar:
        for cell, done in zip(left, each(partial(_finished, rows_of_cell), left, jobs, unheard), strict=True):
            if done.error:
                failed.append(Failed(cell, done.error))
            else:
                ledger.add(cell.key, done.rows, done.seconds)
            bar.advance()
    return failed


def _finished[Cell: Planned](rows_of_cell: Callable[[Cell], Sequence[Row]], cell: Cell, advance: Advance) -> _Finished:
    torch.set_num_threads(1)
    began = time.monotonic()
    try:
        rows, error = rows_of_cell(cell), ""
    except ContactCurationError as problem:
        rows, error = (), str(problem)
    return _Finished(rows, error, time.monotonic() - began)


def rows_of[Cell: Planned](cells: Sequence[Cell], ledger: Ledger, failed: Sequence[Failed[Cell]]) -> list[Row]:
    """The rows of all finished cells, each with its cell's fields.

    Raises:
        InvalidValueError: not one was finished.
    """
    rows = [{**cell.fields, **row} for cell in cells if cell.key in ledger for row in ledger.rows(cell.key)]
    if not rows:
        raise InvalidValueError("finished cells", "none", f"at least one ({failed[0].error if failed else 'no cell'})")
    return rows


def report_run(arguments: Arguments, cells: int, left: int, failed: int, seconds: float, files: Sequence[Path]) -> None:
    """Prints what was run, as lines or as JSON.

    Args:
        arguments: of `reproduce`.
        cells: of the experiment.
        left: of these, that were not finished before.
        failed: of these, that have no result.
        seconds: that it took.
        files: that were written.
    """
    report = {
        "experiment": arguments.experiment,
        "cells": cells,
        "run": left - failed,
        "failed": failed,
        "seconds": round(seconds, 1),
        "files": [str(path) for path in files],
    }
    if arguments.json:
        print_json(report)
    else:
        print(f"{arguments.experiment}: {counted(cells, 'cell')}, {report['run']} run now in {report['seconds']} s")
        print("\n".join(str(path) for path in files))


def experiment_config(arguments: Arguments) -> ExperimentConfig:
    """What the options ask for.

    Raises:
        InvalidValueError: a value that is not accepted.
    """
    default = DEFAULTS[Experiment(arguments.experiment)]
    default = quick(default) if arguments.quick else default
    model, steps = arguments.model or default.model, arguments.steps or (QUICK_STEPS if arguments.quick else BUDGET)
    exact = model_class(model).has_exact_fit(Form.PHYSICAL)
    protocol = Protocol(arguments.protocol or (Protocol.EXACT if exact else Protocol.BUDGETED))
    if arguments.steps and protocol is not Protocol.BUDGETED:
        raise InvalidValueError("--steps", f"protocol {protocol.value}", "protocol budgeted, which it belongs to")
    given = {name: getattr(arguments, name) for name in ("rules", "sizes", "shares", "worlds") if getattr(arguments, name)}
    return replace(
        default,
        model=model,
        protocol=protocol.value,
        steps=steps if protocol is Protocol.BUDGETED else 0,
        seeds=arguments.seeds or default.seeds,
        resamples=arguments.resamples or default.resamples,
        restitution=arguments.restitution,
        **{name: tuple(dict.fromkeys(values)) for name, values in given.items()},
    )


def _bench(arguments: Arguments) -> Bench:
    """Tosses that pass the gates, corrected by the rig calibration that is estimated from the training tosses.

    The gates see a pool again once faults are put into it.
    """
    body = chosen_body(arguments)
    stages = stages_of(arguments, {})
    reading = ReadingConfig(body, inputs_of(stages))
    rule = held_out_rule(arguments.held_out or PUBLIC_HELD_OUT)
    with Progress("reading", "tosses") as bar:
        read = read_tosses(arguments.inputs, reading, advance=bar.advance)
    tosses = learning_tosses(read, DivisionConfig(rule, said=True))
    warn(tosses.warnings)
    bench = Bench(body, tosses.training, tosses.held_out, stages["gates"])
    return bench if arguments.as_recorded else _calibrated(bench)


def _calibrated(bench: Bench) -> Bench:
    try:
        rig = calibration_of(bench.training, bench.body.polytope)
    except InvalidValueError as error:
        warn([f"tosses are taken as recorded: {error}"])
        return bench
    lean, off = np.degrees(rig.tilt), 100.0 * (rig.scale - 1.0)
    lengths = f"lengths {abs(off):.1f} % too {'short' if off >= 0.0 else 'long'}"
    warn([f"board tilt {lean:.2f} degrees, {lengths}: tosses are corrected (--as-recorded: not)"])
    return bench.on(rig)


def _rows(cell: AnyCell, bench: Bench) -> tuple[Row, ...]:
    if not isinstance(cell, ThrowsCell):
        return rows_of_cell(cell, bench)
    from contact_curation.experiments.thrown.designed_throws import throws_rows  # the arm takes a second to import

    return throws_rows(cell, bench)


def _identity(experiment: Experiment, bench: Bench) -> Mapping[str, str]:
    """What must be the same for rows to stand in one table, with the tosses."""
    state = sha256(repr(bench.gates).encode())
    for side in (bench.training, bench.held_out):
        state.update(f"{len(side)}".encode())
        for toss in side:
            state.update(toss.digest().encode())
    described = parameters_version(ContactGeometry.of_body(bench.body), bench.body)
    return {**identity_of(experiment.value), "body": described, "tosses": state.hexdigest()[:16]}


def make_folder(path: Path) -> None:
    """Makes the folder of the results; InvalidValueError where that is impossible."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InvalidValueError("--out", path, f"a folder that can be made ({error.strerror})") from error
