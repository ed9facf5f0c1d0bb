"""What each model reaches on held-out real tosses when it learns from a few: against the true cube, the floor (method.md 1.11).

From ContactNets' tosses 0 to 399, less the duplicates of held-out ones, some are chosen (at random, or the longest); each model
trains on them from its published random initialisation by our protocol, and is judged on tosses 400 to 569. A seed stands for
the choice, the initialisation and the shuffles. Intervals are bootstrap ones over seeds.

    python -m benchmarks.learning.models [--models polytope deep deepvertex end_to_end] [--criteria random longest]
                                         [--tosses 64] [--seeds 10] [--network-seeds 3] [--out results.json] [--json]
"""

import argparse
import json
import os
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import torch

from benchmarks._data import contactnets_folder, training_and_held_out
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.models.model import Model
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.models.registry import MODELS, model_class
from contact_curation.contact.parameter_form import Form
from contact_curation.learning.evaluation.bootstrap import BootstrapConfig, spread
from contact_curation.learning.evaluation.evaluation import EvaluationConfig, evaluate_model
from contact_curation.learning.training.data import rows_of
from contact_curation.learning.training.progress import TrainingState
from contact_curation.learning.training.protocols import budgeted
from contact_curation.learning.training.training import Training
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import transitions_of

CRITERIA = ("random", "longest")


@dataclass(frozen=True)
class Result:
    """One model, trained once.

    Attributes:
        model, criterion, seed: what was trained, on what.
        position, rotation, penetration: mean errors over the held-out tosses [% of width, deg, % of width].
        position_median, rotation_median: medians over them.
        not_finite: held-out motions that are not finite; they are in no mean.
        vertex_rms: [mm], and friction, of the polytope.
        seconds: of training.
    """

    model: str
    criterion: str
    seed: int
    position: float
    rotation: float
    penetration: float
    position_median: float
    rotation_median: float
    not_finite: int
    vertex_rms: float | None
    friction: float | None
    seconds: float


def chosen(tosses: Sequence[Toss], criterion: str, count: int, seed: int) -> list[Toss]:
    """Some of them."""
    if criterion == "longest":
        return sorted(tosses, key=lambda toss: (-toss.duration, toss.toss_id))[:count]
    places = np.random.default_rng(seed).choice(len(tosses), count, replace=False)
    return [tosses[place] for place in sorted(places)]


def judged(model: Model, held_out: Sequence[Toss], name: tuple[str, str, int], seconds: float) -> Result:
    """What a model reaches."""
    found = evaluate_model(model, held_out, EvaluationConfig())
    finite, errors, shape = found.errors.finite, found.errors, found.shape
    model_name, criterion, seed = name
    return Result(
        model=model_name,
        criterion=criterion,
        seed=seed,
        position=float(errors.position[finite].mean()),
        rotation=float(errors.rotation[finite].mean()),
        penetration=float(errors.penetration[finite].mean()),
        position_median=float(np.median(errors.position[finite])),
        rotation_median=float(np.median(errors.rotation[finite])),
        not_finite=len(found.not_finite),
        vertex_rms=None if shape is None else shape.vertex_rms_mm,
        friction=None if shape is None else shape.friction,
        seconds=seconds,
    )


def trained(case: tuple[str, str, int, int, Path]) -> Result:
    """Trains one model and judges it; in a process of its own."""
    kind, criterion, seed, count, folder = case[0], *case[1:]
    torch.set_num_threads(1)
    parts = training_and_held_out(folder)
    data = transitions_of(chosen(parts.training, criterion, count, seed), CONTACTNETS_CUBE.length_scale)
    config = budgeted(kind)
    model = model_class(kind).initial(CONTACTNETS_CUBE, config.form, rows_of(data), np.random.default_rng(seed))
    training = Training(model, data, None, config, seed)
    start = time.perf_counter()
    while training.progress.state is TrainingState.RUNNING:
        training.advance(100)
    if training.progress.state is TrainingState.FAILED:
        raise SystemExit(f"{kind}, seed {seed}: {training.progress.reason}")
    return judged(training.trained(), parts.held_out, (kind, criterion, seed), time.perf_counter() - start)


def floor(folder: Path) -> Result:
    """The true cube."""
    true = PolytopeModel(ContactGeometry.of_body(CONTACTNETS_CUBE), CONTACTNETS_CUBE, Form.PHYSICAL)
    return judged(true, training_and_held_out(folder).held_out, ("true cube", "", 0), 0.0)


def print_table(results: Sequence[Result], level: Result) -> None:
    """One line a model and criterion: medians over seeds of the errors over held-out tosses, with 95 % intervals."""
    print("medians over seeds with 95 % bootstrap intervals; position [% of width], rotation [deg], vertices [mm RMS]")
    print(f"{'':24s}{'seeds':>6s}{'position, mean':>24s}{'rotation, mean':>24s}{'vertices':>10s}{'friction':>10s}{'s':>7s}")
    for model, criterion in dict.fromkeys((one.model, one.criterion) for one in results):
        own = [one for one in results if (one.model, one.criterion) == (model, criterion)]
        numbers = "".join(f"{_interval([getattr(one, name) for one in own]):>24s}" for name in ("position", "rotation"))
        shape = "".join(f"{_median([getattr(one, name) for one in own]):>10s}" for name in ("vertex_rms", "friction"))
        seconds = np.median([one.seconds for one in own])
        print(f"{model:14s}{criterion:10s}{len(own):6d}{numbers}{shape}{seconds:7.0f}")
        lost = sum(one.not_finite for one in own)
        if lost:
            print(f"    {lost} of its held-out motions are not finite and in no mean")
    print(f"{level.model:24s}{'':6s}{level.position:24.1f}{level.rotation:24.1f}")


def _interval(values: Sequence[float]) -> str:
    median = spread(np.array(values), BootstrapConfig()).median
    return f"{median.value:.1f} ({median.low:.1f} to {median.high:.1f})"


def _median(values: Sequence[float | None]) -> str:
    known = [value for value in values if value is not None]
    return f"{np.median(known):.3f}" if known else ""


def cases(arguments: argparse.Namespace, folder: Path) -> Iterator[tuple[str, str, int, int, Path]]:
    """What is trained."""
    for model in arguments.models:
        seeds = arguments.seeds if model == "polytope" else arguments.network_seeds
        for criterion in arguments.criteria:
            for seed in range(seeds):
                yield model, criterion, seed, arguments.tosses, folder


def main() -> int:
    """Prints a table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    kinds = list(MODELS)
    parser.add_argument("--models", nargs="+", default=kinds, choices=kinds)
    parser.add_argument("--criteria", nargs="+", default=["random"], choices=CRITERIA, help="(default random)")
    parser.add_argument("--tosses", type=int, default=64, help="learned from (default 64)")
    parser.add_argument("--seeds", type=int, default=10, help="of the polytope (default 10)")
    parser.add_argument("--network-seeds", type=int, default=3, help="of the networks (default 3)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes (default one per processor)")
    parser.add_argument("--out", type=Path, help="file for all results, as JSON")
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    arguments = parser.parse_args()
    folder = contactnets_folder()
    if folder is None:
        return 0
    with ProcessPoolExecutor(arguments.jobs, mp_context=get_context("spawn")) as pool:
        results = []
        for result in pool.map(trained, cases(arguments, folder)):
            results.append(result)
            print(f"{result.model} {result.criterion} {result.seed}: {result.position:.1f} %", file=sys.stderr)
    level = floor(folder)
    text = json.dumps({"true_cube": asdict(level), "results": [asdict(one) for one in results]}, indent=1)
    if arguments.out:
        arguments.out.write_text(text)
    if arguments.json:
        print(text)
    else:
        print_table(results, level)
    return 0


if __name__ == "__main__":
    sys.exit(main())
