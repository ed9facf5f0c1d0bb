"""A polytope fitted to tosses to the last digit, by damped Gauss-Newton steps (Levenberg 1944, Marquardt 1963).

    theta <- theta + (H + d diag H)^-1 s,      H = sum_k w_k F_k the Gauss-Newton information,  s = sum_k w_k s_k the score

A step is taken when it lowers the weighted loss, and d then shrinks; otherwise d grows. With some fifty parameters and the
kernel's exact matrices a dozen steps reach the optimum that gradient descent needs thousands for. That makes it the tool for
questions about the optimum itself, such as how far it moves when tosses are drawn anew; a network has no such matrices.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from contact_curation.contact.evaluation import DEFAULT_LOSS, Estimator, LossConfig
from contact_curation.contact.polytope_model import PolytopeModel
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.polytope_sums import moved, polytope_sums
from contact_curation.motion.transitions import Transitions


@dataclass(frozen=True)
class FitConfig:
    """When a fit ends.

    Attributes:
        loss: what is minimised.
        tolerance: relative decrease of the loss by a step that counts as arrival.
        max_steps: tried ones, taken or not.
        damping: d of the first step.
        largest_damping: where a step as small as this makes it finds no lower loss, there is none that rounding can tell.
    """

    loss: LossConfig = field(default_factory=lambda: DEFAULT_LOSS)
    tolerance: float = 1e-9
    max_steps: int = 200
    damping: float = 1e-3
    largest_damping: float = 1e6

    def __post_init__(self) -> None:
        for name in ("tolerance", "max_steps", "damping", "largest_damping"):
            if not getattr(self, name) > 0:
                raise InvalidValueError(f"fit.{name}", getattr(self, name), "a positive number")


class PolytopeFit(NamedTuple):
    """Where a fit ended.

    Attributes:
        model: in the physical form.
        loss: weighted sum over all solved transitions.
        steps: how many were tried.
        converged: whether the last one was as small as wanted.
        not_solved: transitions without a certificate there.
    """

    model: PolytopeModel
    loss: float
    steps: int
    converged: bool
    not_solved: int


class _Place(NamedTuple):
    """A model, its weighted loss, score (P,), information (P, P), and how many transitions are not solved."""

    model: PolytopeModel
    loss: float
    score: Array
    information: Array
    not_solved: int


SHRINK, GROW = 0.2, 4.0
"""What the damping is multiplied with after a step that was taken, or was not."""

FLOOR = 1e-12
"""Share of the mean diagonal that is always added: a vertex that never came near the board stays where it is."""


def fit_polytope(
    model: PolytopeModel, data: Transitions, config: FitConfig | None = None, weights: ArrayLike | None = None
) -> PolytopeFit:
    """The optimum next to a model.

    Args:
        model: where to begin; it is not changed.
        data: at least one toss.
        config: when to end.
        weights: (K,) how often each toss counts, at least 0; once each by default.

    Raises:
        InvalidValueError: weights that do not fit, or a geometry that is not physical.
    """
    config = config or FitConfig()
    counts = _checked_weights(weights, len(data.toss_ids))
    here, damping = _place(model, data, counts, config), config.damping
    for tried in range(1, config.max_steps + 1):
        there = _place(moved(here.model, _step(here, damping)), data, counts, config)
        if there.loss <= here.loss and there.not_solved <= here.not_solved:
            arrived = here.loss - there.loss <= config.tolerance * here.loss
            here, damping = there, SHRINK * damping
            if arrived:
                return PolytopeFit(here.model, here.loss, tried, True, here.not_solved)
        elif damping > config.largest_damping:
            return PolytopeFit(here.model, here.loss, tried, there.not_solved <= here.not_solved, here.not_solved)
        else:
            damping *= GROW
    return PolytopeFit(here.model, here.loss, tried, False, here.not_solved)


def _place(model: PolytopeModel, data: Transitions, weights: Array, config: FitConfig) -> _Place:
    sums = polytope_sums(model, data, Estimator.GAUSS_NEWTON, config.loss)
    information = np.tensordot(weights, sums.fishers, axes=1)
    missing = int(sums.not_solved[weights > 0.0].sum())
    return _Place(model, float(weights @ sums.losses), weights @ sums.scores, information, missing)


def _step(place: _Place, damping: float) -> Array:
    diagonal = np.diagonal(place.information)
    damped = place.information + np.diag(damping * diagonal + FLOOR * diagonal.mean())
    return np.asarray(np.linalg.solve(damped, place.score))


def _checked_weights(weights: ArrayLike | None, tosses: int) -> Array:
    counts = np.ones(tosses) if weights is None else np.asarray(weights, dtype=float)
    if counts.shape != (tosses,) or not np.isfinite(counts).all() or counts.min() < 0.0 or not counts.any():
        raise InvalidValueError("weights", f"shape {counts.shape}", f"({tosses},) numbers of at least 0, one above")
    return counts
