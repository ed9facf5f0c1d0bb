"""Do more throws change predicted motions as much as was said?

A polytope is fitted to n random tosses as `train` does, to the optimum from a random initialisation. `more_throws` says how far
n more tosses would change its predictions of judging tosses. Then it is fitted to these 2 n tosses, and the change is measured.
With --selected the n tosses are those that the default rule selects of 3 n random ones, in rounds, and the change is that to
the n of 6 n, which contain the 3 n; fits leave out what they explain worst, as the trainer's.

The bodies are those of `reproduce` (experiments/bodies.py): the real cube, tosses below 400 only, and bodies of MuJoCo. A third
of the tosses judges. The cube's tosses are found through CONTACTNETS_DATA.

    python -m benchmarks.learning.more_throws [--bodies cube ...] [--sizes 8 16 32] [--seeds 10] [--selected] [--save ROWS]

With --save rows are kept, and those that are there already are not made again.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch

from benchmarks._saved_rows import Row, SavedRows
from contact_curation.contact.models.polytope import PolytopeModel, initial_geometry
from contact_curation.contact.parameter_form import Form
from contact_curation.experiments.bodies import bench_of
from contact_curation.experiments.cell_run import ONE_THREAD, Bench, select
from contact_curation.experiments.rules import OURS, RULES
from contact_curation.information.impacts import as_described
from contact_curation.learning.evaluation.evaluation import EvaluationConfig
from contact_curation.learning.fits.exact_fit import optimum, theta_0
from contact_curation.learning.training.protocols import ROUND_TRIMMED
from contact_curation.learning.training.reranking import EXACT_SELECTIONS
from contact_curation.learning.uncertainty.more_throws import more_throws, motion_change
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import Transitions, transitions_of

BODIES = ("cube", "slab", "wedge", "irregular")
CONFIG = EvaluationConfig(loss=ONE_THREAD)
JUDGES = 32
"""Tosses whose motions are predicted."""

POOL = 3
"""As many times the tosses are thrown that are selected."""

MEASURES = ("position", "rotation")


def theta_0_of(bench: Bench, seed: int) -> PolytopeModel:
    """Where fits start."""
    drawn = initial_geometry(bench.body, Form.RIGID, bench.pivot, np.random.default_rng(seed))
    return theta_0(PolytopeModel(drawn, bench.body, Form.RIGID))


def data_of(tosses: Sequence[Toss], start: PolytopeModel) -> Transitions:
    """What is fitted to."""
    return as_described(transitions_of(tosses, start.body.length_scale), start.geometry(), start.body)


def fitted(tosses: Sequence[Toss], start: PolytopeModel, trimmed: float) -> PolytopeModel:
    """The optimum of some tosses."""
    return optimum(start, data_of(tosses, start), ONE_THREAD, trimmed).model


def selected(tosses: Sequence[Toss], start: PolytopeModel, size: int) -> tuple[tuple[Toss, ...], PolytopeModel]:
    """Those that the default rule keeps, each time at the optimum of the ones before, and their optimum."""
    kept: tuple[Toss, ...] = ()
    model = start
    for _ in range(EXACT_SELECTIONS):
        ids = set(select(RULES[OURS], model, tosses, size, 0))
        kept = tuple(toss for toss in tosses if toss.toss_id in ids)
        model = fitted(kept, start, ROUND_TRIMMED)
    return kept, model


def rows_of(name: str, bench: Bench, sizes: Sequence[int], seed: int, by_rule: bool) -> list[Row]:
    """What was said and what came, for each number of tosses."""
    order = np.random.default_rng([seed, 7]).permutation(len(bench.training))
    thrown, start = tuple(bench.training[place] for place in order), theta_0_of(bench, seed)
    rows, judges = list[Row](), bench.held_out[:JUDGES]
    for size in sizes:
        if by_rule:
            (now, model), (_, later) = (selected(thrown[: times * POOL * size], start, size) for times in (1, 2))
        else:
            now = thrown[:size]
            model, later = (fitted(thrown[: times * size], start, 0.0) for times in (1, 2))
        said = more_throws(model, data_of(now, start), judges, CONFIG)
        assert said is not None
        actual = dict(zip(MEASURES, motion_change(model, later, judges, CONFIG), strict=True))
        rows.append({"body": name, "size": size, "seed": seed, "selected": by_rule, **said._asdict(), "actual": actual})
    return rows


def print_table(rows: Sequence[Row]) -> None:
    """Medians over seeds, and the share of changes below the line of 95 %."""
    print(
        f"{'body':18} {'tosses':>6} {'seeds':>5} {'not said':>8}" + 2 * f"{'said':>8} {'came':>6} {'ratio':>6} {'below %':>7}"
    )
    for body in (*dict.fromkeys(row["body"] for row in rows), "all"):
        for size in sorted({row["size"] for row in rows}):
            own = [row for row in rows if row["size"] == size and body in (row["body"], "all")]
            told = [row for row in own if not row["not_determined"]]
            if told:
                cells = "".join(_cells(told, measure) for measure in MEASURES)
                print(f"{body:18} {size:6} {len(own):5} {len(own) - len(told):8}{cells}")


def _cells(rows: Sequence[Row], measure: str) -> str:
    said, most = (np.array([row[name] for row in rows]) for name in (measure, f"{measure}_95"))
    came = np.array([row["actual"][measure] for row in rows])
    ratio, below = np.median(said / came), 100.0 * np.mean(came < most)
    return f"{np.median(said):8.2f} {np.median(came):6.2f} {ratio:6.2f} {below:7.0f}"


def main() -> int:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--bodies", nargs="+", choices=BODIES, default=BODIES)
    parser.add_argument("--sizes", nargs="+", type=int, default=[8, 16, 32])
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--selected", action="store_true")
    parser.add_argument("--save", type=Path)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    saved = SavedRows(arguments.save)
    for name in arguments.bodies:
        bench = bench_of(name, 0)
        for seed in range(arguments.seeds):
            own = [row for row in saved.rows if (row["body"], row["seed"], row["selected"]) == (name, seed, arguments.selected)]
            sizes = [size for size in arguments.sizes if size not in {row["size"] for row in own}]
            made = rows_of(name, bench, sizes, seed, arguments.selected)
            print(*made, sep="\n", file=sys.stderr, flush=True)
            saved.add(made)
    print_table([row for row in saved.rows if row["selected"] == arguments.selected])
    return 0


if __name__ == "__main__":
    sys.exit(main())
