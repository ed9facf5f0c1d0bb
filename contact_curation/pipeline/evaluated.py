"""The result of an evaluation: tables, a JSON object, and a figure of predicted and measured motion."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from contact_curation.dashboard.figures.motion import MotionPicture, PicturedToss, Track, save_motion_figure
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.impacts import as_described
from contact_curation.learning.evaluation.bootstrap import BootstrapConfig, Interval, Spread
from contact_curation.learning.evaluation.evaluation import MEASURES, ModelEvaluation, Summary, comparison, summary
from contact_curation.learning.evaluation.misfit import slides_apart_in_words, sliding_in_words, sliding_of, sticking_in_words
from contact_curation.learning.evaluation.without_model import doubt, plain_errors
from contact_curation.learning.uncertainty.bounce import Bounce
from contact_curation.learning.uncertainty.more_throws import MoreThrows
from contact_curation.learning.uncertainty.parameters import Known, KnownParameter
from contact_curation.motion.survey.sliding import Sliding
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import transitions_of
from contact_curation.pipeline.learned_model import LearnedModel
from contact_curation.pipeline.wording import counted, counted_tosses
from contact_curation.storage.saved_path import saved_path

UNITS = {"position": "% of the width", "rotation": "degrees", "penetration": "% of the width"}
LISTED = 5
"""Ids that fit a line."""

PICTURED = (("median", 0.5), ("90th percentile", 0.9), ("worst", 1.0))
"""The tosses that are drawn, by their position errors."""


@dataclass(frozen=True, eq=False)
class JudgingTosses:
    """The tosses that a model is evaluated on.

    Attributes:
        judged_by: at least one.
        fitted: what it was fitted to, as far as it is known; none where all tosses judge.
        chosen: in words, why just these; empty where these are all that there are.
        accepted: how many tosses there are to choose from.
        rejected: how many more failed a gate, by the first reason of each.
        duplicates: ids of those that judge and are in `fitted`, too, under another id.
        warnings: what is wrong, one line each.
    """

    judged_by: tuple[Toss, ...]
    fitted: tuple[Toss, ...]
    chosen: str
    accepted: int
    rejected: Mapping[str, int]
    duplicates: frozenset[str]
    warnings: tuple[str, ...]

    @property
    def in_words(self) -> str:
        """``evaluated on 11 of 12 tosses (1 rejected: gap)``: how many, why just these, and what was left out."""
        count, rejected = len(self.judged_by), sum(self.rejected.values())
        left_out = [f"{rejected} rejected: {', '.join(self.rejected)}"] if rejected else []
        left_out += [f"{self.accepted - count} not chosen"] if self.accepted > count else []
        total = counted_tosses(self.accepted + rejected)
        how_many = f"{count} of {total} ({'; '.join(left_out)})" if left_out else total
        return f"evaluated on {how_many}" + (f": {self.chosen}" if self.chosen else "")


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Models evaluated on tosses. `print` shows tables.

    Attributes:
        models: one, or two that are compared.
        evaluations: of them, over the same tosses.
        rigid: of polytopes whose friction acts at other vertices than their gaps, with shared vertices; by their names.
        tosses: by which, and why these.
        known: what is known of the first model's parameters; None where that cannot be said.
        why_not: why.
        bounce: restitution of the tosses that the first model was fitted to without one; None where that is not known.
        more_throws: how far more throws would change the first model's predictions; None where that is not known.
        bootstrap: of the intervals.
    """

    models: tuple[LearnedModel, ...]
    evaluations: tuple[ModelEvaluation, ...]
    rigid: Mapping[str, ModelEvaluation]
    tosses: JudgingTosses
    known: Known | None
    why_not: str
    bounce: Bounce | None
    more_throws: MoreThrows | None
    bootstrap: BootstrapConfig

    def summaries(self) -> dict[str, Summary]:
        """By file; as rigid bodies; without the duplicates, where there are any; and of the differences."""
        found = {str(one.name): summary(each, self.bootstrap) for one, each in self._pairs()}
        found |= {name: summary(each, self.bootstrap) for name, each in self.rigid.items()}
        if self.tosses.duplicates:
            name = f"without the {len(self.tosses.duplicates)} that have a duplicate among the others"
            found |= {
                f"{one.name}, {name}": summary(each, self.bootstrap, self.tosses.duplicates) for one, each in self._pairs()
            }
        if len(self.evaluations) > 1:
            name = f"{self.models[0].name} - {self.models[1].name}, toss by toss"
            found[name] = comparison(self.evaluations[0], self.evaluations[1], self.bootstrap)
        return found

    @cached_property
    def sliding(self) -> Sliding | None:
        """Frictions of the tosses that slide; None of too few."""
        return sliding_of((*self.tosses.fitted, *self.tosses.judged_by), self.models[0].body)

    @property
    def sliding_misfit(self) -> str:
        """What they say against the first model's friction; empty for nothing."""
        learned = self._friction
        return "" if learned is None else sliding_in_words(self.sliding, learned.value, learned.interval_of_fit)

    @cached_property
    def sticking_misfit(self) -> str:
        """What contacts that seldom slide say against it; empty for nothing, and where it lacks a bounce or is not known."""
        if not self.models[0].at_optimum or (self.bounce and self.bounce.missing):
            return ""
        if self._friction and self._friction.interval > self._friction.value:
            return ""
        model = self.models[0].model
        data = transitions_of((*self.tosses.fitted, *self.tosses.judged_by), model.body.length_scale)
        return sticking_in_words(as_described(data, model.geometry(), model.body), model.geometry(), model.body, self.sliding)

    @property
    def _friction(self) -> KnownParameter | None:
        """What is known of the first model's."""
        return next((one for one in self.known.parameters if one.name == "friction"), None) if self.known else None

    def document(self) -> dict[str, Any]:
        """Everything, as one object for JSON."""
        return {
            "chosen": self.tosses.chosen,
            "tosses": len(self.tosses.judged_by),
            "accepted": self.tosses.accepted,
            "rejected": dict(self.tosses.rejected),
            "duplicates": sorted(self.tosses.duplicates),
            "models": [_json_model(one, each) for one, each in self._pairs()],
            "summaries": {name: _json_summary(each) for name, each in self.summaries().items()},
            "bootstrap": asdict(self.bootstrap),
            "known": _json_known(self.known) if self.known else None,
            "known_why_not": self.why_not,
            "bounce": self.bounce._asdict() if self.bounce else None,
            "more_throws": self.more_throws._asdict() if self.more_throws else None,
            "sliding": self.sliding and {"friction": self.sliding.median, "tosses": len(self.sliding.friction)},
            "friction_hardly_used_up": self.sticking_misfit,
            "without_a_model": {
                name: errors._asdict() for name, errors in plain_errors(self.evaluations[0], self.models[0].body).items()
            },
            "warnings": [*self.tosses.warnings, *filter(None, (slides_apart_in_words(self.sliding),))],
        }

    def save_figure(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Draws predicted against measured motion into a PNG file, of the tosses in `PICTURED`.

        Args:
            path: of the file.
            overwrite: whether to replace any file that is there; without it, only an earlier figure is replaced.

        Raises:
            InvalidValueError: no motion is finite, another ending, a file that must not be replaced, or the file cannot be
                written.
        """
        save_motion_figure(_picture(self), saved_path(path, (".png",), overwrite=overwrite))

    def lines(self) -> Iterator[str]:
        """Tables for people."""
        return _lines(self)

    def __str__(self) -> str:
        return "\n".join((*self.lines(), *(f"careful: {line}" for line in self.tosses.warnings)))

    def __repr__(self) -> str:
        return f"<{' and '.join(one.name for one in self.models)} on {counted_tosses(len(self.tosses.judged_by))}>"

    def _pairs(self) -> list[tuple[LearnedModel, ModelEvaluation]]:
        return list(zip(self.models, self.evaluations, strict=True))


def _lines(report: Evaluation) -> Iterator[str]:
    """For people."""
    yield report.tosses.in_words
    share = f"{100.0 * report.bootstrap.confidence:g} %"
    for name, each in report.summaries().items():
        yield from ("", name)
        yield from _summary(each, share)
    for one, evaluation in zip(report.models, report.evaluations, strict=True):
        yield from ("", f"{one.name}: {one.kind}, mean loss {evaluation.mean_loss:.4g}")
        yield from _shape(evaluation)
        yield from _failures(evaluation)
        if line := doubt(evaluation, one.body):
            yield f"  careful: {line}"
    yield from ("", _without_model(report))
    if report.bounce and report.bounce.missing:
        yield f"careful: {report.bounce.in_words()}"
    if apart := slides_apart_in_words(report.sliding):
        yield f"careful: {apart}"
    yield ""
    if report.known:
        if doubt(report.evaluations[0], report.models[0].body):
            yield "careful: these are deviations of a model that does not describe the motions; they say nothing of the body"
        yield from _known(report.known, at_optimum=report.models[0].at_optimum)
        for line in filter(None, (report.sliding_misfit, report.sticking_misfit)):
            yield f"careful: {line}"
    else:
        yield report.why_not
    if report.more_throws:
        yield from ("", report.more_throws.in_words())


def _summary(each: Summary, share: str) -> Iterator[str]:
    yield f"  {'':28} {'median':>8}  {share + ' interval':18} {'mean':>8}  {share + ' interval':18}"
    for name in MEASURES:
        spread: Spread | None = getattr(each, name)
        label = f"{name} [{UNITS[name]}]"
        yield f"  {label:28} {_cells(spread.median)} {_cells(spread.mean)}" if spread else f"  {label:28} no motion is finite"


def _cells(interval: Interval) -> str:
    ends = f"{interval.low:.2f} to {interval.high:.2f}" if isfinite(interval.low) else "of so few: none"
    return f"{interval.value:8.2f}  {ends:18}"


def _without_model(report: Evaluation) -> str:
    plain = plain_errors(report.evaluations[0], report.models[0].body)
    words = [f"{errors.position:.1f} % and {errors.rotation:.1f} degrees if it {name}" for name, errors in plain.items()]
    return f"without a model (means of position and rotation): {'; '.join(words)}"


def _shape(evaluation: ModelEvaluation) -> Iterator[str]:
    shape = evaluation.shape
    if shape is None:
        return
    lengths = f"{shape.vertex_rms_mm:.2f} mm ({shape.vertex_rms:.4f} characteristic lengths)"
    friction = f"friction {shape.friction:.4f}, {shape.friction_error:+.4f}"
    yield f"  against the body as described: vertices {lengths} RMS; hull {shape.hull_mm:.2f} mm (Hausdorff); {friction}"


def _failures(evaluation: ModelEvaluation) -> Iterator[str]:
    if evaluation.not_finite:
        more = ", ..." if len(evaluation.not_finite) > LISTED else ""
        names = ", ".join(evaluation.not_finite[:LISTED])
        yield f"  not finite, and not in the table: {counted(len(evaluation.not_finite), 'motion')}: {names}{more}"
    if evaluation.not_solved:
        yield f"  not solved, and not in the mean loss: {evaluation.not_solved} of {evaluation.transitions} transitions"
    if evaluation.sweeps_exhausted:
        yield f"  iteration limit reached: {evaluation.sweeps_exhausted} of {evaluation.steps} steps of the rollouts"


def _known(known: Known, *, at_optimum: bool) -> Iterator[str]:
    said = f"95 % intervals, which contain the misfit, and standard deviations (sigma^2 {known.noise_variance:.3g})"
    yield f"what is known from the {known.tosses} others: {said}"
    heads = f"{'value':>9} {'95 %: +-':>9} {'deviation':>9} {'sandwich':>9} {'Cramer-Rao':>10} {'naive':>9}"
    yield "  sandwich, Cramer-Rao (a lower bound) and naive deviations hold for a model that is right only"
    yield f"  {'':20} {'unit':4} {heads}   ellipsoid's half axes [mm]"
    rows = {parameter.name: parameter for parameter in known.parameters}
    for k, vertex in enumerate(known.vertices):
        for axis in range(3):
            axes = ", ".join(f"{length:.2f}" for length in vertex.axes_mm) if not axis else ""
            yield (f"{_known_row(f'vertex {k} {"xyz"[axis]}', rows[f'vertices_normal[{k}][{axis}]'])}   {axes}".rstrip())
    for name in ("friction", "restitution", "tilt[0]", "tilt[1]", "height"):
        if name in rows:
            yield _known_row(name, rows[name])
    yield f"  directions of theta that they measure: {known.directions} of {len(known.parameters)}"
    if known.not_solved:
        yield f"  not solved, and left out: {known.not_solved} transitions"
    if known.to_optimum > 1.0:
        why = (
            "the training ended at its optimum, so the loss is far from a parabola there, and the deviations say too little"
            if at_optimum
            else "the model was not trained on them, or not to the end (train --protocol exact goes there)"
        )
        yield f"  a Newton step on these tosses moves a parameter by {known.to_optimum:.1f} Cramer-Rao deviations: {why}"
    if known.tosses < len(known.parameters):
        yield "  with fewer tosses than parameters the sandwich says too little; take the intervals"


def _known_row(label: str, parameter: KnownParameter) -> str:
    digits = 2 if parameter.unit == "mm" else 4
    columns = (parameter.value, parameter.interval, parameter.deviation, parameter.sandwich)
    numbers = " ".join(f"{value:9.{digits}f}" for value in columns)
    return f"  {label:20} {parameter.unit:4} {numbers} {parameter.cramer_rao:10.{digits}f} {parameter.naive:9.{digits}f}"


def _json_model(one: LearnedModel, each: ModelEvaluation) -> dict[str, Any]:
    rows: list[dict[str, Any]] = [
        {"toss_id": name, "loss": loss, **dict(zip(MEASURES, values, strict=True))}
        for name, loss, *values in zip(
            each.toss_ids, each.losses.tolist(), *(getattr(each.errors, measure).tolist() for measure in MEASURES), strict=True
        )
    ]
    return {
        "path": one.name,
        "model": one.kind,
        "mean_loss": each.mean_loss,
        "doubt": doubt(each, one.body),
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


def _picture(report: Evaluation) -> MotionPicture:
    """The picture of an evaluation, by the first model's position errors.

    Raises:
        InvalidValueError: no motion is finite.
    """
    errors = report.evaluations[0].errors.position
    ranked = np.argsort(errors, kind="stable")[: int(np.isfinite(errors).sum())]
    if not ranked.size:
        raise InvalidValueError(
            "motions to draw", "none that is finite", "at least one: train the model longer, or on other tosses"
        )
    chosen = {int(ranked[round(share * (ranked.size - 1))]): name for name, share in reversed(PICTURED)}
    rows = tuple(_row(report, toss, name) for toss, name in reversed(chosen.items()))
    names = tuple(f"{one.kind} of {Path(one.name).name}" for one in report.models)
    medians = " and ".join(_median(each.errors.position) for each in report.evaluations)
    title = f"Predicted motions of {report.models[0].model.body.name}: median position error {medians} of the width"
    return MotionPicture(f"{title}, {counted_tosses(len(report.tosses.judged_by))}", names, rows)


def _median(errors: Array) -> str:
    """Of the finite errors, in percent."""
    finite = errors[np.isfinite(errors)]
    return f"{float(np.median(finite)):.1f} %" if finite.size else "of no finite motion"


def _row(report: Evaluation, toss: int, name: str) -> PicturedToss:
    first, source = report.evaluations[0], report.tosses.judged_by[toss]
    body = report.models[0].model.body
    measured, _ = first.frames(toss)
    predicted = [(each.frames(toss)[1], one) for each, one in zip(report.evaluations, report.models, strict=True)]
    distances = " and ".join(f"{each.errors.position[toss]:.1f} %" for each in report.evaluations)
    angles = " and ".join(f"{each.errors.rotation[toss]:.1f}°" for each in report.evaluations)
    return PicturedToss(
        title=f"{name}: toss {first.toss_ids[toss]}, off by {distances} of the width, {angles}",
        times=source.frame_period * np.arange(len(measured), dtype=float),
        measured=_track(measured, body.scaled_vertices, body.length_scale),
        predicted=tuple(
            _track(
                states,
                one.model.drawn_vertices(),
                one.model.body.length_scale,
            )
            for states, one in predicted
        ),
    )


def _track(states: Array, vertices: Array, length_scale: float) -> Track:
    millimetres = 1e3 * length_scale
    return Track(millimetres * states[:, :3], states[:, 3:7], millimetres * vertices)
