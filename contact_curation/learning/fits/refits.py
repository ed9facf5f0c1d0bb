"""Refits a polytope to many subsets of a pool, each to the optimum of the same sum as `held_fit` in a fraction of its time.

The optimum of a subset is near that of its pool, so each descent starts there. With F_k the Fisher matrix of toss k at the
pool's optimum, half the Hessian of a subset's sum is near

    H = sum_S F_k + prior

which costs nothing to form. Steps H^-1 s, s minus half the gradient, then need losses and scores only, which take a fraction of
the time of Fisher matrices, and what the gradients of two points say of the Hessian between them corrects H (BFGS; Nocedal and
Wright 2006, section 6.1). The noise of impacts is learned from the subset, first at the pool's optimum, and then again at its
own, as `held_fit` does. The result is a minimum of the subset's own sum, with the subset's own noise; only which one of several
minima it is may differ from that of a fit from theta_0.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np

from contact_curation.contact.evaluation import Estimator, evaluate, predicted_impulses
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form, parameter_form
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.pool import Indices
from contact_curation.learning.fits.held_fit import HeldFitConfig, HeldSum, fit_held
from contact_curation.learning.fits.learned_noise import learned_noise
from contact_curation.learning.fits.polytope_sums import PolytopeSums, fixed_restitution, moved, polytope_sums
from contact_curation.motion.transitions import Transitions

SUFFICIENT, SHORTER, SHORTEST = 1e-4, 0.3, 1e-6
"""A step is accepted when the sum falls by this share of what its slope promises, and counts no fewer transitions; else it is
shortened, down to the last."""


@dataclass(frozen=True)
class RefitConfig:
    """Configuration of refits.

    Attributes:
        fit: the sum, and the fit to the whole pool.
        tolerance: a descent has converged when the next step would lower the sum by less than this share. Optima of subsets
            that are nearly the pool lie so near each other that with 1e-5 their order is partly where descents stopped.
        steps: largest number of steps of a descent.
    """

    fit: HeldFitConfig
    tolerance: float = 1e-9
    steps: int = 60


class Refit(NamedTuple):
    """Result of a refit.

    Attributes:
        model: fitted polytope with the noise that the subset has.
        held: the sum, with the noise that was learned last.
        objective: its value.
        evaluations: of the losses and scores of the subset.
        converged: whether the last descent converged.
    """

    model: PolytopeModel
    held: HeldSum
    objective: float
    evaluations: int
    converged: bool


class _Point(NamedTuple):
    """A model with the sum, minus half its gradient (P,), and the losses (N,) of its transitions, NaN if not solved.

    `fixed` is the place in theta of a restitution that no step from here may move, or None.
    """

    model: PolytopeModel
    objective: float
    score: Array
    losses: Array
    fixed: int | None

    @property
    def solved(self) -> int:
        """Number of transitions that the sum counts."""
        return int(np.isfinite(self.losses).sum())


class _Descent(NamedTuple):
    point: _Point
    evaluations: int
    converged: bool


@dataclass(frozen=True, eq=False)
class RefitPool:
    """K tosses, their optimum, and what is known there; made by `of`.

    Attributes:
        data: transitions of the tosses.
        origin: theta_0 of all fits, in the rigid form.
        model: the optimum of all tosses.
        config: of the refits.
    """

    data: Transitions
    origin: PolytopeModel
    model: PolytopeModel
    config: RefitConfig

    @staticmethod
    def of(origin: PolytopeModel, data: Transitions, config: RefitConfig) -> "RefitPool":
        """Fits all tosses.

        Raises:
            InvalidValueError: theta_0 is not in the rigid form, or its noise is never learned.
        """
        if origin.form is not Form.RIGID or config.fit.renewals < 1:
            found = f"the {origin.form} form, noise learned {config.fit.renewals} times"
            raise InvalidValueError("model to refit", found, "the rigid form, noise learned at least once")
        return RefitPool(data, origin, fit_held(origin, data, config.fit).model, config)

    @cached_property
    def sums(self) -> PolytopeSums:
        """Losses, scores and Fisher matrices of the tosses at the optimum of all, by the pool's noise."""
        return polytope_sums(self.model, self.data, Estimator.GAUSS_NEWTON, self.config.fit.loss)

    def prepare(self) -> None:
        """Makes what refits read, so that copies of the pool in other processes have it."""
        _ = self.sums, self._unweighted

    @cached_property
    def _unweighted(self) -> tuple[Array, Array]:
        """(N,) losses, NaN if not solved, and (N,) impulses of all transitions at the optimum of all."""
        return self._at(self.model, self.data)

    def hessian(self, step: float = 1e-4) -> Array:
        """(P, P) half the exact Hessian of the sum of all tosses at their optimum, by central differences of exact scores."""
        held = self.held_sum(self.data, *self._unweighted, self.model)
        ways = step * np.eye(self.sums.scores.shape[1])
        ends = [[_point(held, moved(self.model, sign * way)).score for way in ways] for sign in (-1.0, 1.0)]
        rows = (np.array(ends[0]) - np.array(ends[1])) / (2.0 * step)  # scores fall along a positive Hessian
        return np.asarray(0.5 * (rows + rows.T))

    def held_sum(self, data: Transitions, losses: Array, impulses: Array, model: PolytopeModel) -> HeldSum:
        """The sum that a subset minimises by a model's noise; (N,) losses and impulses of its transitions say how much."""
        noise = model.geometry().noise
        assert noise is not None  # of the rigid form
        weights, solved = 1.0 / noise.variances(impulses), np.isfinite(losses)
        share = float((weights * losses)[solved].sum() / losses[solved].sum())
        sigma = self.config.fit.noise[-1] * share
        return HeldSum(data, np.ones(len(data.toss_ids)), self.config.fit, self.origin.geometry(), sigma, weights, True)

    def refit(self, chosen: Indices) -> Refit:
        """The optimum of some tosses.

        Args:
            chosen: (k,) their places in the pool, k at least 1.
        """
        data, rows = subset(self.data, chosen)
        losses, impulses = (each[rows] for each in self._unweighted)
        model, evaluations, converged, objective = self.model, 0, False, np.nan
        if model.geometry().restitution is not None:
            model, evaluations = self._restituted(data, chosen)
            losses, impulses = self._at(model, data)
        for renewal in range(self.config.fit.renewals):
            if renewal:
                impulses = predicted_impulses(model.geometry(), model.body, data.before, data.dt)
            solved = np.isfinite(losses)
            model = model.with_noise(learned_noise(losses[solved], impulses[solved]))
            held = self.held_sum(data, losses, impulses, model)
            information = self.sums.fishers[chosen].sum(axis=0) + np.diag(held.curvature(self.sums.scores.shape[1]))
            found = _descend(model, partial(_point, held), np.linalg.inv(information), self.config)
            model, losses, objective = found.point.model, found.point.losses, found.point.objective
            evaluations, converged = evaluations + found.evaluations, found.converged
        return Refit(model, held, objective, evaluations, converged)

    def _restituted(self, data: Transitions, chosen: Indices) -> tuple[PolytopeModel, int]:
        """The optimum of some tosses with equal variances, by which `held_fit` learns a restitution, and its evaluations."""
        noise = self.config.fit.noise[-1]
        held = HeldSum(data, np.ones(len(data.toss_ids)), self.config.fit, self.origin.geometry(), noise, np.ones(len(data.dt)))
        fishers = polytope_sums(self.model, data, Estimator.GAUSS_NEWTON, self.config.fit.loss, held.weights).fishers
        information = fishers.sum(axis=0) + np.diag(held.curvature(fishers.shape[1]))
        found = _descend(self.model, partial(_point, held), np.linalg.inv(information), self.config)
        return found.point.model, found.evaluations

    def _at(self, model: PolytopeModel, data: Transitions) -> tuple[Array, Array]:
        """(N,) losses, NaN if not solved, and (N,) impulses of transitions at a model."""
        geometry = model.geometry()
        found = evaluate(geometry, model.body, data.before, data.after, data.dt, self.config.fit.loss)
        impulses = predicted_impulses(geometry, model.body, data.before, data.dt)
        return np.where(found.solved, found.losses, np.nan), impulses


def subset(data: Transitions, chosen: Indices) -> tuple[Transitions, Indices]:
    """The transitions of some tosses (k,), by their places, and the rows (n,) that these had."""
    rows = np.concatenate([np.arange(data.starts[place], data.starts[place + 1]) for place in chosen])
    starts = np.concatenate([[0], np.cumsum(np.diff(data.starts)[chosen])])
    names = tuple(data.toss_ids[place] for place in chosen)
    return Transitions(names, data.before[rows], data.after[rows], data.dt[rows], starts), rows


def _point(held: HeldSum, model: PolytopeModel) -> _Point:
    data, geometry = held.data, model.geometry()
    found = evaluate(geometry, model.body, data.before, data.after, data.dt, held.config.loss)
    weights = np.ones(len(data.dt)) if held.weights is None else held.weights
    counted = np.where(found.solved, weights * held.counts[data.toss_index], 0.0)
    score = (counted @ np.nan_to_num(found.scores)) @ parameter_form(geometry, Form.RIGID).chart
    objective, slope = held.held(model, float(counted @ np.nan_to_num(found.losses)), score)
    place = fixed_restitution(model, slope, held.restitution_held)
    if place is not None:
        slope[place] = 0.0
    return _Point(model, objective, slope, np.where(found.solved, found.losses, np.nan), place)


def _descend(start: PolytopeModel, at: Callable[[PolytopeModel], _Point], inverse: Array, config: RefitConfig) -> _Descent:
    """Quasi-Newton steps from a model, with (P, P) the inverse of half the Hessian to begin with."""
    here, evaluations = at(start), 1
    for _ in range(config.steps):
        direction = _within_bounds(here, inverse @ here.score)
        promised = float(here.score @ direction)  # by the whole step, if H were right
        if promised <= config.tolerance * here.objective:
            return _Descent(here, evaluations, True)
        share, there = 1.0, at(moved(here.model, direction))
        evaluations += 1
        while not (there.objective <= here.objective - SUFFICIENT * 2.0 * share * promised and there.solved >= here.solved):
            share *= SHORTER
            if share < SHORTEST:
                return _Descent(here, evaluations, False)
            there = at(moved(here.model, share * direction))
            evaluations += 1
        inverse = _corrected(inverse, share * direction, here.score - there.score)
        here = there
    return _Descent(here, evaluations, False)


def _within_bounds(here: _Point, direction: Array) -> Array:
    """The direction (P,), along the bound of a restitution that may not move."""
    if here.fixed is not None:
        direction[here.fixed] = 0.0
    return direction


def _corrected(inverse: Array, step: Array, change: Array) -> Array:
    """The BFGS update of an inverse (P, P), by a step (P,) and the change of half the gradient (P,) that it made."""
    along = float(step @ change)
    if along <= 1e-12 * float(np.linalg.norm(step) * np.linalg.norm(change)):
        return inverse  # the sum is not convex there
    left = np.eye(len(step)) - np.outer(step, change) / along
    return np.asarray(left @ inverse @ left.T + np.outer(step, step) / along)
