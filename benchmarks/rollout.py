"""Rolls the true cube out from the first state of every real toss: how fast, and how far from what was measured.

The errors are those of METHOD 1.11, the solver is that of 4.2. The tosses are found through CONTACTNETS_DATA.

    python -m benchmarks.rollout [--json] [--repeats N]
"""

import argparse
import json
import sys
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import torch

from benchmarks._data import contactnets_folder
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.rollout import Rollout, rollout
from contact_curation.contact.time_step import StepStatus, SweepLimits
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array

DT = 1.0 / 148.0
FRICTIONS = (0.10, 0.15, 0.18, 0.22, 0.30)
RUNS = ((1, 1e-6), (2, 1e-6), (1, 1e-8), (2, 1e-8))
"""Threads and tolerance."""


@dataclass(frozen=True)
class Timing:
    """The best of some repetitions."""

    threads: int
    tolerance: float
    seconds: float
    microseconds_per_step: float
    not_converged: int


@dataclass(frozen=True)
class Accuracy:
    """Against the measured motion; position and penetration in percent of the block's width, rotation in degrees."""

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
    tosses = read_tosses(folder)
    timings = [timing(tosses, threads, tolerance, arguments.repeats) for threads, tolerance in RUNS]
    accuracies = [accuracy(tosses, friction) for friction in FRICTIONS]
    if arguments.json:
        print(
            json.dumps(
                {"timings": [asdict(row) for row in timings], "accuracies": [asdict(row) for row in accuracies]}, indent=2
            )
        )
    else:
        print_tables(tosses, timings, accuracies)
    return 0


def read_tosses(folder: Path) -> list[Array]:
    """States (T, 13) of every toss, in half-widths, in the order of their numbers."""
    paths = sorted(folder.glob("*.pt"), key=lambda path: int(path.stem))
    return [torch.load(path, weights_only=True)[0, :, :13].numpy() for path in paths]


def replay(tosses: list[Array], friction: float, threads: int = 1, tolerance: float = 1e-6) -> Rollout:
    """The true cube from each toss's first measured state."""
    geometry = ContactGeometry.of_body(replace(CONTACTNETS_CUBE, friction=friction))
    starts, lengths = [toss[0] for toss in tosses], [len(toss) for toss in tosses]
    return rollout(geometry, CONTACTNETS_CUBE, starts, lengths, DT, SweepLimits(tolerance=tolerance), threads)


def timing(tosses: list[Array], threads: int, tolerance: float, repeats: int) -> Timing:
    """The best of `repeats` replays."""
    best, rolled = np.inf, None
    for _ in range(max(1, repeats)):
        begin = time.perf_counter()
        rolled = replay(tosses, CONTACTNETS_CUBE.friction, threads, tolerance)
        best = min(best, time.perf_counter() - begin)
    frames = sum(len(toss) - 1 for toss in tosses)
    missed = 0 if rolled is None else int(np.sum(rolled.status != StepStatus.CONVERGED))
    return Timing(threads, tolerance, best, 1e6 * best / frames, missed)


def accuracy(tosses: list[Array], friction: float) -> Accuracy:
    """METHOD 1.11 over all tosses."""
    rolled, true = replay(tosses, friction), np.concatenate(tosses)
    gaps = ContactGeometry.of_body(CONTACTNETS_CUBE).gaps(rolled.states)
    per_frame = [
        50.0 * np.linalg.norm(rolled.states[:, :3] - true[:, :3], axis=1),
        np.degrees(quaternions.angle_between(true[:, 3:7], rolled.states[:, 3:7])),
        50.0 * np.maximum(0.0, -gaps.min(axis=1)),
    ]
    counts = np.diff(rolled.starts)
    position, rotation, penetration = (np.add.reduceat(values, rolled.starts[:-1]) / counts for values in per_frame)
    means = float(position.mean()), float(rotation.mean()), float(penetration.mean())
    return Accuracy(friction, means[0], float(np.median(position)), means[1], float(np.median(rotation)), means[2])


def print_tables(tosses: list[Array], timings: list[Timing], accuracies: list[Accuracy]) -> None:
    """For people."""
    print(f"{len(tosses)} tosses, {sum(len(toss) - 1 for toss in tosses)} steps\n")
    print("threads  tolerance  seconds  us per step  not converged")
    for run in timings:
        speed = f"{run.seconds:7.3f}  {run.microseconds_per_step:11.2f}"
        print(f"{run.threads:7d}  {run.tolerance:9.0e}  {speed}  {run.not_converged:13d}")
    print("\nfriction  position % (median)  rotation deg (median)  penetration %")
    for row in accuracies:
        position, rotation = (
            f"{mean:.1f} ({median:.1f})"
            for mean, median in ((row.position_mean, row.position_median), (row.rotation_mean, row.rotation_median))
        )
        print(f"{row.friction:8.2f}  {position:>19}  {rotation:>21}  {row.penetration_mean:13.4f}")


if __name__ == "__main__":
    sys.exit(main())
