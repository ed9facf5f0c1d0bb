"""The exact protocol of a polytope: computes the optimum for its data at once, instead of gradient steps towards it.

Every fit begins at theta_0, which also holds what no toss measures (learning/fits/held_fit.py), over a level ground at the
board's zero. So theta follows from theta_0 and the data alone, and not from how training came there; and a fit that is killed
is made again with the same digits.

The few transitions that are explained worst may be left out, which ones being part of the fit: least trimmed squares (Rousseeuw
1984, with concentration steps: Rousseeuw and Van Driessen 2006), where "squares" are losses. Among them are the hard impacts,
which a rigid body without restitution cannot explain, so that throws that are designed to hit hard pull friction away from the
truth (docs/explanation/learning.md).
"""

import math
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
from contact_curation.learning.fits.held_fit import HeldFitConfig, fit_held
from contact_curation.motion.transitions import Transitions

CONCENTRATIONS = 4
"""Fits at most, after the first, each without the transitions that the one before explains worst."""


class Optimum(NamedTuple):
    """Result of a fit.

    Attributes:
        model: in the form of theta_0.
        steps: of Gauss-Newton, taken or not, of all fits.
        finite: whether the sum that was minimised is.
    """

    model: PolytopeModel
    steps: int
    finite: bool


def theta_0(model: Model) -> PolytopeModel:
    """A copy of a model over the ground as it is known, to begin fits at.

    Raises:
        InvalidValueError: it is no polytope in the physical or the rigid form.
    """
    geometry, form = model.geometry(), model.settings().get("form")
    if geometry is None or form not in (Form.PHYSICAL, Form.RIGID):
        found = model.kind if geometry is None else f"{model.kind} in the {form} form"
        raise InvalidValueError("model to train exactly", f"a {found}", "a polytope in the physical or the rigid form")
    friction = float(np.linalg.norm(geometry.tangents[0]))
    level = replace(geometry, normal=UPWARD, tangents=friction * np.eye(2, 3), height=0.0)
    return PolytopeModel(level, model.body, Form(form))


def optimum(start: PolytopeModel, data: Transitions, loss: LossConfig, trimmed: float) -> Optimum:
    """The fit of a polytope from `theta_0` on.

    Args:
        start: theta_0; it is not changed.
        data: at least one toss.
        loss: what is minimised.
        trimmed: share of the transitions that is left out.
    """
    config = HeldFitConfig(loss=loss)
    with np.errstate(all="ignore"):  # what is not finite is said, not warned of
        found = fit_held(start, data, config)
        steps, kept = found.steps, np.ones(len(data.dt), dtype=bool)
        for _ in range(CONCENTRATIONS if trimmed else 0):
            before, kept = kept, _explained(found.model, data, loss, trimmed)
            if (kept == before).all():
                break
            found = fit_held(found.model, _only(data, kept), config, origin=start)
            steps += found.steps
    return Optimum(found.model, steps, bool(np.isfinite(found.objective)))


def _explained(model: PolytopeModel, data: Transitions, loss: LossConfig, trimmed: float) -> NDArray[np.bool_]:
    """(N,) all but the share with the largest losses; what has no certificate counts as worst."""
    with torch.no_grad():
        batch = model.batch_loss(Rows(data.before, data.after, data.dt), loss)
    losses = np.where(batch.solved.numpy(), batch.losses.numpy(), np.inf)
    kept = np.zeros(len(losses), dtype=bool)
    kept[np.argsort(losses, kind="stable")[: math.ceil((1.0 - trimmed) * len(losses))]] = True
    return kept


def _only(data: Transitions, kept: NDArray[np.bool_]) -> Transitions:
    """Some rows, and the tosses that have any of them."""
    counts = np.bincount(data.toss_index[kept], minlength=len(data.toss_ids))
    return Transitions(
        toss_ids=tuple(toss_id for toss_id, count in zip(data.toss_ids, counts, strict=True) if count),
        before=data.before[kept],
        after=data.after[kept],
        dt=data.dt[kept],
        starts=np.concatenate([[0], np.cumsum(counts[counts > 0])]),
    )
