"""The run of a training: it reads tosses, begins or goes on, stores checkpoints on the way, and stops when it is asked to."""

import argparse
import shlex
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass
from math import isnan
from pathlib import Path
from typing import Any

import torch

from contact_curation import __version__
from contact_curation.cli.options.output_paths import check_outputs
from contact_curation.cli.options.reading import reading_words
from contact_curation.cli.options.rig_settings import settings_of
from contact_curation.cli.progress import Progress as Bar
from contact_curation.cli.report import print_json, warn
from contact_curation.cli.stop_signals import StopSignals
from contact_curation.cli.train.config import TrainConfig, train_config
from contact_curation.cli.train.metrics import TrainingMetrics
from contact_curation.cli.train.report import TrainReport, json_report, print_report
from contact_curation.contact.models.kind import ModelKind
from contact_curation.errors import ContactCurationError, InvalidValueError, UnreadableInputError
from contact_curation.learning.checkpoints.stored_model import notes_of_bytes
from contact_curation.learning.training.curated import CuratedTraining
from contact_curation.learning.training.data import rows_of
from contact_curation.learning.training.mean_loss import mean_loss
from contact_curation.learning.training.plan import TrainingPlan, begin, resume, stored
from contact_curation.learning.training.progress import Progress, TrainingState
from contact_curation.motion.calibration import RigCalibration
from contact_curation.pipeline.training_tosses import LearningTosses, learning_tosses
from contact_curation.solver.compiled import load_kernel
from contact_curation.storage.files import write_atomically

BEFORE = "held-out loss before"
"""The note that says it."""


class TrainingFailedError(ContactCurationError):
    """A loss or a gradient was not finite."""

    def __init__(self, progress: Progress, checkpoint: Path) -> None:
        where = f"after {progress.gradient_steps} gradient steps: {progress.reason}"
        super().__init__(
            f"the training failed {where}; {checkpoint} holds the parameters before it; try smaller learning rates"
        )


@dataclass(frozen=True)
class Place:
    """Where a training is stored.

    Attributes:
        checkpoint: its file.
        seconds: between two writes.
        notes: what its reader should know beside the training itself.
    """

    checkpoint: Path
    seconds: float
    notes: Mapping[str, str]

    def store(self, plan: TrainingPlan, curated: CuratedTraining) -> None:
        write_atomically(self.checkpoint, stored(plan, curated, self.notes))


def run_training(arguments: argparse.Namespace) -> int:
    """What `train` does; see there."""
    torch.set_num_threads(1)  # threads that share busy cores wait for each other, and the sums' order would depend on them
    began = time.monotonic()
    _check_out(arguments)
    if arguments.model == ModelKind.POLYTOPE:
        load_kernel()  # networks are trained without it, too; a polytope is not, and better said before tosses are read
    config = train_config(arguments)
    with Bar("reading", "tosses") as bar:
        tosses = learning_tosses(arguments.inputs, config.tosses, bar.advance)
    warn(tosses.warnings)
    plan = config.plan(tosses)
    curated, before = _begun_or_resumed(arguments, plan)
    place = Place(arguments.out, arguments.checkpoint_every, _notes(plan, before, config.tosses.reading.inputs.rig))
    metrics_path = arguments.metrics or arguments.out.with_suffix(".jsonl")
    place.store(plan, curated)  # so that a place that cannot be written is known before hours of work
    with TrainingMetrics(metrics_path, curated, _start_line(arguments, config, tosses, before)) as metrics:
        stopped = _train(plan, curated, place, metrics)
    progress = curated.training.progress
    if stopped:
        _say_how_to_resume(arguments, progress)
        raise KeyboardInterrupt
    if progress.state is TrainingState.FAILED:
        raise TrainingFailedError(progress, arguments.out)
    report = TrainReport(
        plan=plan,
        curated=curated,
        tosses=tosses,
        loss_before=before,
        seconds=time.monotonic() - began,
        checkpoint=arguments.out,
        metrics=metrics_path,
        next_command=_next_command(arguments),
    )
    if arguments.json:
        print_json(json_report(report))
    else:
        print_report(report)
    return 0


def _check_out(arguments: argparse.Namespace) -> None:
    if arguments.out.exists() and not (arguments.resume or arguments.overwrite):
        raise InvalidValueError(
            "--out", f"a file at {arguments.out}", "--resume to go on with it, or --overwrite to begin anew"
        )
    check_outputs(out=arguments.out, metrics=arguments.metrics)


def _begun_or_resumed(arguments: argparse.Namespace, plan: TrainingPlan) -> tuple[CuratedTraining, float]:
    """The training, and the held-out loss before its first step."""
    if arguments.resume and arguments.out.exists():
        data = _content(arguments.out)
        curated = resume(plan, data, arguments.out)
        said = notes_of_bytes(data, arguments.out).get(BEFORE, "nan")
        _say(f"going on after {curated.training.progress.gradient_steps} gradient steps of {arguments.out}")
        return curated, float(said)
    if arguments.resume:
        _say(f"found no {arguments.out} to go on with: beginning anew")
    curated = begin(plan)
    held_out = plan.held_out_transitions
    if held_out is None:
        return curated, float("nan")
    return curated, mean_loss(curated.training.model, rows_of(held_out), plan.protocol.loss).loss


def _train(plan: TrainingPlan, curated: CuratedTraining, place: Place, metrics: TrainingMetrics) -> bool:
    """Trains to the end; True if it was stopped before."""
    done = curated.training.progress
    next_write = time.monotonic() + place.seconds
    with StopSignals() as stop, Bar("training", "steps", plan.protocol.steps, done.gradient_steps) as bar:
        while done.state is TrainingState.RUNNING and not stop.wanted:
            done = curated.advance(1)
            metrics.follow()
            bar.advance(1, _losses(done))
            if time.monotonic() >= next_write:
                place.store(plan, curated)
                next_write = time.monotonic() + place.seconds
        place.store(plan, curated)
        if done.state is not TrainingState.RUNNING:
            metrics.end(done)
    return done.state is TrainingState.RUNNING


def _losses(progress: Progress) -> str:
    held_out = "" if isnan(progress.held_out_loss) else f", held out {progress.held_out_loss:.4g}"
    return f"loss {progress.training_loss:.4g}{held_out}"


def _notes(plan: TrainingPlan, before: float, rig: RigCalibration) -> dict[str, str]:
    return {
        BEFORE: repr(before),
        "package version": __version__,
        "training ids": "\n".join(toss.toss_id for toss in plan.tosses),
        "held-out ids": "\n".join(toss.toss_id for toss in plan.held_out),
        "rig": settings_of(rig),
    }


def _start_line(arguments: argparse.Namespace, config: TrainConfig, tosses: LearningTosses, before: float) -> dict[str, Any]:
    return {
        "gradient_steps": 0,
        "model": config.kind.value,
        "protocol": arguments.protocol,
        "seed": config.seed,
        "tosses": len(tosses.training),
        "held_out": len(tosses.held_out),
        "twins_left_out": len(tosses.twins),
        "held_out_loss": before,
        "package_version": __version__,
    }


def _say_how_to_resume(arguments: argparse.Namespace, progress: Progress) -> None:
    words = [word for word in arguments.command if word not in ("--overwrite", "--resume")]
    _say(f"stopped after {progress.gradient_steps} gradient steps; {arguments.out} holds them; to go on:")
    _say(f"  {shlex.join([*words, '--resume'])}")


def _next_command(arguments: argparse.Namespace) -> str:
    words = ["contact-curation", "evaluate", str(arguments.out), *map(str, arguments.inputs), *reading_words(arguments)]
    return shlex.join([*words, *(["--no-gate"] if arguments.no_gate else [])])


def _say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise UnreadableInputError(path, f"cannot be read: {error.strerror}") from error
