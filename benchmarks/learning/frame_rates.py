"""What a median of three of the velocities does to fits at the frame rates of usual cameras, against plain differences.

Tosses of the simulated worlds of `benchmarks.learning.coverage`, seen at several rates with the noise of ContactNets' rig, are
fitted as `train` does, with velocities that are filtered or not. Tosses seen at 148 Hz judge, in two engines. Errors of
friction are printed for each seed, the others are means.

    python -m benchmarks.learning.frame_rates [--worlds cube_2ms slab_4ms] [--rates 30 60 90 120 148 250] [--seeds 5]
        [--tosses 16] [--weights balanced published timed] [--noise 1] [--lengths 1]
        [--velocities filtered differences train] [--save ROWS.jsonl]

Filtered velocities and differences are those of each frame; with `train` both are as in training, whose transitions lead over
several frames where the tracker is noisy (`information.impacts`).
With --lengths bodies are so many times as large, and seen by the same tracker. With the weights `timed` velocities count
against gaps by the body's own time sqrt(length / gravity), as that of ContactNets' cube is to it. Rows that are in the file
already are not made again.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from math import sqrt
from pathlib import Path
from unittest import mock

import numpy as np
import torch

from benchmarks._saved_rows import Row, SavedRows
from benchmarks.learning.coverage import WORLDS
from benchmarks.learning.loss_weights import LOSSES
from benchmarks.learning.mass_centre import errors_of
from benchmarks.learning.sliding_friction import PLAIN, fitted
from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.contact.loss_config import LossConfig
from contact_curation.experiments.cell_run import ONE_THREAD, Bench
from contact_curation.information import impacts
from contact_curation.motion import smoothing
from contact_curation.motion.gate_config import GateConfig

ARMS = {
    "filtered": (np.inf, np.inf),
    "differences": (0.0, np.inf),
    "train": (smoothing.LONGEST_FILTERED, impacts.HIDDEN),
}
"""The longest time between frames at which velocities are filtered [s], and the most noise at which each frame counts."""

MEASURES = ("vertices_mm", "position", "rotation", "mujoco_position", "mujoco_rotation")
JUDGES = 30

TIMED = "timed"


def loss_of(weights: str, body: Body) -> LossConfig:
    """One of `LOSSES`, or the balanced one with velocities weighed by the body's own time."""
    if weights != TIMED:
        return LOSSES[weights]
    return replace(ONE_THREAD, match=ONE_THREAD.match * sqrt(CONTACTNETS_CUBE.scaled_gravity / body.scaled_gravity))


def larger(body: Body, times: float) -> Body:
    """The body, so many times as large, of the same density."""
    return replace(
        body,
        vertices=times * body.vertices,
        mass=times**3 * body.mass,
        inertia=times**5 * body.inertia,
        length_scale=times * body.length_scale,
    )


def row_of(key: Row) -> Row:
    """Errors of one fit."""
    world, seed = WORLDS[key["world"]], key["seed"]
    world = replace(world, body=larger(world.body, key["length"]))
    judging = world.tosses(JUDGES, 1000 * seed + 1)
    longest, hidden = ARMS[key["arm"]]
    with mock.patch.object(smoothing, "LONGEST_FILTERED", longest):
        tosses = replace(world, frame_period=1.0 / key["rate"]).tosses(key["tosses"], 1000 * seed, key["noise"])
    bench = Bench(world.body, tosses, judging, GateConfig())
    with mock.patch.object(impacts, "HIDDEN", hidden):
        model = fitted(bench, tosses, seed, PLAIN, loss_of(key["weights"], world.body))
    found = errors_of(model, bench, np.zeros(3))
    errors = {name: float(np.nanmean(found[name])) for name in MEASURES}
    return {**errors, "friction": 100.0 * (found["friction"] / world.body.friction - 1.0)}


def print_table(rows: Sequence[Row]) -> None:
    """A line for each world, length, rate, noise, kind of velocities and weights of the loss."""
    heads = f"{'world':20}{'length':>7}{'Hz':>5}{'noise':>6} {'velocities':12}{'weights':10}"
    print(heads + "".join(f"{name:>16}" for name in MEASURES))
    names = ("world", "length", "rate", "noise", "arm", "weights")
    for key in dict.fromkeys(tuple(row[name] for name in names) for row in rows):
        own = [row for row in rows if tuple(row[name] for name in names) == key]
        world, length, rate, noise, arm, weights = key
        means = "".join(f"{np.mean([row[name] for row in own]):16.2f}" for name in MEASURES)
        frictions = " ".join(f"{row['friction']:+.1f}" for row in own)
        print(f"{world:20}{length:7g}{rate:5}{noise:6g} {arm:12}{weights:10}{means}  friction, %: {frictions}")


def main() -> int:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--worlds", nargs="+", choices=tuple(WORLDS), default=["cube_2ms", "slab_4ms"])
    parser.add_argument("--rates", nargs="+", type=int, default=[30, 60, 90, 120, 148, 250])
    parser.add_argument("--weights", nargs="+", choices=(*LOSSES, TIMED), default=["balanced"])
    parser.add_argument("--velocities", nargs="+", choices=tuple(ARMS), default=["filtered", "differences"])
    parser.add_argument("--lengths", nargs="+", type=float, default=[1.0])
    parser.add_argument("--noise", type=float, default=1.0)
    parser.add_argument("--tosses", type=int, default=16)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--save", type=Path)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    saved, rows = SavedRows(arguments.save), list[Row]()
    names = ("world", "length", "rate", "arm", "weights", "seed")
    asked = (arguments.worlds, arguments.lengths, arguments.rates, arguments.velocities, arguments.weights)
    for values in product(*asked, range(arguments.seeds)):
        key: Row = {**dict(zip(names, values, strict=True)), "noise": arguments.noise, "tosses": arguments.tosses}
        rows.append(saved.one(key, partial(row_of, key)))
    print_table(rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
