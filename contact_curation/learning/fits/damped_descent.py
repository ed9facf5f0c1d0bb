"""Damped Gauss-Newton steps of a polytope down a sum of squares (Levenberg 1944, Marquardt 1963).

    theta <- theta + (H + d diag H)^-1 s,      H half the sum's Gauss-Newton curvature,  s minus half its slope

A step is taken when it lowers the sum, and d then shrinks; otherwise d grows. With some fifty parameters and the kernel's
exact matrices a dozen steps reach the optimum that gradient descent needs thousands for. What is summed is up to the caller.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.fits.polytope_sums import moved

SHRINK, GROW = 0.2, 4.0
"""What the damping is multiplied with after a step that was taken, or was not."""


class Iterate(NamedTuple):
    """A model with the loss and its derivatives there.

    Attributes:
        model: in the physical form.
        objective: the sum, at least 0.
        score: (P,) minus half its slope.
        information: (P, P) half its Gauss-Newton curvature.
        not_solved: transitions that the sum leaves out; a step that leaves out more is not taken.
    """

    model: PolytopeModel
    objective: float
    score: Array
    information: Array
    not_solved: int = 0


@dataclass(frozen=True)
class DescentLimits:
    """When a descent ends.

    Attributes:
        tolerance: relative decrease by a step that counts as arrival.
        steps: tried ones at most, taken or not.
        damping: d of the first step.
        largest_damping: where a step as small as this makes it finds no lower sum, there is none that rounding can tell.
        floor: share of H's mean diagonal that is always added to it, for parameters that nothing measures.
    """

    tolerance: float
    steps: int
    damping: float
    largest_damping: float
    floor: float = 0.0


class Descent(NamedTuple):
    """Result of a descent.

    Attributes:
        iterate: the lowest that was found.
        steps: how many were tried.
        arrived: whether the last one was as small as wanted.
    """

    iterate: Iterate
    steps: int
    arrived: bool


def descend(start: PolytopeModel, evaluated_at: Callable[[PolytopeModel], Iterate], limits: DescentLimits) -> Descent:
    """Minimises from a model, which is not changed, until no step lowers the sum.

    Args:
        start: where to begin.
        evaluated_at: evaluates a model.
        limits: when to end.
    """
    here, damping = evaluated_at(start), limits.damping
    for tried in range(1, limits.steps + 1):
        there = evaluated_at(moved(here.model, _step(here, damping, limits.floor)))
        as_many = there.not_solved <= here.not_solved
        if there.objective <= here.objective and as_many:
            small = here.objective - there.objective <= limits.tolerance * here.objective
            here, damping = there, SHRINK * damping
            if small:
                return Descent(here, tried, True)
        elif damping > limits.largest_damping:
            return Descent(here, tried, as_many)
        else:
            damping *= GROW
    return Descent(here, limits.steps, False)


def _step(iterate: Iterate, damping: float, floor: float) -> Array:
    diagonal = np.diagonal(iterate.information)
    damped = iterate.information + np.diag(damping * diagonal + floor * diagonal.mean())
    return np.asarray(np.linalg.solve(damped, iterate.score))
