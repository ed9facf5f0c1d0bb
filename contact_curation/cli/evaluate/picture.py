"""Which tosses of an evaluation are drawn: the one whose error is the median, the one at nine tenths, and the worst."""

import numpy as np

from contact_curation.cli.evaluate.report import EvaluationReport
from contact_curation.dashboard.figures.motion import MotionPicture, PicturedToss, Track
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array

PLACES = (("median", 0.5), ("nine of ten are nearer", 0.9), ("worst", 1.0))


def picture_of(report: EvaluationReport) -> MotionPicture:
    """The picture of an evaluation, by the first model's position errors.

    Raises:
        InvalidValueError: no motion is finite.
    """
    errors = report.evaluations[0].errors.position
    ranked = np.argsort(errors, kind="stable")[: int(np.isfinite(errors).sum())]
    if not ranked.size:
        raise InvalidValueError("motions to draw", "none that is finite", "at least one")
    chosen = {int(ranked[round(share * (ranked.size - 1))]): name for name, share in reversed(PLACES)}
    rows = tuple(_row(report, toss, name) for toss, name in reversed(chosen.items()))
    names = tuple(f"{one.model.kind} of {one.path.name}" for one in report.models)
    return MotionPicture(f"Predicted and measured motion of {report.models[0].model.body.name}", names, rows)


def _row(report: EvaluationReport, toss: int, name: str) -> PicturedToss:
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
