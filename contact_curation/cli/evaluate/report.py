"""What `evaluate` says: tables for people, one object for programs."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from math import isfinite
from pathlib import Path
from typing import Any

from contact_curation.cli.evaluate.models import JudgedModel
from contact_curation.cli.evaluate.tosses import JudgingTosses
from contact_curation.cli.report import counted, counted_tosses
from contact_curation.learning.evaluation.bootstrap import BootstrapConfig, Interval, Spread
from contact_curation.learning.evaluation.evaluation import MEASURES, ModelEvaluation, Summary, comparison, summary
from contact_curation.learning.uncertainty.parameters import Known, KnownParameter

UNITS = {"position": "% of the width", "rotation": "degrees", "penetration": "% of the width"}
LISTED = 5
"""Ids that fit a line."""


@dataclass(frozen=True, eq=False)
class EvaluationReport:
    """An evaluation with all that came with it.

    Attributes:
        models: one, or two that are compared.
        evaluations: of them, over the same tosses.
        rigid: of polytopes that rub elsewhere than where they touch, as if they did not, by what they are called.
        tosses: by which, and why these.
        known: what is known of the first model's parameters; None where that cannot be said.
        why_not: why.
        bootstrap: of the intervals.
        figure: where it lies, if anywhere.
    """

    models: tuple[JudgedModel, ...]
    evaluations: tuple[ModelEvaluation, ...]
    rigid: Mapping[str, ModelEvaluation]
    tosses: JudgingTosses
    known: Known | None
    why_not: str
    bootstrap: BootstrapConfig
    figure: Path | None

    def summaries(self) -> dict[str, Summary]:
        """By file; as rigid bodies; without the twins, where there are any; and of the differences."""
        found = {str(one.path): summary(each, self.bootstrap) for one, each in self._pairs()}
        found |= {name: summary(each, self.bootstrap) for name, each in self.rigid.items()}
        if self.tosses.twins:
            name = f"without the {len(self.tosses.twins)} that have a twin among the others"
            found |= {f"{one.path}, {name}": summary(each, self.bootstrap, self.tosses.twins) for one, each in self._pairs()}
        if len(self.evaluations) > 1:
            name = f"{self.models[0].path} - {self.models[1].path}, toss by toss"
            found[name] = comparison(self.evaluations[0], self.evaluations[1], self.bootstrap)
        return found

    def _pairs(self) -> list[tuple[JudgedModel, ModelEvaluation]]:
        return list(zip(self.models, self.evaluations, strict=True))


def json_report(report: EvaluationReport) -> dict[str, Any]:
    """Everything, as one object."""
    return {
        "chosen": report.tosses.chosen,
        "tosses": len(report.tosses.judged_by),
        "twins": sorted(report.tosses.twins),
        "models": [_json_model(one, each) for one, each in zip(report.models, report.evaluations, strict=True)],
        "summaries": {name: _json_summary(each) for name, each in report.summaries().items()},
        "bootstrap": asdict(report.bootstrap),
        "known": _json_known(report.known) if report.known else None,
        "known_why_not": report.why_not,
        "figure": str(report.figure) if report.figure else None,
        "warnings": report.tosses.warnings,
    }


def print_report(report: EvaluationReport) -> None:
    """For people."""
    print(f"judged by {counted_tosses(len(report.tosses.judged_by))}: {report.tosses.chosen}")
    share = f"{100.0 * report.bootstrap.confidence:g} %"
    for name, each in report.summaries().items():
        print(f"\n{name}")
        _print_summary(each, share)
    for one, evaluation in zip(report.models, report.evaluations, strict=True):
        print(f"\n{one.path}: {one.model.kind}, mean loss {evaluation.mean_loss:.4g}")
        _print_shape(evaluation)
        _print_failures(evaluation)
    print()
    if report.known:
        _print_known(report.known)
    else:
        print(report.why_not)
    if report.figure:
        print(f"figure: {report.figure}")


def _print_summary(each: Summary, share: str) -> None:
    print(f"  {'':28} {'median':>8}  {share + ' interval':18} {'mean':>8}  {share + ' interval':18}")
    for name in MEASURES:
        spread: Spread | None = getattr(each, name)
        label = f"{name} [{UNITS[name]}]"
        print(f"  {label:28} {_cells(spread.median)} {_cells(spread.mean)}" if spread else f"  {label:28} no motion is finite")


def _cells(interval: Interval) -> str:
    ends = f"{interval.low:.2f} to {interval.high:.2f}" if isfinite(interval.low) else "of one toss: none"
    return f"{interval.value:8.2f}  {ends:18}"


def _print_shape(evaluation: ModelEvaluation) -> None:
    shape = evaluation.shape
    if shape is None:
        return
    lengths = f"{shape.vertex_rms_mm:.2f} mm ({shape.vertex_rms:.4f} characteristic lengths)"
    print(
        f"  against the body as described: vertices {lengths} RMS; friction {shape.friction:.4f}, {shape.friction_error:+.4f}"
    )


def _print_failures(evaluation: ModelEvaluation) -> None:
    if evaluation.not_finite:
        more = ", ..." if len(evaluation.not_finite) > LISTED else ""
        names = ", ".join(evaluation.not_finite[:LISTED])
        print(f"  not finite, and not in the table: {counted(len(evaluation.not_finite), 'motion')}: {names}{more}")
    if evaluation.not_solved:
        print(f"  not solved, and not in the mean loss: {evaluation.not_solved} of {evaluation.transitions} transitions")
    if evaluation.sweeps_exhausted:
        print(f"  out of sweeps: {evaluation.sweeps_exhausted} of {evaluation.steps} steps of the rollouts")


def _print_known(known: Known) -> None:
    print(f"what is known from the {known.tosses} others, as standard deviations (sigma^2 {known.noise_variance:.3g})")
    print(f"  {'':20} {'unit':4} {'value':>9} {'sandwich':>9} {'Cramer-Rao':>10} {'naive':>9}   ellipsoid's half axes [mm]")
    rows = {parameter.name: parameter for parameter in known.parameters}
    for k, vertex in enumerate(known.vertices):
        for axis in range(3):
            axes = ", ".join(f"{length:.2f}" for length in vertex.axes_mm) if not axis else ""
            print(f"{_known_row(f'vertex {k} {"xyz"[axis]}', rows[f'vertices_normal[{k}][{axis}]'])}   {axes}".rstrip())
    for name in ("friction", "tilt[0]", "tilt[1]", "height"):
        print(_known_row(name, rows[name]))
    print(f"  directions of theta that they measure: {known.directions} of {len(known.parameters)}")
    if known.not_solved:
        print(f"  not solved, and left out: {known.not_solved} transitions")
    if known.to_optimum > 1.0:
        print(
            f"  the best fit to these tosses is up to {known.to_optimum:.1f} standard deviations away: "
            "the model was not trained on them, or not to the end"
        )
    if known.tosses < len(known.parameters):
        print("  with fewer tosses than parameters the sandwich says too little; Cramer-Rao is safer")


def _known_row(label: str, parameter: KnownParameter) -> str:
    digits = 2 if parameter.unit == "mm" else 4
    numbers = f"{parameter.value:9.{digits}f} {parameter.sandwich:9.{digits}f} {parameter.cramer_rao:10.{digits}f}"
    return f"  {label:20} {parameter.unit:4} {numbers} {parameter.naive:9.{digits}f}"


def _json_model(one: JudgedModel, each: ModelEvaluation) -> dict[str, Any]:
    rows: list[dict[str, Any]] = [
        {"toss_id": name, "loss": loss, **dict(zip(MEASURES, values, strict=True))}
        for name, loss, *values in zip(
            each.toss_ids, each.losses.tolist(), *(getattr(each.errors, measure).tolist() for measure in MEASURES), strict=True
        )
    ]
    return {
        "path": str(one.path),
        "model": one.model.kind,
        "mean_loss": each.mean_loss,
        "transitions": each.transitions,
        "not_solved": each.not_solved,
        "not_finite": each.not_finite,
        "sweeps_exhausted": each.sweeps_exhausted,
        "steps": each.steps,
        "shape": each.shape._asdict() if each.shape else None,
        "per_toss": rows,
    }


def _json_summary(each: Summary) -> dict[str, Any]:
    return {
        name: {kind: getattr(spread, kind)._asdict() for kind in spread._fields} if spread else None
        for name, spread in each._asdict().items()
    }


def _json_known(known: Known) -> dict[str, Any]:
    return {
        "tosses": known.tosses,
        "noise_variance": known.noise_variance,
        "directions": known.directions,
        "to_optimum": known.to_optimum,
        "not_solved": known.not_solved,
        "parameters": [parameter._asdict() for parameter in known.parameters],
        "vertices": [{name: value.tolist() for name, value in vertex._asdict().items()} for vertex in known.vertices],
    }
