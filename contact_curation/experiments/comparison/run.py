"""`reproduce criteria`: the family of rules on several bodies, a line of a file per training; then a table of differences."""

from collections.abc import Sequence

import numpy as np

from contact_curation.cli.options.types import Arguments
from contact_curation.experiments.bodies import BODIES
from contact_curation.experiments.cell_run import Row
from contact_curation.experiments.comparison.baselines import BASELINES
from contact_curation.experiments.comparison.compared import COUNTERFACTUAL, Compared, compared_row
from contact_curation.experiments.comparison.intervals import AGAINST, differences
from contact_curation.experiments.comparison.page import pages_of
from contact_curation.experiments.engines import MEASURES
from contact_curation.experiments.over_bodies import run_over_bodies
from contact_curation.learning.evaluation.bootstrap import BootstrapConfig

SIZES, SEEDS = (4, 8, 16, 32), 10
CRITERIA = ("random", "longest", "trace", "log-det", "v-optimal", "herding", "facility-location", "representative")
RULES_COMPARED = (*CRITERIA, *BASELINES, COUNTERFACTUAL)


def run_comparison(arguments: Arguments) -> int:
    """What `reproduce criteria` does; see `reproduce`."""
    return run_over_bodies(arguments, _cells(arguments), compared_row, _tables)


def _cells(arguments: Arguments) -> list[Compared]:
    """Body by body and seed by seed, so that a body's tosses are made once for all rules."""
    bodies, rules = arguments.bodies or BODIES, arguments.rules or RULES_COMPARED
    usual = ((2,), 2) if arguments.quick else (SIZES, SEEDS)
    sizes, seeds = arguments.sizes or usual[0], arguments.seeds or usual[1]
    return [
        Compared(body, rule, size, seed, arguments.at_fit)
        for body in dict.fromkeys(bodies)
        for seed in range(seeds)
        for size in dict.fromkeys(sizes)
        for rule in dict.fromkeys(rules)
    ]


def _tables(rows: list[Row]) -> dict[str, Sequence[Row] | str]:
    table = differences(rows, BootstrapConfig())
    means = [_mean_over_judges(row) for row in rows]
    return {"rows.csv": rows, "differences.csv": table, "means.csv": means, "tables.md": pages_of(rows, table, AGAINST[0])}


def _mean_over_judges(row: Row) -> Row:
    """The row with a mean in place of the values of all judging tosses."""
    means = {name: f"{np.nanmean(np.array(str(row[name]).split(), dtype=float)):.6g}" for name in MEASURES}
    return {name: value for name, value in row.items() if name != "selected"} | means
