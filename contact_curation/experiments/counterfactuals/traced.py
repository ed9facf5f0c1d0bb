"""Influence without the Hessian at the optimum: along a descent, and through random projections at several fits.

tracin  - sum over the models that a descent from theta_0 to the fit to all accepts of g . s_k, with g minus half the gradient
          of the judging loss there and s_k the toss's exact score (Pruthi and others 2020, TracInCP; steps count alike)
trak    - mean over fits to random halves of the pool of g P (P' F P)^-1 P' s_k, with F the Gauss-Newton matrix of the pool and
          P random columns, in coordinates where F over the number of tosses is the identity (Park and others 2023)
"""

import numpy as np

from contact_curation.contact.evaluation import evaluate
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form, parameter_form
from contact_curation.experiments.cell_run import FIT, ONE_THREAD
from contact_curation.experiments.counterfactuals.refitted import Laboratory
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.fits.damped_descent import DescentLimits, Iterate, descend
from contact_curation.learning.fits.held_fit import HeldSum
from contact_curation.motion.transitions import Transitions

HALVES, COLUMNS = 5, 16
"""Fits and columns of P."""


def tracin(laboratory: Laboratory) -> Array:
    """(K,) how much the training tosses lower the judging loss along a descent."""
    pool = laboratory.pool
    models = checkpoints(laboratory)
    weights = laboratory.training_weights
    pulls = [toss_scores(model, laboratory.judging, laboratory.weights).sum(axis=0) for model in models]
    return traced(np.array(pulls), np.array([toss_scores(model, pool.data, weights) for model in models]))


def traced(pulls: Array, scores: Array) -> Array:
    """(K,) sums of inner products over C checkpoints, of pulls (C, P) and scores (C, K, P)."""
    return np.asarray(np.einsum("cp,ckp->k", pulls, scores))


def checkpoints(laboratory: Laboratory) -> list[PolytopeModel]:
    """The models that a descent from theta_0 accepts, with the noise of the fit to all; the last one is near that fit."""
    pool, seen = laboratory.pool, list[Iterate]()
    weights = laboratory.training_weights
    counts = np.ones(len(pool.data.toss_ids))
    held = HeldSum(pool.data, counts, FIT, pool.origin.geometry(), FIT.noise[-1], weights)

    def watched(model: PolytopeModel) -> Iterate:
        found = held.iterate(model)
        if not seen or found.objective <= seen[-1].objective:
            seen.append(found)
        return found

    descend(
        pool.origin,
        watched,
        DescentLimits(FIT.early_tolerance, FIT.steps, FIT.damping[0], FIT.largest_damping),
    )
    return [each.model for each in seen]


def trak(laboratory: Laboratory, turn: Array) -> Array:
    """(K,) how much the training tosses lower the judging loss, by sketches; `turn` (P, p) leads to the coordinates."""
    pool = laboratory.pool
    tosses, found = len(pool.data.toss_ids), []
    whole = turn.T @ pool.sums.fishers.sum(axis=0) @ turn
    for draw in range(HALVES):
        rng = np.random.default_rng([draw, 17])
        model = pool.refit(np.sort(rng.choice(tosses, tosses // 2, replace=False))).model
        pull = toss_scores(model, laboratory.judging, laboratory.weights).sum(axis=0) @ turn
        scores = toss_scores(model, pool.data, laboratory.training_weights) @ turn
        found.append(sketched(pull, scores, whole, rng.standard_normal((len(whole), min(COLUMNS, len(whole))))))
    return np.asarray(np.mean(found, axis=0))


def sketched(pull: Array, scores: Array, whole: Array, projection: Array) -> Array:
    """(K,) influence of scores (K, p) on a pull (p,) through a projection (p, r) of both and of the matrix (p, p)."""
    kernel = projection.T @ whole @ projection
    return np.asarray(scores @ projection @ np.linalg.solve(kernel, projection.T @ pull))


def toss_scores(model: PolytopeModel, data: Transitions, weights: Array) -> Array:
    """(K, P) exact scores of tosses, the sums over their solved transitions under weights (N,)."""
    geometry = model.geometry()
    found = evaluate(geometry, model.body, data.before, data.after, data.dt, ONE_THREAD)
    each = np.where(found.solved, weights, 0.0)[:, None] * np.nan_to_num(found.scores)
    return np.asarray(np.add.reduceat(each, data.starts[:-1], axis=0) @ parameter_form(geometry, Form.RIGID).chart)
