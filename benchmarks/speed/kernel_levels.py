"""How fast each level of the compiled kernel works, and how another checkout's kernel compares with it.

The levels give the same bytes (test/kernel/test_levels.py), so only their speed differs. Each level is a process of its own.
The processes work in turn, one short repetition each, so that a busy machine slows all of them alike; a ratio is the median
over the repetitions of the ratios of neighbours. Times are of the processor.

    python -m benchmarks.speed.kernel_levels [--json] [--repeats N] [--against CHECKOUT]

CHECKOUT is the root of another checkout with a built kernel. The tosses are ContactNets', found through CONTACTNETS_DATA;
without them, simulated ones.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from contact_curation.motion.transitions import Transitions

REPOSITORY = Path(__file__).resolve().parents[2]
TRANSITIONS = 8000
STEPS = 200
"""Of a training in one run, each down one transition."""
SHORTEST = 0.05
"""Seconds that one repetition lasts at least."""


@dataclass(frozen=True)
class Row:
    """One kind of work by one level.

    Attributes:
        work: what was done.
        kernel: the level, or "against" for the other checkout's kernel.
        milliseconds: median over the repetitions.
        ratio: median over the repetitions of this time divided by the other checkout's, or by the highest level's.
    """

    work: str
    kernel: str
    milliseconds: float
    ratio: float


def main() -> int:
    """Prints a table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument("--repeats", type=int, default=15, help="repetitions of each timing (default 15)")
    parser.add_argument("--against", type=Path, help="root of another checkout with a built kernel")
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.worker:
        return work_on_request()
    rows = compare(arguments.repeats, arguments.against)
    print(json.dumps([asdict(row) for row in rows], indent=2)) if arguments.json else print_table(rows)
    return 0


def compare(repeats: int, against: Path | None) -> list[Row]:
    """Times of every kind of work by every level, and by the other checkout's kernel."""
    from contact_curation.solver.compiled import usable_levels

    workers = {level: worker(REPOSITORY, level) for level in usable_levels()}
    base = next(iter(workers))
    if against is not None:
        base = "against"
        workers[base] = worker(against.resolve(), None)
    names = next(iter([json.loads(answer(one)) for one in workers.values()]))
    rows = []
    for name in names:
        times: dict[str, list[float]] = {kernel: [] for kernel in workers}
        for repeat in range(repeats + 1):
            for kernel, one in workers.items():
                seconds = float(ask(one, name))
                if repeat:  # the first one warms up
                    times[kernel].append(seconds)
        for kernel, own in times.items():
            ratio = statistics.median(mine / other for mine, other in zip(own, times[base], strict=True))
            rows.append(Row(name, kernel, 1e3 * statistics.median(own), ratio))
    for one in workers.values():
        one.communicate()
    return rows


def worker(checkout: Path, level: str | None) -> subprocess.Popen[str]:
    """A process that works on request with the kernel of a checkout."""
    environment = os.environ | {"PYTHONPATH": str(checkout), "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    if level is not None:
        environment["CONTACT_CURATION_KERNEL"] = level
    command = [sys.executable, str(Path(__file__).resolve()), "--worker"]
    return subprocess.Popen(command, cwd=checkout, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def ask(one: subprocess.Popen[str], question: str) -> str:
    """One line to a worker, and its answer."""
    assert one.stdin is not None
    one.stdin.write(question + "\n")
    one.stdin.flush()
    return answer(one)


def answer(one: subprocess.Popen[str]) -> str:
    """A worker's next line."""
    assert one.stdout is not None
    line = one.stdout.readline()
    if not line:
        raise SystemExit(f"a worker ended with status {one.wait()}")
    return line


def work_on_request() -> int:
    """Prints the kinds of work, then for each one that is asked for its seconds."""
    jobs = kinds_of_work()
    print(json.dumps(list(jobs)), flush=True)
    counts: dict[str, int] = {}
    for line in sys.stdin:
        name = line.strip()
        if name not in counts:
            counts[name] = max(1, round(SHORTEST / seconds_of(jobs[name], 2)))
        print(seconds_of(jobs[name], counts[name]), flush=True)
    return 0


def seconds_of(job: Callable[[], object], count: int) -> float:
    """Processor time of one of `count` runs [s]; waiting for a processor does not count."""
    begin = time.process_time()
    for _ in range(count):
        job()
    return (time.process_time() - begin) / count


def kinds_of_work() -> dict[str, Callable[[], object]]:
    """Everything that the kernel does, on one thread. The other checkout's modules come only with a worker."""
    import torch

    from benchmarks.speed.evaluation import transitions

    torch.set_num_threads(1)
    _, rows = transitions()
    return batch_work(rows) | training_work(rows)


def batch_work(rows: "Transitions") -> dict[str, Callable[[], object]]:
    """What is done for many transitions at once."""
    from benchmarks.speed.evaluation import BODY, GEOMETRY
    from contact_curation.contact.evaluation import Cone, Estimator, evaluate, fisher_sums
    from contact_curation.contact.loss_config import LossConfig
    from contact_curation.contact.rollout import rollout
    from contact_curation.contact.time_step import step
    from contact_curation.solver.compiled_solver import solve_compiled
    from test.solver.known_problems import random_problems

    tosses = int(np.searchsorted(rows.starts, TRANSITIONS))
    starts = rows.starts[: tosses + 1]
    before, after, dt = (column[: starts[-1]] for column in (rows.before, rows.after, rows.dt))
    given = GEOMETRY, BODY, before, after, dt
    jobs: dict[str, Callable[[], object]] = {
        "time step": partial(step, GEOMETRY, BODY, before, dt),
        "rollout": partial(rollout, GEOMETRY, BODY, before[starts[:-1]], np.diff(starts), dt[0]),
    }
    for cone in Cone:
        config, problems = LossConfig(cone=cone, threads=1), replace(random_problems(2000, 8, seed=1), cone=cone)
        jobs[f"solve, {cone}"] = partial(solve_compiled, problems, threads=1)
        jobs[f"score, {cone}"] = partial(evaluate, *given, config)
        for estimator in Estimator:
            jobs[f"{estimator} Fisher, {cone}"] = partial(fisher_sums, *given, starts, estimator, config=config)
    return jobs


def training_work(rows: "Transitions") -> dict[str, Callable[[], object]]:
    """Steps down one transition each."""
    from benchmarks.speed.evaluation import BODY
    from contact_curation.contact.models.registry import MODELS
    from contact_curation.learning.training.protocols import published
    from contact_curation.learning.training.training import new_training

    jobs: dict[str, Callable[[], object]] = {}
    for kind in MODELS:
        protocol = published(kind)
        endless = replace(protocol, patience=None, epochs=None, steps=10**9, evaluation_steps=10**9)
        training = new_training(kind, BODY, rows, None, endless, 0)
        jobs[f"training step, {kind}"] = partial(training.advance, STEPS)
    return jobs


def print_table(rows: list[Row]) -> None:
    """For people."""
    print(f"{'work':32} {'kernel':10} {'ms':>9}  ratio")
    for row in rows:
        print(f"{row.work:32} {row.kernel:10} {row.milliseconds:9.2f}  {row.ratio:5.2f}")


if __name__ == "__main__":
    sys.exit(main())
