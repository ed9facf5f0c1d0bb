"""Friction and vertices by where velocities come from: the median of three of the poses' differences, or the differences.

Tosses have filtered velocities, as ContactNets' data (`motion.smoothing`). The median takes outliers out, and spreads an impact
over frames. Fits of the rigid form to the optimum, from the same random initialisation, learn from

    filtered           the velocities of the tosses
    differences        those of the poses to the frame before, so that p' = p + dt v'
    two-frames         those of the poses to two frames before, with half the noise
    *-bounce           with a restitution that is learned, and impacts merged (`information.impacts`)

in the worlds of `benchmarks.learning.coverage`, where the truth is known, and with --real from the real cube's tosses below
400: two thirds learn, or random ones of them, and one third judges by rollouts from filtered first states, each partition with
its own rig calibration. The tosses are found through CONTACTNETS_DATA. Medians over seeds, and for the real cube mean
differences to `filtered` over partitions with 95 % intervals (Student's t; judges of partitions overlap).

    python -m benchmarks.learning.velocities [--real] [--worlds rigid_cube ...] [--velocities filtered differences ...]
                                             [--tosses 64] [--noise 1] [--seeds 5] [--save ROWS.jsonl]

--tosses 0 is all of the real ones that learn; --noise multiplies the tracker's in simulated worlds. With --save rows are kept,
and those that are there already are not made again.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import torch
from scipy.stats import t

from benchmarks._data import contactnets_folder, training_and_held_out
from benchmarks._saved_rows import Row, SavedRows
from benchmarks.learning.coverage import WORLDS, fitted
from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.experiments.cell_run import ONE_THREAD, Bench
from contact_curation.learning.evaluation.evaluation import EvaluationConfig, evaluate_model, shape_errors
from contact_curation.motion.calibration import calibration_of
from contact_curation.motion.gate_config import GateConfig
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import Transitions, by_differences, transitions_of

FRAMES = {"filtered": 0, "differences": 1, "two-frames": 2}
"""Frames that differences reach back; 0 for the tosses' own velocities."""

BOUNCE = "-bounce"
KINDS = (*FRAMES, *(f"{name}{BOUNCE}" for name in FRAMES))
REAL = "real_cube"
MEASURES = ("friction_error", "vertices_mm", "position", "rotation", "restitution")


def with_differences(data: Transitions, frames: int) -> Transitions:
    """The transitions with velocities from the poses alone, over as many frames as a toss has before its own, at most `frames`.

    The first state of a toss has the velocity of the second.
    """
    steps = by_differences(data).after[:, 7:] * data.dt[:, np.newaxis]  # (N, 6)
    sums, times = steps.copy(), data.dt.copy()
    for back in range(1, frames):
        rows = np.flatnonzero(data.index_in_toss >= back)
        sums[rows] += steps[rows - back]
        times[rows] += data.dt[rows - back]
    before, after = data.before.copy(), data.after.copy()
    after[:, 7:] = sums / times[:, np.newaxis]
    earlier = np.where(data.index_in_toss > 0, np.arange(len(data.dt)) - 1, np.arange(len(data.dt)))
    before[:, 7:] = after[earlier, 7:]
    return replace(data, before=before, after=after)


def learned(kind: str, tosses: Sequence[Toss], body: Body, seed: int) -> PolytopeModel:
    """The optimum of tosses with velocities of a kind."""
    data, frames = transitions_of(tosses, body.length_scale), FRAMES[kind.removesuffix(BOUNCE)]
    return fitted(body, with_differences(data, frames) if frames else data, seed, kind.endswith(BOUNCE), ONE_THREAD)


def partition(tosses: Sequence[Toss], seed: int) -> Bench:
    """A random third of the real tosses judges; all are corrected by the calibration of the others."""
    judging = np.random.default_rng(seed).permutation(len(tosses)) < len(tosses) // 3
    sides = ([toss for toss, judge in zip(tosses, judging, strict=True) if judge == wanted] for wanted in (False, True))
    training, held_out = (tuple(side) for side in sides)
    recorded = Bench(CONTACTNETS_CUBE, training, held_out, GateConfig())
    return recorded.on(calibration_of(recorded.training, recorded.body.polytope))


def errors_of(model: PolytopeModel) -> Row:
    """How far a model is from the truth."""
    shape, friction = shape_errors(model), model.body.friction
    assert shape is not None
    error = {"friction_error": 100.0 * (shape.friction / friction - 1.0), "vertices_mm": shape.vertex_rms_mm}
    return error | {"friction": shape.friction, "restitution": model.geometry().restitution or 0.0}


def row_of(key: Row, real: Sequence[Toss]) -> Row:
    """The row of one fit."""
    if key["world"] != REAL:
        world = WORLDS[key["world"]]
        tosses = world.tosses(key["tosses"], 1000 * key["seed"], key["noise"])
        return errors_of(learned(key["velocities"], tosses, world.body, key["seed"]))
    bench = partition(real, key["seed"])
    count = key["tosses"] or len(bench.training)
    chosen = np.random.default_rng([key["seed"], count]).choice(len(bench.training), count, replace=False)
    model = learned(key["velocities"], [bench.training[place] for place in np.sort(chosen)], bench.body, key["seed"])
    found = evaluate_model(model, bench.held_out, EvaluationConfig(loss=ONE_THREAD)).errors
    motion = {name: float(getattr(found, name)[found.finite].mean()) for name in ("position", "rotation")}
    return errors_of(model) | motion | {"not_finite": int((~found.finite).sum())}


def keys(arguments: argparse.Namespace) -> Iterator[Row]:
    """What is fitted."""
    for seed in range(arguments.seeds):
        for world in [REAL] if arguments.real else arguments.worlds:
            for kind in arguments.velocities:
                key = {"world": world, "velocities": kind, "tosses": arguments.tosses, "seed": seed}
                yield key | ({} if arguments.real else {"noise": arguments.noise})


def print_table(rows: Sequence[Row]) -> None:
    """Medians over seeds with their least and most, and mean differences to filtered velocities."""
    for world, kind in dict.fromkeys((row["world"], row["velocities"]) for row in rows):
        own = [row for row in rows if (row["world"], row["velocities"]) == (world, kind)]
        shown = [name for name in MEASURES if name in own[0]]
        cells = [(name, np.array([row[name] for row in own])) for name in shown]
        text = "  ".join(f"{name} {np.median(v):.2f} ({v.min():.2f} to {v.max():.2f})" for name, v in cells)
        print(f"{world:20}{kind:20}{len(own):3}  {text}")
        base = {row["seed"]: row for row in rows if (row["world"], row["velocities"]) == (world, next(iter(FRAMES)))}
        if kind != next(iter(FRAMES)) and len(own) > 1 and all(row["seed"] in base for row in own):
            print(f"{'':43}less filtered:  " + "  ".join(difference(name, own, base) for name in shown))


def difference(name: str, own: Sequence[Row], base: dict[int, Row]) -> str:
    """The mean paired difference with its 95 % interval."""
    off = np.array([row[name] - base[row["seed"]][name] for row in own])
    half = float(t.ppf(0.975, off.size - 1)) * off.std(ddof=1) / np.sqrt(off.size)
    return f"{name} {off.mean():+.2f} ({off.mean() - half:+.2f} to {off.mean() + half:+.2f})"


def main() -> int:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--real", action="store_true", help="the real cube's tosses instead of simulated worlds")
    parser.add_argument("--worlds", nargs="+", choices=tuple(WORLDS), default=list(WORLDS))
    parser.add_argument("--velocities", nargs="+", choices=KINDS, default=["filtered", "differences", "two-frames"])
    parser.add_argument("--tosses", type=int, default=64)
    parser.add_argument("--noise", type=float, default=1.0)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--save", type=Path)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    folder = contactnets_folder() if arguments.real else None
    if arguments.real and folder is None:
        return 0
    real = training_and_held_out(folder).training if folder else ()
    saved, rows = SavedRows(arguments.save), list[Row]()
    for key in keys(arguments):
        rows.append(saved.one(key, partial(row_of, key, real)))
    print_table(rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
