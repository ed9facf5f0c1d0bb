"""`reproduce counterfactuals`: refits on random subsets, body by body, one line of a file each; then a table of the scores.

The tables have all refits that the folder has of these bodies, whatever sizes they were asked for with.
"""

import json
import time
from functools import partial
from hashlib import sha256

import torch

from contact_curation.cli.options.types import Arguments
from contact_curation.cli.progress import Progress
from contact_curation.cli.report import print_json, warn
from contact_curation.errors import ContactCurationError, InvalidValueError
from contact_curation.experiments.bodies import BODIES
from contact_curation.experiments.cell_run import Row
from contact_curation.experiments.counterfactuals.correlations import Scored, correlations, table_of
from contact_curation.experiments.counterfactuals.page import page_of
from contact_curation.experiments.counterfactuals.refitted import Laboratory, Subset
from contact_curation.experiments.counterfactuals.scores import foreseen, known_of
from contact_curation.experiments.counterfactuals.table import read_refits, write_refits
from contact_curation.experiments.ledger import Ledger, identity_of
from contact_curation.experiments.run import make_folder
from contact_curation.experiments.tables import csv_of
from contact_curation.files import write_atomically
from contact_curation.learning.evaluation.bootstrap import BootstrapConfig
from contact_curation.pipeline.wording import counted
from contact_curation.pipeline.workers import Advance, each, unheard
from contact_curation.version import __version__

SIZES, REFITS = (16, 32), 400
"""Tosses of a subset, and refits of a body, half of them of each size."""

TABLE, SCORES, PAGE = "counterfactuals.parquet", "datamodeling_scores.csv", "tables.md"


def run_counterfactuals(arguments: Arguments) -> int:
    """What `reproduce counterfactuals` does; see `reproduce`."""
    torch.set_num_threads(1)
    began = time.monotonic()
    make_folder(arguments.out)
    sizes = tuple(dict.fromkeys(arguments.sizes or SIZES))
    refits = arguments.refits or (2 * len(sizes) if arguments.quick else REFITS)
    bodies = tuple(dict.fromkeys(arguments.bodies or BODIES))
    rows, run, scores, failed = list[Row](), 0, list[Scored](), list[str]()
    for body in bodies:
        try:
            laboratory = Laboratory.of(body).prepared()
            subsets = _subsets(body, sizes, refits, len(laboratory.bench.training))
        except ContactCurationError as error:
            failed.append(f"{body}: {error}")
            continue
        ledger = Ledger(arguments.out / f"{body}.jsonl", _identity(laboratory))
        run += _refit(laboratory, [one for one in subsets if one.key not in ledger], ledger, arguments.jobs, len(subsets))
        known, tosses = known_of(laboratory), len(laboratory.bench.training)
        rows += [
            {**one.fields, **row, **{f"foreseen_{name}": value for name, value in foreseen(known, one.places(tosses)).items()}}
            for one in (Subset(**json.loads(key)) for key in ledger.keys)
            for row in ledger.rows(one.key)
        ]
        write_refits(rows, {"package version": __version__}, arguments.out / TABLE)
        stored = [row for row in read_refits(arguments.out / TABLE) if row["body"] == body]
        scores += correlations(stored, BootstrapConfig())
        table = table_of(scores, BootstrapConfig())
        write_atomically(arguments.out / SCORES, csv_of(table))
        write_atomically(arguments.out / PAGE, page_of(table).encode())
    if not rows:
        raise InvalidValueError("refits", "none", f"at least one ({failed[0] if failed else 'no body'})")
    without = [row for row in rows if row["failed"]]
    warn(failed + [f"{row['body']}, {row['size']:.0f} tosses, draw {row['draw']:.0f}: {row['failed']}" for row in without])
    spent = sum(float(row["fit_seconds"]) + float(row["judge_seconds"]) for row in rows) / len(rows)
    report = {
        "experiment": "counterfactuals",
        "refits": len(rows),
        "run": run,
        "failed": len(failed),
        "failed_refits": len(without),
        "processor_seconds_per_refit": round(spent, 3),
        "seconds": round(time.monotonic() - began, 1),
        "files": [str(arguments.out / name) for name in (TABLE, SCORES, PAGE)],
    }
    if arguments.json:
        print_json(report)
    else:
        print(f"counterfactuals: {counted(len(rows), 'refit')} ({spent:.2f} s of processor time each), {run} run now")
        print("\n".join(str(arguments.out / name) for name in (TABLE, SCORES, PAGE)))
    return 1 if failed else 0


def _subsets(body: str, sizes: tuple[int, ...], refits: int, tosses: int) -> list[Subset]:
    """Draw by draw, so that what is done when it is stopped has as many of each size."""
    if max(sizes) > tosses or min(sizes) < 1:
        raise InvalidValueError("--sizes", f"{min(sizes)} to {max(sizes)}", f"1 to {tosses}, the training tosses of {body}")
    return [Subset(body, size, draw) for draw in range(-(-refits // len(sizes))) for size in sizes]


def _refit(laboratory: Laboratory, left: list[Subset], ledger: Ledger, jobs: int, total: int) -> int:
    """Makes refits, each a line of the file as soon as it is done; returns how many."""
    with Progress("refitting", "subsets", total, total - len(left)) as bar:
        for subset, row in zip(left, each(partial(refit_of, laboratory), left, jobs, unheard), strict=True):
            ledger.add(subset.key, [row], float(row["fit_seconds"]) + float(row["judge_seconds"]))
            bar.advance()
    return len(left)


def refit_of(laboratory: Laboratory, subset: Subset, advance: Advance) -> Row:
    """The row of a subset; in a process of its own."""
    torch.set_num_threads(1)
    return laboratory.row(subset)


def _identity(laboratory: Laboratory) -> dict[str, str]:
    """What must be the same for rows to stand in one table."""
    state = sha256()
    for side in (laboratory.bench.training, laboratory.bench.held_out):
        state.update(f"{len(side)}".encode())
        for toss in side:
            state.update(toss.digest().encode())
    return {**identity_of("counterfactuals"), "tosses": state.hexdigest()[:16]}
