"""Rolls motions out from the first state of every real toss, with every model and with MuJoCo: how fast, and how far from it.

The errors are those of method.md 1.11, the solver is that of 4.2. MuJoCo's world is the one that `sim_arm` and `simulate` use,
and once more with MuJoCo's own softness of contacts ("its own"). The polytope is the true cube; the networks have their
published size and random initialisation, for their time does not depend on what they learned. torch works on one thread. The
tosses are found through CONTACTNETS_DATA.

    python -m benchmarks.speed.rollout [--json] [--repeats N]
"""

import argparse
import json
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import torch

from benchmarks._data import contactnets_folder
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.models.deep import DeepModel
from contact_curation.contact.models.deepvertex import DeepvertexModel
from contact_curation.contact.models.end_to_end import EndToEndModel
from contact_curation.contact.models.model import Model, Rows
from contact_curation.contact.parameter_form import Form
from contact_curation.contact.rollout import Rollout, rollout
from contact_curation.contact.time_step import StepStatus, SweepLimits
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.evaluation.motion_errors import motion_errors
from contact_curation.simulation.world import DEFAULT_WORLD, MUJOCO_DEFAULTS, WorldConfig, free_motion

DT = 1.0 / 148.0
FRICTIONS = (0.10, 0.15, 0.18, 0.22, 0.30)
RUNS = ((1, 1e-6), (2, 1e-6), (1, 1e-8), (2, 1e-8))
"""Threads and tolerance."""
TOLERANCE = 1e-6
NETWORK_THREADS = (1, 2)
HALF_WIDTH = CONTACTNETS_CUBE.length_scale
SCALES = np.array([HALF_WIDTH] * 3 + [1.0] * 4 + [HALF_WIDTH] * 3 + [1.0] * 3)
"""A state in characteristic lengths times this is one in SI units."""


@dataclass(frozen=True)
class Timing:
    """The best of some repetitions; MuJoCo has no tolerance of ours."""

    model: str
    threads: int
    tolerance: float | None
    seconds: float
    microseconds_per_step: float
    not_converged: int


@dataclass(frozen=True)
class Accuracy:
    """Against the measured motion; position and penetration in percent of the block's width, rotation in degrees."""

    engine: str
    friction: float
    position_mean: float
    position_median: float
    rotation_mean: float
    rotation_median: float
    penetration_mean: float


def main() -> int:
    """Prints a table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument("--repeats", type=int, default=5, help="repetitions of each timing (default 5)")
    arguments = parser.parse_args()
    folder = contactnets_folder()
    if folder is None:
        return 0
    torch.set_num_threads(1)
    tosses = read_tosses(folder)
    timings = [*polytope_timings(tosses, arguments.repeats), *network_timings(tosses, arguments.repeats)]
    timings.append(mujoco_timing(tosses, arguments.repeats))
    frames = np.concatenate(tosses)
    accuracies = [accuracy(tosses, "ours", friction, replay(tosses, friction).states) for friction in FRICTIONS]
    for engine, world in (("MuJoCo", DEFAULT_WORLD), ("its own", MUJOCO_DEFAULTS)):
        accuracies += [accuracy(tosses, engine, CONTACTNETS_CUBE.friction, moved_by_mujoco(tosses, world))]
    accuracies += [accuracy(tosses, "the data", CONTACTNETS_CUBE.friction, frames)]
    if arguments.json:
        rows = {"timings": [asdict(row) for row in timings], "accuracies": [asdict(row) for row in accuracies]}
        print(json.dumps(rows, indent=2))
    else:
        print_tables(tosses, timings, accuracies)
    return 0


def read_tosses(folder: Path) -> list[Array]:
    """States (T, 13) of every toss, in half-widths, in the order of their numbers."""
    paths = sorted(folder.glob("*.pt"), key=lambda path: int(path.stem))
    return [torch.load(path, weights_only=True)[0, :, :13].numpy() for path in paths]


def polytope_timings(tosses: list[Array], repeats: int) -> list[Timing]:
    """The true cube by the polytope's own kernel."""
    mu = CONTACTNETS_CUBE.friction
    return [
        timing(tosses, "polytope", threads, tolerance, repeats, partial(replay, tosses, mu, threads, tolerance))
        for threads, tolerance in RUNS
    ]


def network_timings(tosses: list[Array], repeats: int) -> list[Timing]:
    """The networks, from the same states."""
    first, lengths = [toss[0] for toss in tosses], [len(toss) for toss in tosses]
    return [
        timing(tosses, model.kind, threads, TOLERANCE, repeats, partial(roll_out, model, first, lengths, threads))
        for model in networks(tosses)
        for threads in NETWORK_THREADS
    ]


def roll_out(model: Model, first: list[Array], lengths: list[int], threads: int) -> Rollout:
    """Any model's rollout."""
    return model.roll_out(first, lengths, DT, SweepLimits(tolerance=TOLERANCE), threads)


def networks(tosses: list[Array]) -> tuple[Model, ...]:
    """As published, untrained, about the true cube."""
    rng, cube = np.random.default_rng(0), ContactGeometry.of_body(CONTACTNETS_CUBE)
    before, after = (np.concatenate([toss[part] for toss in tosses]) for part in (slice(None, -1), slice(1, None)))
    rows = Rows(before, after, np.full(len(before), DT))
    return (
        DeepModel(cube, CONTACTNETS_CUBE, Form.CONTACTNETS).initialise(rng),
        DeepvertexModel(cube.vertices_normal, CONTACTNETS_CUBE).initialise(rows, rng),
        EndToEndModel(CONTACTNETS_CUBE).initialise(rows, rng),
    )


def mujoco_timing(tosses: list[Array], repeats: int) -> Timing:
    """The engine beside ours, one toss after the other."""
    return timing(tosses, "MuJoCo", 1, None, repeats, partial(moved_by_mujoco, tosses))


def moved_by_mujoco(tosses: list[Array], world: WorldConfig = DEFAULT_WORLD) -> Array:
    """All tosses' motions (N, 13) in half-widths."""
    moved = [free_motion(CONTACTNETS_CUBE, toss[0] * SCALES, len(toss), DT, world) for toss in tosses]
    return np.asarray(np.concatenate(moved) / SCALES)


def replay(tosses: list[Array], friction: float, threads: int = 1, tolerance: float = 1e-6) -> Rollout:
    """The true cube from each toss's first measured state."""
    geometry = ContactGeometry.of_body(replace(CONTACTNETS_CUBE, friction=friction))
    starts, lengths = [toss[0] for toss in tosses], [len(toss) for toss in tosses]
    return rollout(geometry, CONTACTNETS_CUBE, starts, lengths, DT, SweepLimits(tolerance=tolerance), threads)


def timing(
    tosses: list[Array],
    model: str,
    threads: int,
    tolerance: float | None,
    repeats: int,
    work: Callable[[], Rollout | Array],
) -> Timing:
    """The best of `repeats` times of all tosses."""
    best, missed = np.inf, 0
    for _ in range(max(1, repeats)):
        begin = time.perf_counter()
        rolled = work()
        best = min(best, time.perf_counter() - begin)
        missed = int(np.sum(rolled.status != StepStatus.CONVERGED)) if isinstance(rolled, Rollout) else 0
    steps = sum(len(toss) - 1 for toss in tosses)
    return Timing(model, threads, tolerance, best, 1e6 * best / steps, missed)


def accuracy(tosses: list[Array], engine: str, friction: float, predicted: Array) -> Accuracy:
    """method.md 1.11 over all tosses."""
    starts = np.cumsum([0, *map(len, tosses)])
    errors = motion_errors(predicted, np.concatenate(tosses), starts, CONTACTNETS_CUBE)
    means = float(errors.position.mean()), float(errors.rotation.mean()), float(errors.penetration.mean())
    medians = float(np.median(errors.position)), float(np.median(errors.rotation))
    return Accuracy(engine, friction, means[0], medians[0], means[1], medians[1], means[2])


def print_tables(tosses: list[Array], timings: list[Timing], accuracies: list[Accuracy]) -> None:
    """For people."""
    print(f"{len(tosses)} tosses, {sum(len(toss) - 1 for toss in tosses)} steps\n")
    print("model       threads  tolerance  seconds  us per step  not converged")
    for run in timings:
        tolerance = "-" if run.tolerance is None else f"{run.tolerance:.0e}"
        speed = f"{run.seconds:7.3f}  {run.microseconds_per_step:11.2f}"
        print(f"{run.model:10s}  {run.threads:7d}  {tolerance:>9}  {speed}  {run.not_converged:13d}")
    print("\nengine    friction  position % (median)  rotation deg (median)  penetration %")
    for row in accuracies:
        position, rotation = (
            f"{mean:.1f} ({median:.1f})"
            for mean, median in ((row.position_mean, row.position_median), (row.rotation_mean, row.rotation_median))
        )
        print(f"{row.engine:8s}  {row.friction:8.2f}  {position:>19}  {rotation:>21}  {row.penetration_mean:13.4f}")


if __name__ == "__main__":
    sys.exit(main())
