"""Solves, scores and sums all transitions: how fast, how exactly, and how torch compares (method.md 4.1, 6.2).

The tosses are ContactNets', found through CONTACTNETS_DATA; without them, simulated ones. Parameters are the true ones. Beside
it, simulated tosses of bodies with other numbers of corners, on one thread.

    python -m benchmarks.speed.evaluation [--json] [--repeats N] [--plain N] [--corners K ...]
"""

import argparse
import json
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np
import torch

from benchmarks._data import contactnets_folder
from benchmarks.data.thrown_bodies import ellipsoid, uniform
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.evaluation import Cone, Estimator, Evaluation, evaluate, fisher_sums
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.transitions import Transitions, transitions_of
from test.contact.torch_evaluation import evaluate_in_torch
from test.simulated import FRAME_PERIOD, RIG_NOISE, simulated_tosses

BODY = CONTACTNETS_CUBE
GEOMETRY = ContactGeometry.of_body(BODY)
SIMULATED, OF_CORNERS = 100, 10
"""Tosses, where there are no real ones, and of each other body."""


@dataclass(frozen=True)
class Timing:
    """The best of some repetitions over all transitions."""

    work: str
    cone: str
    threads: int
    seconds: float
    microseconds_per_transition: float


@dataclass(frozen=True)
class Accuracy:
    """How well the inner problems are solved, over all transitions; the loss in characteristic units."""

    cone: str
    failures: int
    worst_residual: float
    mean_iterations: float
    most_iterations: int
    mean_loss: float


@dataclass(frozen=True)
class Comparison:
    """The kernel on one thread and torch on one thread, on the same transitions."""

    cone: str
    transitions: int
    torch_microseconds_per_transition: float
    times_slower: float
    torch_failures: int
    torch_worst_residual: float
    largest_difference_of_losses: float
    largest_difference_of_scores: float


@dataclass(frozen=True)
class OfCorners:
    """Of bodies with so many corners [us per transition], on one thread with the circular cone."""

    corners: int
    transitions: int
    scores: float
    gauss_newton: float


@dataclass(frozen=True)
class Report:
    """Everything, as --json prints it."""

    data: str
    tosses: int
    transitions: int
    timings: list[Timing]
    accuracies: list[Accuracy]
    comparisons: list[Comparison]
    bodies: list[OfCorners]


def main() -> int:
    """Prints tables, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--json", action="store_true", help="print JSON instead of tables")
    parser.add_argument("--repeats", type=int, default=5, help="repetitions of each timing (default 5)")
    parser.add_argument("--plain", type=int, default=4000, help="transitions on which torch is compared (default 4000)")
    parser.add_argument("--corners", type=int, nargs="+", default=[4, 8, 16, 32, 64], help="of the other bodies")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    name, rows = transitions()
    report = Report(
        data=name,
        tosses=len(rows.toss_ids),
        transitions=len(rows.before),
        timings=[timing(rows, work, cone, threads, arguments.repeats) for cone in Cone for work in WORK for threads in (1, 2)],
        accuracies=[accuracy(rows, cone) for cone in Cone],
        comparisons=[comparison(rows, cone, arguments.plain) for cone in Cone],
        bodies=[of_corners(count, arguments.repeats) for count in arguments.corners],
    )
    print(json.dumps(asdict(report), indent=2)) if arguments.json else print_tables(report)
    return 0


def transitions() -> tuple[str, Transitions]:
    """All transitions of the real tosses, or of simulated ones, and what they are."""
    folder = contactnets_folder()
    if folder is None:
        return "simulated", transitions_of(simulated_tosses(SIMULATED, seed=0, noise=RIG_NOISE), BODY.length_scale)
    paths = sorted(folder.glob("*.pt"), key=lambda path: int(path.stem))
    states = [torch.load(path, weights_only=True)[0, :, :13].numpy() for path in paths]
    starts = np.concatenate([[0], np.cumsum([len(each) - 1 for each in states])]).astype(np.int64)
    before, after = np.concatenate([s[:-1] for s in states]), np.concatenate([s[1:] for s in states])
    return "ContactNets", Transitions(tuple(p.stem for p in paths), before, after, np.full(len(before), FRAME_PERIOD), starts)


def scores(rows: Transitions, config: LossConfig) -> Evaluation:
    """Loss terms, impulses and a score per transition."""
    return evaluate(GEOMETRY, BODY, rows.before, rows.after, rows.dt, config)


def sums_by(estimator: Estimator) -> Callable[[Transitions, LossConfig], object]:
    """A Fisher matrix per toss."""
    return lambda rows, config: fisher_sums(
        GEOMETRY, BODY, rows.before, rows.after, rows.dt, rows.starts, estimator, config=config
    )


WORK: dict[str, Callable[[Transitions, LossConfig], object]] = {
    "scores": scores,
    "empirical Fisher": sums_by(Estimator.EMPIRICAL),
    "Gauss-Newton Fisher": sums_by(Estimator.GAUSS_NEWTON),
}


def timing(rows: Transitions, work: str, cone: Cone, threads: int, repeats: int) -> Timing:
    """The best of `repeats` runs."""
    seconds = best_of(repeats, lambda: WORK[work](rows, LossConfig(cone=cone, threads=threads)))
    return Timing(work, cone.value, threads, seconds, 1e6 * seconds / len(rows.before))


def best_of(repeats: int, job: Callable[[], object]) -> float:
    """The shortest wall time [s]."""
    times = []
    for _ in range(max(1, repeats)):
        begin = time.perf_counter()
        job()
        times.append(time.perf_counter() - begin)
    return min(times)


def accuracy(rows: Transitions, cone: Cone) -> Accuracy:
    """Over all transitions."""
    found = scores(rows, LossConfig(cone=cone))
    return Accuracy(
        cone=cone.value,
        failures=int((~found.solved).sum()),
        worst_residual=float(found.residuals.max()),
        mean_iterations=float(found.iterations.mean()),
        most_iterations=int(found.iterations.max()),
        mean_loss=float(found.losses.mean()),
    )


def comparison(rows: Transitions, cone: Cone, count: int) -> Comparison:
    """On `count` transitions drawn evenly."""
    chosen = np.unique(np.linspace(0, len(rows.before) - 1, count).astype(np.int64))
    before, after, dt, config = rows.before[chosen], rows.after[chosen], rows.dt[chosen], LossConfig(cone=cone, threads=1)
    kernel = evaluate(GEOMETRY, BODY, before, after, dt, config)
    plain = evaluate_in_torch(GEOMETRY, BODY, before, after, dt, config)
    fast = best_of(5, lambda: evaluate(GEOMETRY, BODY, before, after, dt, config))
    slow = best_of(1, lambda: evaluate_in_torch(GEOMETRY, BODY, before, after, dt, config))
    return Comparison(
        cone=cone.value,
        transitions=len(chosen),
        torch_microseconds_per_transition=1e6 * slow / len(chosen),
        times_slower=slow / fast,
        torch_failures=int((~plain.solved).sum()),
        torch_worst_residual=float(plain.residuals.max()),
        largest_difference_of_losses=largest(plain.losses - kernel.losses),
        largest_difference_of_scores=largest(plain.scores - kernel.scores),
    )


def of_corners(count: int, repeats: int) -> OfCorners:
    """On simulated tosses of an ellipsoid with so many corners."""
    body = uniform("ellipsoid", [ellipsoid(count, [0.06, 0.05, 0.04])], 900.0, 0.2).body
    config = LossConfig(threads=1)
    geometry = ContactGeometry.of_body(body).rigid()
    rows = transitions_of(simulated_tosses(OF_CORNERS, seed=0, noise=RIG_NOISE, body=body), body.length_scale)
    solved = best_of(repeats, lambda: evaluate(geometry, body, rows.before, rows.after, rows.dt, config))
    summed = best_of(
        repeats,
        lambda: fisher_sums(
            geometry, body, rows.before, rows.after, rows.dt, rows.starts, Estimator.GAUSS_NEWTON, config=config
        ),
    )
    each = 1e6 / len(rows.before)
    return OfCorners(count, len(rows.before), each * solved, each * summed)


def largest(values: Array) -> float:
    """The largest magnitude."""
    return float(np.abs(values).max())


def print_tables(report: Report) -> None:
    """For people."""
    print(f"{report.data}: {report.tosses} tosses, {report.transitions} transitions\n")
    print(f"{'work':20} {'cone':10}  threads  seconds  us per transition")
    for run in report.timings:
        print(f"{run.work:20} {run.cone:10}  {run.threads:7d}  {run.seconds:7.3f}  {run.microseconds_per_transition:17.2f}")
    print(f"\n{'cone':10}  failures  worst residual  iterations (most)  mean loss")
    for row in report.accuracies:
        iterations = f"{row.mean_iterations:.1f} ({row.most_iterations})"
        print(f"{row.cone:10}  {row.failures:8d}  {row.worst_residual:14.1e}  {iterations:>17}  {row.mean_loss:9.6f}")
    print(f"\n{'cone':10}  transitions  torch us each  times slower  failures  worst residual  loss differs  score differs")
    for pair in report.comparisons:
        differ = f"{pair.largest_difference_of_losses:12.1e}  {pair.largest_difference_of_scores:13.1e}"
        print(
            f"{pair.cone:10}  {pair.transitions:11d}  {pair.torch_microseconds_per_transition:13.1f}"
            f"  {pair.times_slower:12.1f}  {pair.torch_failures:8d}  {pair.torch_worst_residual:14.1e}  {differ}"
        )
    print("\ncorners  transitions  impulses and scores, us  with Gauss-Newton matrices, us")
    for body in report.bodies:
        print(f"{body.corners:7d}  {body.transitions:11d}  {body.scores:23.1f}  {body.gauss_newton:30.1f}")


if __name__ == "__main__":
    sys.exit(main())
