"""Do more throws change predicted motions as much as was said?

A polytope is fitted to n random tosses as `train` does, to the optimum from a random initialisation. `more_throws` says how far
n more tosses would change its predictions of judging tosses. Then it is fitted to these 2 n tosses, and the change is measured.
The bodies are those of `reproduce` (experiments/bodies.py): the real cube, tosses below 400 only, and bodies of MuJoCo. A third
of the tosses judges. The cube's tosses are found through CONTACTNETS_DATA.

    python -m benchmarks.learning.more_throws [--bodies cube ...] [--sizes 8 16 32] [--seeds 10] [--save ROWS.jsonl]

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
from contact_curation.experiments.cell_run import ONE_THREAD, Bench
from contact_curation.learning.evaluation.evaluation import EvaluationConfig
from contact_curation.learning.fits.exact_fit import optimum, theta_0
from contact_curation.learning.uncertainty.more_throws import more_throws, motion_change
from contact_curation.motion.transitions import transitions_of

BODIES = ("cube", "slab", "wedge", "irregular")
CONFIG = EvaluationConfig(loss=ONE_THREAD)
JUDGES = 32
"""Tosses whose motions are predicted."""

MEASURES = ("position", "rotation")


def fitted(bench: Bench, order: Sequence[int], seed: int) -> PolytopeModel:
    """The optimum of some training tosses."""
    drawn = initial_geometry(bench.body, Form.RIGID, bench.pivot, np.random.default_rng(seed))
    start = theta_0(PolytopeModel(drawn, bench.body, Form.RIGID))
    data = transitions_of([bench.training[place] for place in order], bench.body.length_scale)
    return optimum(start, data, ONE_THREAD, 0.0).model


def rows_of(name: str, bench: Bench, sizes: Sequence[int], seed: int) -> list[Row]:
    """What was said and what came, for each number of tosses."""
    order = np.random.default_rng([seed, 7]).permutation(len(bench.training)).tolist()
    models = {size: fitted(bench, order[:size], seed) for size in sorted({*sizes, *(2 * size for size in sizes)})}
    rows, judges = list[Row](), bench.held_out[:JUDGES]
    for size in sizes:
        data = transitions_of([bench.training[place] for place in order[:size]], bench.body.length_scale)
        said = more_throws(models[size], data, judges, CONFIG)
        assert said is not None
        actual = dict(zip(MEASURES, motion_change(models[size], models[2 * size], judges, CONFIG), strict=True))
        rows.append({"body": name, "size": size, "seed": seed, **said._asdict(), "actual": actual})
    return rows


def print_table(rows: Sequence[Row]) -> None:
    """Medians over seeds, and the share of changes below the line of 95 %."""
    print(
        f"{'body':10} {'tosses':>6} {'seeds':>5} {'not said':>8}" + 2 * f"{'said':>8} {'came':>6} {'ratio':>6} {'below %':>7}"
    )
    for body in (*BODIES, "all"):
        for size in sorted({row["size"] for row in rows}):
            own = [row for row in rows if row["size"] == size and body in (row["body"], "all")]
            told = [row for row in own if not row["not_determined"]]
            if told:
                cells = "".join(_cells(told, measure) for measure in MEASURES)
                print(f"{body:10} {size:6} {len(own):5} {len(own) - len(told):8}{cells}")


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
    parser.add_argument("--save", type=Path)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    saved = SavedRows(arguments.save)
    for name in arguments.bodies:
        bench = bench_of(name, 0)
        for seed in range(arguments.seeds):
            done = {row["size"] for row in saved.rows if (row["body"], row["seed"]) == (name, seed)}
            made = rows_of(name, bench, [size for size in arguments.sizes if size not in done], seed)
            print(*made, sep="\n", file=sys.stderr, flush=True)
            saved.add(made)
    print_table(saved.rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
