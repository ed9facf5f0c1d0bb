"""The report of `train`: lines of text, or one JSON object."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from contact_curation.learning.checkpoints.selection_document import document_of
from contact_curation.learning.training.reranking import Selected, Trigger
from contact_curation.learning.uncertainty.bounce import Bounce
from contact_curation.learning.uncertainty.more_throws import MoreThrows
from contact_curation.pipeline.division import LearningTosses
from contact_curation.pipeline.training import TrainingRun
from contact_curation.pipeline.wording import counted_tosses

LISTED = 5
"""Largest number of selections that are reported one by one."""

FEWEST = 3
"""Held-out tosses whose loss says something of others."""


@dataclass(frozen=True, eq=False)
class TrainReport:
    """The result of a training.

    Attributes:
        run: the training and its end.
        bounce: restitution of the tosses that the model lacks, or would lack; None where it has one, or none is known.
        sticking: what contacts that seldom slide say against the friction; empty for nothing.
        doubts: what else speaks against the model, or against some tosses; one line each.
        more_throws: how far as many throws again would change predicted motions; None where that is not known.
        tosses: tosses that it learned from.
        seconds: duration of this run [s].
        checkpoint: path of the checkpoint.
        metrics: path of the metrics.
        next_command: suggested next command.
    """

    run: TrainingRun
    bounce: Bounce | None
    sticking: str
    doubts: tuple[str, ...]
    more_throws: MoreThrows | None
    tosses: LearningTosses
    seconds: float
    checkpoint: Path
    metrics: Path
    next_command: str

    @property
    def misfit(self) -> str:
        """What the model lacks; a friction without a bounce is wrong for that reason."""
        return self.bounce.in_words() if self.bounce and self.bounce.missing else self.sticking

    @property
    def restitution(self) -> float | None:
        """What the model has learned of it; None where it has none."""
        geometry = self.run.curated.training.model.geometry()
        return geometry.restitution if geometry else None


def json_report(report: TrainReport) -> dict[str, Any]:
    """The whole report as one JSON object."""
    data = report.run.curated.training.data
    return {
        "model": report.run.plan.kind,
        "seed": report.run.plan.seed,
        **asdict(report.run.progress),
        "held_out_loss_before": report.run.loss_before,
        "held_out_loss_after": report.run.loss_after,
        "training_tosses": list(data.toss_ids),
        "training_transitions": len(data.dt),
        "held_out_tosses": [toss.toss_id for toss in report.run.plan.held_out],
        "duplicates": [list(duplicate) for duplicate in report.tosses.duplicates],
        "rejected": dict(report.tosses.rejected),
        "bounce": report.bounce._asdict() if report.bounce else None,
        "restitution": report.restitution,
        "friction_hardly_used_up": report.sticking,
        "more_throws": report.more_throws._asdict() if report.more_throws else None,
        "selections": [document_of(one) for one in report.run.curated.selections],
        "seconds": report.seconds,
        "checkpoint": str(report.checkpoint),
        "metrics": str(report.metrics),
        "next": report.next_command,
        "warnings": [*report.tosses.warnings, *report.doubts],
    }


def print_report(report: TrainReport) -> None:
    """Prints a report as text."""
    data, progress = report.run.curated.training.data, report.run.progress
    out_of = f" of {len(report.run.plan.tosses)}" if report.run.plan.selection else ""
    tosses = f"{len(data.toss_ids)}{out_of} tosses" if out_of else counted_tosses(len(data.toss_ids))
    print(f"{report.run.plan.kind} trained on {tosses}, {len(data.dt)} transitions")
    _print_left_out(report)
    print(f"{report.seconds:.1f} s: {progress.reason}")
    if (known_to := report.run.plan.protocol.shape_known_to) is not None:
        print(f"corners were taken as known to {1e3 * known_to:g} mm")
    if report.run.plan.held_out:
        count = len(report.run.plan.held_out)
        few = "" if count >= FEWEST else ", too few to judge by: hold out more, by --held-out"
        print(
            f"held-out loss {report.run.loss_before:.4g} before, {report.run.loss_after:.4g} after, "
            f"on {counted_tosses(count)}{few}"
        )
    else:
        print("no toss is held out: the loss on tosses that the model was not trained on is not known")
    print(f"training loss {progress.training_loss:.4g}")
    if report.restitution is not None:
        print(f"restitution {report.restitution:.2f}")
    if progress.not_solved:
        print(f"not solved, and left out of the steps: {progress.not_solved} transitions, each time counted")
    for line in filter(None, (report.misfit, *report.doubts)):
        print(f"careful: {line}")
    _print_selections(report.run.curated.selections)
    if report.more_throws:
        print(report.more_throws.in_words())
    print(f"checkpoint: {report.checkpoint}")
    print(f"metrics: {report.metrics}")
    print(f"next: {report.next_command}")


def _print_left_out(report: TrainReport) -> None:
    for name, count in report.tosses.rejected.most_common():
        print(f"rejected: {count} ({name})")
    duplicates = report.tosses.duplicates
    if duplicates:
        example = f"{duplicates[0].left_out} as {duplicates[0].held_out}"
        print(f"left out: {counted_tosses(len(duplicates))} whose motion is held out under another id, e.g. {example}")


def _print_selections(selections: tuple[Selected, ...]) -> None:
    for one in selections[:LISTED]:
        print(_selection_line(one))
    if len(selections) > LISTED:
        print(f"and {len(selections) - LISTED} more; the metrics list them all")


def _selection_line(one: Selected) -> str:
    count = f"{counted_tosses(len(one.toss_ids))} selected"
    if one.trigger is Trigger.FIRST:
        return f"{count} before the first step"
    why = {Trigger.EPOCHS: "after so many epochs", Trigger.OPTIMUM: "at the optimum"}.get(one.trigger, "since ranks changed")
    moved = f"Spearman {one.spearman:.2f}, overlap {100.0 * one.overlap:.0f} %"
    return f"{count} again after step {one.gradient_steps}, {why} ({moved}); {100.0 * one.retained:.0f} % were selected before"
