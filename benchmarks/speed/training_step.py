"""How long a gradient step takes per transition: every model, batches of 1 and 128, the whole step and the model's part of it.

The tosses are ContactNets', found through CONTACTNETS_DATA; without them, simulated ones. The models are at their random
initialisation. A whole step is what `Training` does: draw a batch, loss, gradient, AdamW; the model's part is the loss
with its regulariser and the gradient. Processor time is what counts where others use the processors too.

    python -m benchmarks.speed.training_step [--json] [--repeats N] [--threads N]
"""

import argparse
import json
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import NamedTuple

import numpy as np
import torch

from benchmarks.speed.evaluation import BODY, transitions
from contact_curation.contact.models.kind import ModelKind
from contact_curation.contact.models.model import Model, Rows
from contact_curation.contact.models.registry import initial_model
from contact_curation.contact.parameter_form import Form
from contact_curation.learning.training.protocols import TrainingConfig, budgeted
from contact_curation.learning.training.training import Training
from contact_curation.motion.transitions import Transitions

MODELS = [
    (ModelKind.POLYTOPE, Form.CONTACTNETS),
    (ModelKind.POLYTOPE, Form.PHYSICAL),
    (ModelKind.DEEP, Form.CONTACTNETS),
    (ModelKind.DEEP, Form.PHYSICAL),
    (ModelKind.DEEPVERTEX, Form.CONTACTNETS),
    (ModelKind.END_TO_END, Form.CONTACTNETS),
]
STEPS = {1: 100, 128: 4}
"""Gradient steps that are timed together, by batch size."""

GOALS = {(ModelKind.POLYTOPE, 1): 0.5, (ModelKind.POLYTOPE, 128): 0.05, (ModelKind.DEEP, 128): 1.5}
"""Whole step [ms per transition]."""


class Milliseconds(NamedTuple):
    """Per transition: wall time, median and best over repetitions, and the median processor time of all threads."""

    median: float
    best: float
    processor: float


@dataclass(frozen=True)
class StepTime:
    """One row of the table."""

    model: str
    form: str
    batch: int
    parameters: int
    step: Milliseconds
    model_part: Milliseconds
    goal: float | None


@dataclass(frozen=True)
class Report:
    """Everything, as --json prints it."""

    data: str
    transitions: int
    threads: int
    times: list[StepTime]


def main() -> int:
    """Prints a table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument("--repeats", type=int, default=10, help="repetitions of each timing (default 10)")
    parser.add_argument("--threads", type=int, default=1, help="threads of torch and of the kernel (default 1)")
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    name, rows = transitions()
    times = [
        step_time(rows, kind, form, batch, arguments.repeats, arguments.threads) for kind, form in MODELS for batch in STEPS
    ]
    report = Report(name, len(rows.dt), arguments.threads, times)
    print(json.dumps(asdict(report), indent=2)) if arguments.json else print_table(report)
    return 0


def step_time(rows: Transitions, kind: ModelKind, form: Form, batch: int, repeats: int, threads: int) -> StepTime:
    """One row of the table."""
    config = timed_protocol(kind, form, batch, threads)
    data = Rows(rows.before, rows.after, rows.dt)
    model = initial_model(kind, BODY, form, data, np.random.default_rng(0))
    batches = [data.take(chosen) for chosen in np.random.default_rng(1).integers(len(rows.dt), size=(STEPS[batch], batch))]
    model_part = milliseconds(repeats, batch, lambda: gradients(model, batches, config))
    training = Training(model, rows, None, config, seed=2)
    step = milliseconds(repeats, batch, lambda: training.advance(STEPS[batch]))
    parameters = sum(value.numel() for value in model.parameters())
    return StepTime(kind.value, form.value, batch, parameters, step, model_part, GOALS.get((kind, batch)))


def timed_protocol(kind: ModelKind, form: Form, batch: int, threads: int) -> TrainingConfig:
    """Ours, without an end and without evaluations."""
    ours, endless = budgeted(kind), 10**9
    loss = replace(ours.loss, threads=threads)
    return replace(ours, form=form, batch=batch, steps=endless, evaluation_steps=endless, loss=loss)


def gradients(model: Model, batches: list[Rows], config: TrainingConfig) -> None:
    """Loss and gradient of each batch."""
    for rows in batches:
        found = model.batch_loss(rows, config.loss)
        objective = found.losses[found.solved].mean() + config.regularizer * found.regularizer
        model.zero_grad()
        objective.backward()  # type: ignore[no-untyped-call]


def milliseconds(repeats: int, batch: int, job: Callable[[], object]) -> Milliseconds:
    """Of repetitions after a first one that is not counted."""
    walls, processors, share = [], [], 1e3 / (STEPS[batch] * batch)
    for _ in range(max(1, repeats) + 1):
        wall, processor = time.perf_counter(), time.process_time()
        job()
        walls.append(share * (time.perf_counter() - wall))
        processors.append(share * (time.process_time() - processor))
    return Milliseconds(statistics.median(walls[1:]), min(walls[1:]), statistics.median(processors[1:]))


def print_table(report: Report) -> None:
    """For people."""
    print(f"{report.data}: {report.transitions} transitions, {report.threads} threads; milliseconds per transition\n")
    times = f"{'median':>8} {'best':>8} {'processor':>9}"
    print(f"{'':44}  {'whole step':>27}   {'model part':>27}")
    print(f"{'model':12} {'form':12} {'parameters':>10}  batch   {times}   {times}  goal")
    for row in report.times:
        both = "   ".join(f"{each.median:8.4f} {each.best:8.4f} {each.processor:9.4f}" for each in (row.step, row.model_part))
        goal = "" if row.goal is None else f"{row.goal:g}"
        print(f"{row.model:12} {row.form:12} {row.parameters:10d}  {row.batch:5d}   {both}  {goal}")


if __name__ == "__main__":
    sys.exit(main())
