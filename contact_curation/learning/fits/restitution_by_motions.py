"""The restitution by which a fitted polytope predicts the motions of its tosses, together with the one that the fit learned.

A fit learns a restitution from the transitions of impacts. Whatever else the model lacks there biases it, for instance contacts
that last for several frames; motions that are predicted with it depend on it most. So those of the tosses are predicted with a
grid of restitutions. The error of a toss is its position's over the mean one plus its rotation's over the mean one. The best of
the grid is taken for each of many bootstrap samples of the tosses; their mean is the restitution by motions, their deviation
its error. It and the fit's are averaged by their precisions: tosses whose motions hardly tell leave the fit's.
"""

import os

import numpy as np

from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.evaluation.evaluation import EvaluationConfig, motions_of
from contact_curation.learning.fits.refits import subset
from contact_curation.motion.transitions import Transitions

STEP = 0.05
GRID = np.maximum(STEP * np.arange(20), 0.001)
"""Without 0, with which rollouts take other steps in the air."""

OF_FIT = 0.1
"""Standard error of a fit's restitution, about as far as motions correct it (docs/results.md, "Bodies that bounce")."""

LEAST = 1e-6
"""A toss tells something whose errors differ by more over the grid [% of the width or degrees]."""

FEWEST, MOST = 8, 64
"""Tosses that tell a restitution, and as many as are rolled out at most, evenly out of all."""

SAMPLES = 500
"""Of the bootstrap."""


def restitution_by_motions(model: PolytopeModel, data: Transitions, loss: LossConfig) -> float:
    """The average of both; the model's own where too few motions tell.

    Args:
        model: fitted to the tosses, with a restitution.
        data: transitions between successive frames of the tosses.
        loss: whose solver's threads are used.
    """
    fitted = model.geometry().restitution
    assert fitted is not None
    count = len(data.toss_ids)
    if count < FEWEST:
        return fitted
    rolled_out, _ = subset(data, np.linspace(0, count - 1, min(count, MOST)).astype(int))
    errors = np.array([_errors(model.bouncing(each), rolled_out, loss) for each in GRID.tolist()])  # (E, K, 2)
    told = np.isfinite(errors).all(axis=(0, 2)) & (np.ptp(errors, axis=0).max(axis=1) > LEAST)
    errors = errors[:, told]
    tosses = errors.shape[1]
    if tosses < FEWEST:
        return fitted
    relative = (errors / errors.mean(axis=(0, 1))).sum(axis=2)  # (E, K)
    samples = np.random.default_rng(0).multinomial(tosses, np.full(tosses, 1.0 / tosses), SAMPLES)
    best = GRID[(relative @ samples.T).argmin(axis=0)]
    precisions = np.array([max(best.std(), 0.5 * STEP), OF_FIT]) ** -2.0
    return float(precisions @ [best.mean(), fitted] / precisions.sum())


def _errors(model: PolytopeModel, data: Transitions, loss: LossConfig) -> Array:
    """(K, 2) of position and rotation, NaN where a motion is not finite."""
    found = motions_of(model, data, EvaluationConfig(loss, threads=loss.threads or os.cpu_count() or 1)).errors
    return np.stack([found.position, found.rotation], axis=1)
