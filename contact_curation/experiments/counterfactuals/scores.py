"""Scores of a subset S of the training tosses that foresee, without a refit, how bad the model is that learns from S.

Where nothing else is said all is taken at the fit to all training tosses, with F_k the Gauss-Newton matrix of toss k and s_k
its score, both weighted by the noise of impacts, in coordinates where the mean F is the identity:

trace              - sum_S tr F_k, in the units of theta                     trace-empirical: of the sums of squared scores
log-det            - log det (A0 + sum_S F_k)                                v-optimal: tr (A0 + sum_S F_k)^-1
representative     what that criterion makes small                           herding: | mean_S s - mean s |^2
facility-location  mean distance of a training toss's s to the nearest in S
influence          - sum_S g H^-1 s_k, with g the gradient of the judging tosses' loss and H half the exact Hessian of the sum
                   that was fitted, by differences of exact scores (Koh and Liang 2017)
influence-set      the judging loss at the subset's own Newton step (the second order in it, too; Basu and others 2020)
tracin, trak       see `traced`                                               knn-shapley: see `neighbours`
duration, smoothness   - sum_S of seconds; sum_S of the mean square jerk      loss: sum_S of the mean loss of a toss

Both influences, tracin, trak and knn-shapley read the judging tosses, which no rule of selection may.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from contact_curation.contact.evaluation import Estimator
from contact_curation.experiments.cell_run import ONE_THREAD
from contact_curation.experiments.counterfactuals.neighbours import knn_shapley
from contact_curation.experiments.counterfactuals.refitted import Laboratory
from contact_curation.experiments.counterfactuals.traced import tracin, trak
from contact_curation.geometry.quaternions import Array
from contact_curation.information.criteria.expected_error import CAUTION
from contact_curation.information.pool import Indices
from contact_curation.information.subspace import identifiable_subspace
from contact_curation.learning.fits.polytope_sums import polytope_sums
from contact_curation.learning.fits.refits import RefitPool
from contact_curation.motion.smoothing import kinematics
from contact_curation.motion.toss import Toss

PRIOR = 1e-3
"""A0 as a share of the mean toss, as in `RankingConfig`."""


class Known(NamedTuple):
    """What is known of K training tosses at the fit to all.

    Attributes:
        fishers: (K, p, p) where their mean is the identity.
        scores: (K, p), there.
        pull: (p,) minus half the gradient of the judging tosses' summed loss, there.
        hessian: (p, p) half the exact Hessian of the sum of all training tosses, there.
        judging: (p, p) Fisher matrix of the judging tosses, there.
        plain: (K,) by name: scores of single tosses, summed over a set.
    """

    fishers: Array
    scores: Array
    pull: Array
    hessian: Array
    judging: Array
    plain: Mapping[str, Array]


def known_of(laboratory: Laboratory) -> Known:
    """Makes what the scores need."""
    pool, tosses = laboratory.pool, laboratory.bench.training
    sums = pool.sums
    judged = polytope_sums(pool.model, laboratory.judging, Estimator.GAUSS_NEWTON, ONE_THREAD)
    empirical = polytope_sums(pool.model, pool.data, Estimator.EMPIRICAL, ONE_THREAD)
    turn, fishers, scores = whitened(pool)
    frames = np.diff(pool.data.starts)
    plain = {
        "trace": -np.trace(sums.fishers, axis1=1, axis2=2),
        "trace-empirical": -np.trace(empirical.fishers, axis1=1, axis2=2),
        "tracin": -tracin(laboratory),
        "trak": -trak(laboratory, turn),
        "knn-shapley": -knn_shapley(tosses, laboratory.bench.held_out),
        "loss": sums.losses / frames,
        "duration": np.array([-toss.duration for toss in tosses]),
        "smoothness": np.array([_jerk(toss) for toss in tosses]),
    }
    return Known(
        fishers, scores, judged.scores.sum(axis=0) @ turn, turn.T @ pool.hessian() @ turn,
        turn.T @ judged.fishers.sum(axis=0) @ turn, plain,
    )  # fmt: skip


def whitened(pool: RefitPool) -> tuple[Array, Array, Array]:
    """(P, p) the way to coordinates where the mean Fisher matrix is the identity, the tosses' (K, p, p) and scores (K, p)."""
    sums = pool.sums
    turn = identifiable_subspace(sums.fishers.sum(axis=0)).per_mean_toss(len(sums.scores))
    return turn, turn.T @ sums.fishers @ turn, sums.scores @ turn


def _jerk(toss: Toss) -> float:
    """Mean square change of the acceleration from frame to frame [m^2/s^4]."""
    accelerations = kinematics(toss.stamps_ns, toss.positions, toss.orientations_wxyz).accelerations
    return float(np.square(np.diff(accelerations, axis=0)).sum(axis=1).mean())


def foreseen(known: Known, chosen: Indices) -> dict[str, float]:
    """How bad the model is that learns from some training tosses (k,), by each score; higher is worse."""
    fishers, scores = known.fishers, known.scores
    count, size = scores.shape
    information, own = PRIOR * np.eye(size) + fishers[chosen].sum(axis=0), scores[chosen]
    inverse = np.linalg.inv(information)
    shift = inverse @ own.sum(axis=0)
    off = shift - scores.sum(axis=0) / (PRIOR + count)
    distances = np.sqrt(np.square(scores[:, None] - own[None]).sum(axis=2))  # (K, k)
    return {
        **{name: float(values[chosen].sum()) for name, values in known.plain.items()},
        "log-det": -float(np.linalg.slogdet(information)[1]),
        "v-optimal": float(np.trace(inverse)),
        "representative": float(off @ off / scores.var(axis=0).mean() + CAUTION * np.trace(inverse)),
        "herding": float(np.square(own.mean(axis=0) - scores.mean(axis=0)).sum()),
        "facility-location": float(distances.min(axis=1).mean()),
        "influence": -float(known.pull @ np.linalg.solve(known.hessian, own.sum(axis=0))),
        "influence-set": float(shift @ known.judging @ shift - 2.0 * known.pull @ shift),
    }
