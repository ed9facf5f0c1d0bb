"""The exact training protocol of a polytope: fits it to the optimum for its data, instead of taking gradient steps towards it.

Every fit starts at theta_0 with a level ground at the board's zero. theta_0 is also the mean of the prior, which determines the
parameters without information (learning/fits/held_fit.py). So the result follows from theta_0 and the data alone, not from
earlier training, and a fit that was killed gives the same digits when it is repeated.

The sum has several minima, most of all for bodies that are no boxes: a vertex is lost, and another takes over its impulses.
So a fit may start several times: at theta_0, at the body as described, and at this body with perturbed vertices. All starts
have one sum, with equal variances; the fit goes on from the lowest minimum. The prior's mean stays theta_0.

Where theta has a restitution, what first impacts show of it may stand in the prior in place of theta_0's; the restitution is
then corrected by motions (restitution_by_motions.py), and the fit repeated with it.

A share of the transitions, those that are explained worst, may be left out: least trimmed squares (Rousseeuw 1984; with
concentration steps, Rousseeuw and Van Driessen 2006), with losses for squares. The fit is repeated until the same transitions
are left out.
Most of them are hard impacts, which a rigid body without restitution cannot explain. Throws that are designed to hit hard would
otherwise bias the friction (docs/explanation/learning.md).
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from contact_curation.contact.geometry_parameters import UPWARD
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.model import Model, Rows
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import InvalidValueError
from contact_curation.learning.evaluation.rebounds import Rebound, rebound_of
from contact_curation.learning.fits.held_fit import HeldFit, HeldFitConfig, fit_held
from contact_curation.learning.fits.restitution_by_motions import restitution_by_motions
from contact_curation.motion.transitions import Transitions

CONCENTRATIONS = 4
"""Largest number of fits after the first one, each without the transitions that the previous fit explains worst."""

PERTURBED = 0.15
"""Standard deviation of the vertices of further starts about the body as described [characteristic lengths]."""


class Optimum(NamedTuple):
    """Result of a fit.

    Attributes:
        model: fitted model in the form of theta_0.
        steps: number of Gauss-Newton steps of all fits, accepted or not.
        finite: whether the minimised sum is finite.
    """

    model: PolytopeModel
    steps: int
    finite: bool


def theta_0(model: Model) -> PolytopeModel:
    """A copy of a model with a level ground at the board's zero, at which fits start.

    Raises:
        InvalidValueError: the model is not a polytope in the physical or the rigid form.
    """
    geometry, form = model.geometry(), model.settings().get("form")
    if geometry is None or form not in (Form.PHYSICAL, Form.RIGID):
        found = model.kind if geometry is None else f"{model.kind} in the {form} form"
        raise InvalidValueError("model to train exactly", f"a {found}", "a polytope in the physical or the rigid form")
    friction = float(np.linalg.norm(geometry.tangents[0]))
    level = replace(geometry, normal=UPWARD, tangents=friction * np.eye(2, 3), height=0.0)
    return PolytopeModel(level, model.body, Form(form))


def optimum(
    start: PolytopeModel,
    data: Transitions,
    loss: LossConfig,
    trimmed: float,
    starts: int = 1,
    seen: Transitions | None = None,
    shape: float | None = None,
) -> Optimum:
    """Fits a polytope to tosses, starting at `theta_0`, and elsewhere.

    Args:
        start: theta_0; it is not changed.
        data: transitions of at least one toss.
        loss: weights and solver of the loss.
        trimmed: share of the transitions that is left out, from 0 to less than 1.
        starts: how many starts, at least 1.
        seen: transitions between successive frames of the same tosses, where theta has a restitution: what first impacts show
            of it is its prior, in place of that of theta_0, and motions correct it (restitution_by_motions.py). None where
            theta has none.
        shape: standard deviation of what is known of the vertices of theta_0 [characteristic lengths]; None for the spread of
            the published initialisation.
    """
    rebound = None if seen is None else rebound_of(seen, start.body)
    start, config = with_rebound(start, HeldFitConfig(loss=loss, shape=shape), rebound)
    with np.errstate(all="ignore"):  # `Optimum.finite` reports numbers that are not finite
        found = fit_held(start, data, config) if starts == 1 else _from_lowest(start, data, config, starts)
        steps, kept = found.steps, np.ones(len(data.dt), dtype=bool)
        if seen is not None:
            found, config = corrected_by_motions(found.model, start, data, seen, config)
            steps += found.steps
        for _ in range(CONCENTRATIONS if trimmed else 0):
            before, kept = kept, _explained(found.model, data, loss, trimmed)
            if (kept == before).all():
                break
            found = fit_held(found.model, _only(data, kept), config, origin=start)
            steps += found.steps
    return Optimum(found.model, steps, bool(np.isfinite(found.objective)))


def with_rebound(start: PolytopeModel, config: HeldFitConfig, rebound: Rebound | None) -> tuple[PolytopeModel, HeldFitConfig]:
    """Theta_0 and a configuration whose prior of the restitution is what first impacts show of it, if they do."""
    if rebound is None:
        return start, config
    shown = replace(start.geometry(), restitution=rebound.restitution)
    return PolytopeModel(shown, start.body, start.form), replace(config, restitution_spread=rebound.error)


def corrected_by_motions(
    model: PolytopeModel, origin: PolytopeModel, data: Transitions, seen: Transitions, config: HeldFitConfig
) -> tuple[HeldFit, HeldFitConfig]:
    """The fit with the restitution that motions correct, and its configuration, which holds that.

    Args:
        model: optimum of `data`, with a restitution.
        origin: theta_0.
        data: what is fitted to.
        seen: transitions between successive frames of the same tosses.
        config: of the fit before.
    """
    chosen = model.bouncing(restitution_by_motions(model, seen, config.loss))
    config = replace(config, restitution_held=True)
    return fit_held(chosen, data, config, origin), config


def lowest_minimum(origin: PolytopeModel, data: Transitions, config: HeldFitConfig, starts: int) -> HeldFit:
    """The lowest of the minima that several starts reach, of the sum with equal variances; with the steps of all."""
    early = replace(config, renewals=0)
    minima = [fit_held(origin, data, early)]
    minima += [fit_held(start, data, early, origin) for start in _elsewhere(origin, starts - 1)]
    best = min(minima, key=lambda one: one.objective if np.isfinite(one.objective) else np.inf)
    return best._replace(steps=sum(one.steps for one in minima))


def _from_lowest(origin: PolytopeModel, data: Transitions, config: HeldFitConfig, starts: int) -> HeldFit:
    best = lowest_minimum(origin, data, config, starts)
    found = fit_held(best.model, data, config, origin)
    return found._replace(steps=found.steps + best.steps)


def _elsewhere(origin: PolytopeModel, count: int) -> Iterator[PolytopeModel]:
    """Models over the ground of theta_0 with the vertices of the body as described, all but the first of them perturbed."""
    geometry, body = origin.geometry(), origin.body
    for number in range(count):
        noise = PERTURBED * np.random.default_rng(number).standard_normal(body.vertices.shape) * bool(number)
        vertices = body.scaled_vertices + noise
        yield PolytopeModel(replace(geometry, vertices_normal=vertices, vertices_tangent=vertices), body, origin.form)


def _explained(model: PolytopeModel, data: Transitions, loss: LossConfig, trimmed: float) -> NDArray[np.bool_]:
    """(N,) True for all but the share with the largest losses; transitions without a certificate count as the largest."""
    with torch.no_grad():
        batch = model.batch_loss(Rows(data.before, data.after, data.dt), loss)
    losses = np.where(batch.solved.numpy(), batch.losses.numpy(), np.inf)
    kept = np.zeros(len(losses), dtype=bool)
    kept[np.argsort(losses, kind="stable")[: math.ceil((1.0 - trimmed) * len(losses))]] = True
    return kept


def _only(data: Transitions, kept: NDArray[np.bool_]) -> Transitions:
    """The transitions of some rows (N,), and the tosses that have any of them."""
    counts = np.bincount(data.toss_index[kept], minlength=len(data.toss_ids))
    return Transitions(
        toss_ids=tuple(toss_id for toss_id, count in zip(data.toss_ids, counts, strict=True) if count),
        before=data.before[kept],
        after=data.after[kept],
        dt=data.dt[kept],
        starts=np.concatenate([[0], np.cumsum(counts[counts > 0])]),
    )
