"""Predictions that need no model, to compare a model's motions with, and one line where the model is no better.

A body that stays where it was released says how far tosses go. One that lies from the start where it ends knows the outcome,
and nothing of the way there. A model whose mean errors are not below both describes something else than these motions, and what
its parameters are known to is of no use.

What may be missing is looked for in the first impacts: the share of its approach speed with which the lowest corner of the body
as described leaves the board, measured and predicted. A model without restitution that meets a body that bounces leaves the
former above the latter. Both speeds are taken over some frames, away from the impact, because filters of trackers spread it.
Gravity makes both shares a little too small, alike.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contact_curation.contact.body import Body
from contact_curation.geometry.polytopes import Polytope
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.evaluation.evaluation import ModelEvaluation
from contact_curation.learning.evaluation.motion_errors import MotionErrors, motion_errors

RELEASED, FINAL = "stays where it was released", "lies from the start where it ends"

NEAR, FAR = 1, 3
"""Frames from an impact between which its speeds are taken."""

CLOSE = 0.03
"""A corner that comes so near to its lowest height touches the board [characteristic lengths]."""

SLOWEST = 0.1
"""Impacts that approach with less than this share of the fastest say nothing of restitution."""

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


def rebounds(states: Array, starts: NDArray[np.int64], body: Body) -> Array:
    """Share of its approach speed with which the lowest corner leaves its first impact, of the K motions that have one.

    Args:
        states: (N, 13) of all motions [characteristic lengths].
        starts: (K + 1,) motion k owns rows starts[k]:starts[k + 1].
        body: as described.
    """
    heights = Polytope(body.scaled_vertices).corner_heights(states[:, :3], states[:, 3:7])  # (N, V)
    speeds = [_impact(heights[first:last]) for first, last in pairwise(starts.tolist())]
    found = np.array([each for each in speeds if each is not None]).reshape(-1, 2)
    if not len(found):
        return np.zeros(0)
    hard = found[:, 0] > SLOWEST * found[:, 0].max()
    return np.asarray(found[hard, 1] / found[hard, 0])


def _impact(heights: Array) -> tuple[float, float] | None:
    """Speeds per frame before and after the first impact of corners (T, V); None without one, or enough frames around it."""
    if len(heights) <= 2 * FAR or not np.isfinite(heights).all():
        return None
    lowest = heights.min(axis=1)
    touching = np.flatnonzero(lowest < lowest.min() + CLOSE)
    first = int(touching[0])
    corner = heights[:, int(heights[first].argmin())]
    turn = first + int(np.argmin(corner[first : first + FAR]))
    if turn < FAR or turn + FAR >= len(corner):
        return None
    before, after = ((corner[turn + side * FAR] - corner[turn + side * NEAR]) / (FAR - NEAR) for side in (-1, 1))
    return (float(before), float(after)) if before > 0.0 else None


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
