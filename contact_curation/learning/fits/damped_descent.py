"""Damped Gauss-Newton steps of a polytope down a sum of squares (Levenberg 1944, Marquardt 1963).

    theta <- theta + (H + d diag H)^-1 s,      H half the Gauss-Newton Hessian of the sum,  s minus half its gradient

A step is accepted when it lowers the sum, and d then shrinks; otherwise d grows. With some fifty parameters and the kernel's
exact matrices this takes a dozen steps to the optimum, where gradient descent takes thousands. The caller defines the sum.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.fits.polytope_sums import moved

SHRINK, GROW = 0.2, 4.0
"""Factors of the damping after a step that was accepted, and after one that was not."""


class Iterate(NamedTuple):
    """A model with the loss and its derivatives there.

    Attributes:
        model: in the physical form.
        objective: value of the sum, at least 0.
        score: (P,) minus half its gradient.
        information: (P, P) half its Gauss-Newton Hessian.
        not_solved: number of transitions without a certificate, which the sum leaves out; no step may raise it.
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
        tolerance: the descent has converged when a step lowers the sum by less than this share.
        steps: largest number of steps, accepted or not.
        damping: d of the first step.
        largest_damping: the descent ends when d exceeds this; steps are then so small that rounding hides any decrease.
        floor: share of H's mean diagonal that is always added to its diagonal, for parameters without information.
    """

    tolerance: float
    steps: int
    damping: float
    largest_damping: float
    floor: float = 0.0


class Descent(NamedTuple):
    """Result of a descent.

    Attributes:
        iterate: iterate with the lowest sum.
        steps: number of steps that were tried.
        arrived: whether the descent converged within the tolerance.
    """

    iterate: Iterate
    steps: int
    arrived: bool


def descend(start: PolytopeModel, evaluated_at: Callable[[PolytopeModel], Iterate], limits: DescentLimits) -> Descent:
    """Minimises a sum of squares until no step lowers it.

    Args:
        start: model at which the descent starts; it is not changed.
        evaluated_at: evaluates the sum and its derivatives at a model.
        limits: when the descent ends.
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
