"""Predictions that need no model, to compare a model's motions with, and one line where the model is no better.

A body that stays where it was released says how far tosses go. One that lies from the start where it ends knows the outcome,
and nothing of the way there. A model whose mean errors are not below both describes something else than these motions, and what
its parameters are known to is of no use.

What may be missing is looked for in the first impacts: how fast corners leave the board, measured and predicted (`rebounds`). A
model without restitution that meets a body that bounces leaves the former above the latter.
"""

from typing import NamedTuple

import numpy as np

from contact_curation.contact.body import Body
from contact_curation.learning.evaluation.evaluation import ModelEvaluation
from contact_curation.learning.evaluation.motion_errors import MotionErrors, motion_errors
from contact_curation.learning.evaluation.rebounds import rebounds

RELEASED, FINAL = "stays where it was released", "lies from the start where it ends"

BOUNCING = 0.1
"""A difference between measured and predicted rebounds that is worth a word."""

FEWEST = 5
"""Impacts, for a median of rebounds."""


class PlainErrors(NamedTuple):
    """Mean errors without a model.

    Attributes:
        position: [% of the body's width].
        rotation: [deg].
    """

    position: float
    rotation: float


def plain_errors(evaluation: ModelEvaluation, body: Body) -> dict[str, PlainErrors]:
    """Mean errors of both predictions, over the tosses of an evaluation; `body` as described."""
    counts = np.diff(evaluation.starts)
    places = {RELEASED: evaluation.starts[:-1], FINAL: evaluation.starts[1:] - 1}
    found = {}
    for name, rows in places.items():
        still = evaluation.measured[np.repeat(rows, counts)]
        found[name] = _means(motion_errors(still, evaluation.measured, evaluation.starts, body))
    return found


def doubt(evaluation: ModelEvaluation, body: Body) -> str:
    """Why the model does not describe the tosses of an evaluation, in one line; empty where it does better than without one.

    Args:
        evaluation: of the model.
        body: as described.
    """
    if not evaluation.errors.finite.any():
        return "no predicted motion is finite"
    ours = _means(evaluation.errors)
    worse = []
    for measure, unit in (("position", " %"), ("rotation", " degrees")):
        name, least = min(
            ((name, getattr(plain, measure)) for name, plain in plain_errors(evaluation, body).items()),
            key=lambda one: one[1],
        )
        value = getattr(ours, measure)
        if value >= least:
            worse.append(f"{measure} is off by {value:.1f}{unit}, and by {least:.1f} if the body {name}")
    if not worse:
        return ""
    return f"the model does not describe these motions: {'; '.join(worse)}{_bounce(evaluation, body)}"


def _bounce(evaluation: ModelEvaluation, body: Body) -> str:
    measured, predicted = (rebounds(states, evaluation.starts, body) for states in (evaluation.measured, evaluation.predicted))
    if min(len(measured), len(predicted)) < FEWEST:
        return ""
    seen, ours = float(np.median(measured)), float(np.median(predicted))
    if seen - ours < BOUNCING:
        return ""
    return f"; it bounces: first impacts leave with {seen:.2f} of their speed (median), the model's with {max(ours, 0.0):.2f}"


def _means(errors: MotionErrors) -> PlainErrors:
    finite = errors.finite
    return PlainErrors(float(errors.position[finite].mean()), float(errors.rotation[finite].mean()))
