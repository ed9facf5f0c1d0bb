"""What it would change if the friction of bodies that slide, which needs no contact model, were an observation of a fit, too.

The friction of the tosses that slide (motion/survey/sliding.py) is the prior's mean, and its relative standard error, with
1.5 % for what the method misses, the prior's deviation; fits with fewer than five such tosses stay as they are.

    python -m benchmarks.learning.sliding_friction [--bodies cube slab irregular] [--sizes 8 16] [--save ROWS.jsonl]
    python -m benchmarks.learning.sliding_friction --restitution [...]
    python -m benchmarks.learning.sliding_friction --worlds [--seeds 4]

For each seed a third of the tosses judges (experiments/bodies.py). With --restitution it is what a restitution changes, as
`train` learns it.
With --worlds: how far the friction of sliding bodies is from the truth, in 16 tosses of the simulated worlds of
`benchmarks.learning.coverage`. Rows that are in the file already are not made again.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from unittest import mock

import numpy as np

from benchmarks._saved_rows import Row
from benchmarks.learning import coverage
from benchmarks.learning.mass_centre import compare, errors_of, print_table
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.polytope import PolytopeModel, initial_geometry
from contact_curation.contact.parameter_form import Form
from contact_curation.experiments.bodies import bench_of
from contact_curation.experiments.cell_run import ONE_THREAD, Bench
from contact_curation.geometry.quaternions import Array
from contact_curation.information.impacts import as_described
from contact_curation.learning.evaluation.misfit import sliding_of
from contact_curation.learning.fits.exact_fit import optimum, theta_0
from contact_curation.learning.fits.held_fit import HeldSum
from contact_curation.learning.training.protocols import USUAL_STARTS
from contact_curation.motion.survey.sliding import Sliding
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import transitions_of

PLAIN, SLID, BOUNCING = "as it is", "observed", "restitution"
MISSED = 0.015
HOLDS = HeldSum._holds


@contextmanager
def observed(slid: Sliding) -> Iterator[None]:
    """The prior of the friction has the standard error of the observed one."""
    variance = (slid.median_error / slid.median) ** 2 + MISSED**2

    def holds(held: HeldSum, parameters: int) -> Array:
        found = HOLDS(held, parameters)
        found[-4] = held.noise / variance  # before two tilts and the height
        return found

    with mock.patch.object(HeldSum, "_holds", holds):
        yield


def fitted(bench: Bench, tosses: Sequence[Toss], seed: int, arm: str, loss: LossConfig = ONE_THREAD) -> PolytopeModel:
    """The optimum of some tosses."""
    drawn = initial_geometry(bench.body, Form.RIGID, bench.pivot, np.random.default_rng(seed))
    start = theta_0(PolytopeModel(drawn, bench.body, Form.RIGID))
    start = start.bouncing() if arm == BOUNCING else start
    seen = transitions_of(list(tosses), bench.body.length_scale)
    data = as_described(seen, start.geometry(), bench.body)
    slid = sliding_of(tosses, bench.body) if arm == SLID else None
    if slid is None:
        return optimum(start, data, loss, 0.0, USUAL_STARTS, seen if arm == BOUNCING else None).model
    with observed(slid):
        there = replace(start.geometry(), tangents=slid.median * np.eye(2, 3))
        return optimum(PolytopeModel(there, bench.body, Form.RIGID), data, loss, 0.0, USUAL_STARTS).model


def rows_of(name: str, sizes: Sequence[int], seed: int, *, arms: tuple[str, str]) -> list[Row]:
    """Of a seed: fits of each size in both arms."""
    bench = bench_of(name, seed)
    order = np.random.default_rng([seed, 7]).permutation(len(bench.training))
    return [
        {"body": name, "size": size, "seed": seed, "arm": arm, **errors_of(model, bench, np.zeros(3))}
        for size in sizes
        for arm in arms
        for model in [fitted(bench, [bench.training[place] for place in order[:size]], seed, arm)]
    ]


def in_worlds(seeds: int) -> None:
    """Prints how far the friction of sliding bodies is from the truth [%], by seed."""
    for name, world in coverage.WORLDS.items():
        found = [sliding_of(world.tosses(coverage.LARGEST, 1000 * seed), world.body) for seed in range(seeds)]
        off = [f"{100.0 * (one.median / world.body.friction - 1.0):+.1f}" if one else "too few slide" for one in found]
        print(f"{name:20} {', '.join(off)}", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--worlds", action="store_true")
    parser.add_argument("--restitution", action="store_true")
    parser.add_argument("--seeds", type=int, default=4)
    chosen, _ = parser.parse_known_args()
    if chosen.worlds:
        in_worlds(chosen.seeds)
    else:
        arms = (PLAIN, BOUNCING if chosen.restitution else SLID)
        sys.argv = [one for one in sys.argv if one != "--restitution"]
        sys.exit(compare(partial(rows_of, arms=arms), partial(print_table, arms=arms), ["cube", "slab", "irregular"], [8, 16]))
