"""`reproduce criteria`: the family of rules on several bodies, a line of a file per training; then a table of differences."""

from contact_curation.cli.options.types import Arguments
from contact_curation.experiments.bodies import BODIES
from contact_curation.experiments.cell_run import Row
from contact_curation.experiments.comparison.baselines import BASELINES
from contact_curation.experiments.comparison.compared import Compared, compared_row
from contact_curation.experiments.comparison.intervals import differences
from contact_curation.experiments.over_bodies import run_over_bodies
from contact_curation.learning.evaluation.bootstrap import BootstrapConfig

SIZES, SEEDS = (4, 8, 16, 32), 10
CRITERIA = ("random", "longest", "trace", "log-det", "v-optimal", "herding", "facility-location", "representative")
RULES_COMPARED = (*CRITERIA, *BASELINES)


def run_comparison(arguments: Arguments) -> int:
    """What `reproduce criteria` does; see `reproduce`."""
    return run_over_bodies(arguments, _cells(arguments), compared_row, _tables)


def _cells(arguments: Arguments) -> list[Compared]:
    """Body by body and seed by seed, so that a body's tosses are made once for all rules."""
    bodies, rules = arguments.bodies or BODIES, arguments.rules or RULES_COMPARED
    sizes, seeds = ((2,), 2) if arguments.quick else (arguments.sizes or SIZES, arguments.seeds or SEEDS)
    return [
        Compared(body, rule, size, seed)
        for body in dict.fromkeys(bodies)
        for seed in range(seeds)
        for size in dict.fromkeys(sizes)
        for rule in dict.fromkeys(rules)
    ]


def _tables(rows: list[Row]) -> dict[str, list[Row]]:
    return {"rows.csv": rows, "differences.csv": differences(rows, BootstrapConfig())}
