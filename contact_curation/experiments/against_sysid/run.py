"""Cells of `reproduce against-sysid`: a fitter learns from random tosses of a body, and two engines judge what it learned.

The tosses of a size and seed are the same for all fitters. A fitter that fails is a row that says why.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from time import process_time

import numpy as np

from contact_curation.cli.options.types import Arguments
from contact_curation.errors import ContactCurationError, InvalidValueError, UnknownNameError
from contact_curation.experiments.against_sysid.fitters import COLD, FITTERS, RULES, Task
from contact_curation.experiments.bodies import BODIES, BOUNCING, bench_of
from contact_curation.experiments.cell import Planned
from contact_curation.experiments.cell_run import Bench, Row
from contact_curation.experiments.comparison.intervals import differences
from contact_curation.experiments.engines import MEASURES, judged_by_engines
from contact_curation.experiments.over_bodies import run_over_bodies
from contact_curation.learning.evaluation.bootstrap import BootstrapConfig

BOXES, SIZES, SEEDS = ("cube", "square", "slab"), (4, 8, 16, 32), 10
OURS = ("ours", "ours" + COLD)
TRUE_SHAPES = ("slab",)
"""Bodies whose truth is known, so that intervals can be held to it."""

FAILURES = (ContactCurationError, ValueError, np.linalg.LinAlgError, ArithmeticError)
"""Of a fitter; those of other libraries are not ours."""


@dataclass(frozen=True)
class Against(Planned):
    """One fit.

    Attributes:
        body: a box of `bodies.BODIES`.
        rule: one of `fitters.RULES`, a fitter and its start.
        size: how many tosses.
        seed: of the division into training and judging tosses, of the tosses to learn from, and of random starts.
    """

    body: str
    rule: str
    size: int
    seed: int

    def __post_init__(self) -> None:
        for name, accepted in (("body", BODIES), ("rule", RULES)):
            if getattr(self, name) not in accepted:
                raise UnknownNameError(name, getattr(self, name), accepted)
        if self.size < 1:
            raise InvalidValueError("--sizes", self.size, "at least 1")


def run_against_sysid(arguments: Arguments) -> int:
    """What `reproduce against-sysid` does; see `reproduce`."""
    return run_over_bodies(arguments, _cells(arguments), against_row, _tables)


def _cells(arguments: Arguments) -> list[Against]:
    """Seed by seed, so that what is done when it is stopped is a whole experiment of fewer seeds."""
    usual = ((2,), 1) if arguments.quick else (SIZES, SEEDS)
    sizes, seeds = arguments.sizes or usual[0], arguments.seeds or usual[1]
    return [
        Against(body, rule, size, seed)
        for seed in range(seeds)
        for body in dict.fromkeys(arguments.bodies or BOXES)
        for size in dict.fromkeys(sizes)
        for rule in dict.fromkeys(arguments.rules or RULES)
    ]


@lru_cache(maxsize=1)
def _bench(body: str, seed: int) -> Bench:
    return bench_of(body, seed)


def against_row(cell: Against) -> Row:
    """The cell's row; of a fitter that failed without results.

    Raises:
        ContactCurationError: the body's tosses are not there, or are too few.
    """
    bench = _bench(cell.body, cell.seed)
    if cell.size > len(bench.training):
        raise InvalidValueError("--sizes", cell.size, f"at most {len(bench.training)}, the training tosses of {cell.body}")
    drawn = np.random.default_rng([cell.seed, cell.size, 17]).choice(len(bench.training), cell.size, replace=False)
    task = Task(bench, tuple(bench.training[place] for place in np.sort(drawn)), cell.seed, cell.body in BOUNCING)
    before, began = _reset_peak(), process_time()
    try:
        found = FITTERS[cell.rule.removesuffix(COLD)](task, cell.rule.endswith(COLD))
        seconds, peak = process_time() - began, _resident("VmHWM")
        said = found.said() if cell.body in TRUE_SHAPES else {}
        judged = judged_by_engines(found.model, bench, found.contact)
    except FAILURES as error:
        return {"failed": str(error) or type(error).__name__}
    contact = dict(zip(("contact_time", "damping_ratio"), found.contact or (np.nan, np.nan), strict=True))
    memory = round(max(peak - before, 0.0), 1)
    spent: Row = {"fit_seconds": round(seconds, 4), "memory": memory, "evaluations": float(found.evaluations)}
    return {"failed": "", **judged, **said, **contact, **spent}


def _reset_peak() -> float:
    """Resets the peak of this process's memory and returns what it uses now [MiB]; NaN where Linux refuses."""
    try:
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    except OSError:
        return np.nan
    return _resident("VmRSS")


def _resident(name: str) -> float:
    lines = Path("/proc/self/status").read_text(encoding="utf-8").splitlines()
    return next(int(line.split()[1]) / 1024.0 for line in lines if line.startswith(f"{name}:"))


def _tables(rows: list[Row]) -> dict[str, Sequence[Row]]:
    judged = [row for row in rows if not row["failed"]]
    if not judged:
        raise InvalidValueError("fits", f"all {len(rows)} failed", f"at least one that did not ({rows[0]['failed']})")
    return {"rows.csv": [_means(row) for row in rows], "differences.csv": differences(judged, BootstrapConfig(), OURS)}


def _means(row: Row) -> Row:
    """With the mean over the judging tosses in place of all their values."""
    means: Row = {name: float(np.nanmean(np.array(str(row[name]).split(), dtype=float))) for name in MEASURES if name in row}
    return row | means
