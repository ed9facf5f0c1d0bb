"""What a median of three of the velocities does to fits at the frame rates of usual cameras, against plain differences.

Tosses of the simulated worlds of `benchmarks.learning.coverage`, seen at several rates with the noise of ContactNets' rig, are
fitted as `train` does, with velocities that are filtered or not. Tosses seen at 148 Hz judge, in two engines. Errors of
friction are printed for each seed, the others are means.

    python -m benchmarks.learning.frame_rates [--worlds cube_2ms slab_4ms] [--rates 30 60 90 120 148 250] [--seeds 5]
        [--tosses 16] [--weights balanced published] [--noise 1] [--save ROWS.jsonl]

Rows that are in the file already are not made again.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from unittest import mock

import numpy as np
import torch

from benchmarks._saved_rows import Row, SavedRows
from benchmarks.learning.coverage import WORLDS
from benchmarks.learning.loss_weights import LOSSES
from benchmarks.learning.mass_centre import errors_of
from benchmarks.learning.sliding_friction import PLAIN, fitted
from contact_curation.experiments.cell_run import Bench
from contact_curation.motion import smoothing
from contact_curation.motion.gate_config import GateConfig

ARMS = {"filtered": np.inf, "differences": 0.0}
"""The longest time between frames at which velocities are filtered [s]."""

MEASURES = ("vertices_mm", "position", "rotation", "mujoco_position", "mujoco_rotation")
JUDGES = 30


def row_of(key: Row) -> Row:
    """Errors of one fit."""
    world, seed = WORLDS[key["world"]], key["seed"]
    judging = world.tosses(JUDGES, 1000 * seed + 1)
    with mock.patch.object(smoothing, "LONGEST_FILTERED", ARMS[key["arm"]]):
        tosses = replace(world, frame_period=1.0 / key["rate"]).tosses(key["tosses"], 1000 * seed, key["noise"])
    bench = Bench(world.body, tosses, judging, GateConfig())
    model = fitted(bench, tosses, seed, PLAIN, LOSSES[key["weights"]])
    found = errors_of(model, bench, np.zeros(3))
    errors = {name: float(np.nanmean(found[name])) for name in MEASURES}
    return {**errors, "friction": 100.0 * (found["friction"] / world.body.friction - 1.0)}


def print_table(rows: Sequence[Row]) -> None:
    """A line for each world, rate, noise, kind of velocities and weights of the loss."""
    print(f"{'world':20}{'Hz':>5}{'noise':>6} {'velocities':12}{'weights':10}" + "".join(f"{name:>16}" for name in MEASURES))
    names = ("world", "rate", "noise", "arm", "weights")
    for key in dict.fromkeys(tuple(row[name] for name in names) for row in rows):
        own = [row for row in rows if tuple(row[name] for name in names) == key]
        world, rate, noise, arm, weights = key
        means = "".join(f"{np.mean([row[name] for row in own]):16.2f}" for name in MEASURES)
        frictions = " ".join(f"{row['friction']:+.1f}" for row in own)
        print(f"{world:20}{rate:5}{noise:6g} {arm:12}{weights:10}{means}  friction, %: {frictions}")


def main() -> int:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--worlds", nargs="+", choices=tuple(WORLDS), default=["cube_2ms", "slab_4ms"])
    parser.add_argument("--rates", nargs="+", type=int, default=[30, 60, 90, 120, 148, 250])
    parser.add_argument("--weights", nargs="+", choices=tuple(LOSSES), default=["balanced"])
    parser.add_argument("--noise", type=float, default=1.0)
    parser.add_argument("--tosses", type=int, default=16)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--save", type=Path)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    saved, rows = SavedRows(arguments.save), list[Row]()
    for world in arguments.worlds:
        for rate in arguments.rates:
            for arm in ARMS:
                for weights in arguments.weights:
                    for seed in range(arguments.seeds):
                        key: Row = {"world": world, "rate": rate, "noise": arguments.noise, "arm": arm, "weights": weights}
                        key |= {"tosses": arguments.tosses, "seed": seed}
                        rows.append(saved.one(key, partial(row_of, key)))
    print_table(rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
