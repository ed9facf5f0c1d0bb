"""How well scores of tosses foresee what a model learns from a subset: the linear datamodeling score (Park and others 2023).

Each score foresees, for a subset S of the training tosses, how bad the model is that learns from S. Over many random subsets of
one size this is compared with the measured outcome by Spearman's rank correlation: 1 is a perfect order, 0 none. All is taken
at the fit to all training tosses, with F_k the Gauss-Newton matrix of toss k and s_k its score, both weighted by the noise of
impacts, in coordinates where the mean F is the identity:

trace              - sum_S tr F_k, in the units of theta                     trace-empirical: of the sums of squared scores
log-det            - log det (A0 + sum_S F_k)                                v-optimal: tr (A0 + sum_S F_k)^-1
representative     what that criterion makes small                           herding: | mean_S s - mean s |^2
facility-location  mean distance of a training toss's s to the nearest in S
influence          - sum_S g H^-1 s_k, with g the gradient of the judging tosses' loss and H half the exact Hessian of the sum
                   that was fitted, by differences of exact scores (Koh and Liang 2017). It is the only one that reads what
                   judges: a bound for what additive scores can foresee.
influence-set      the judging loss at the subset's own Newton step (the second order in it, too; Basu and others 2020)
duration, smoothness   - sum_S of seconds; sum_S of the mean square jerk      loss: sum_S of the mean loss of a toss

Intervals are percentiles over resampled subsets, whose ranks are those among all.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.stats import rankdata

from contact_curation.contact.evaluation import Estimator
from contact_curation.experiments.cell_run import ONE_THREAD, Row
from contact_curation.experiments.counterfactuals.refitted import Laboratory
from contact_curation.experiments.counterfactuals.table import OUTCOMES
from contact_curation.geometry.quaternions import Array
from contact_curation.information.criteria.expected_error import CAUTION
from contact_curation.information.pool import Indices
from contact_curation.information.subspace import identifiable_subspace
from contact_curation.learning.evaluation.bootstrap import BootstrapConfig, Interval
from contact_curation.learning.fits.polytope_sums import polytope_sums
from contact_curation.motion.smoothing import kinematics
from contact_curation.motion.toss import Toss

PRIOR = 1e-3
"""A0 as a share of the mean toss, as in `RankingConfig`."""

JUDGED = tuple(name for name in OUTCOMES if name != "friction")
"""Outcomes of which less is better."""


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
    whole = sums.fishers.sum(axis=0)
    turn = identifiable_subspace(whole).per_mean_toss(len(tosses))
    frames = np.diff(pool.data.starts)
    plain = {
        "trace": -np.trace(sums.fishers, axis1=1, axis2=2),
        "trace-empirical": -np.trace(empirical.fishers, axis1=1, axis2=2),
        "loss": sums.losses / frames,
        "duration": np.array([-toss.duration for toss in tosses]),
        "smoothness": np.array([_jerk(toss) for toss in tosses]),
    }
    return Known(
        turn.T @ sums.fishers @ turn, sums.scores @ turn, judged.scores.sum(axis=0) @ turn, turn.T @ pool.hessian() @ turn,
        turn.T @ judged.fishers.sum(axis=0) @ turn, plain,
    )  # fmt: skip


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


def datamodeling_scores(known: Known, ids: Sequence[str], rows: Sequence[Row], config: BootstrapConfig) -> list[Row]:
    """A row for each size, outcome and score: the correlation with its interval.

    Args:
        known: of the training tosses.
        ids: K, of the training tosses.
        rows: of refits of one body.
        config: of the intervals.
    """
    places = {name: place for place, name in enumerate(ids)}
    found: list[Row] = []
    for size in sorted({float(row["size"]) for row in rows}):
        own = [row for row in rows if float(row["size"]) == size]
        sets = [np.array([places[name] for name in str(row["tosses"]).split()]) for row in own]
        predicted = [foreseen(known, chosen) for chosen in sets]
        for outcome in JUDGED:
            measured = np.array([float(row[outcome]) for row in own])
            for name in predicted[0]:
                interval = rank_correlation(np.array([each[name] for each in predicted]), measured, config)
                row: Row = {"body": own[0]["body"], "size": size, "subsets": float(len(own)), "outcome": outcome, "score": name}
                found.append(row | {"spearman": interval.value, "low": interval.low, "high": interval.high})
    return found


def rank_correlation(one: Array, other: Array, config: BootstrapConfig) -> Interval:
    """Spearman's correlation of numbers (n,) and (n,) where both are finite, with its interval; NaN where one is constant."""
    finite = np.isfinite(one) & np.isfinite(other)
    count = int(finite.sum())
    if count < 3 or not np.ptp(one[finite]) or not np.ptp(other[finite]):
        return Interval(np.nan, np.nan, np.nan)
    pairs = np.stack([rankdata(values[finite]) - 0.5 * (count + 1) for values in (one, other)])  # (2, n), centred
    rng = np.random.default_rng(config.seed)
    draws = rng.multinomial(count, np.full(count, 1.0 / count), size=config.resamples) / count  # (R, n)
    outside = 0.5 * (1.0 - config.confidence)
    low, high = np.nanquantile(_correlations(pairs, draws), [outside, 1.0 - outside])
    return Interval(float(_correlations(pairs, np.full((1, count), 1.0 / count))[0]), float(low), float(high))


def _correlations(pairs: Array, weights: Array) -> Array:
    """(R,) Pearson's correlations of pairs (2, n) under weights (R, n) that sum to 1."""
    means = weights @ pairs.T  # (R, 2)
    covariance = weights @ (pairs[0] * pairs[1]) - means[:, 0] * means[:, 1]
    variances = weights @ np.square(pairs).T - np.square(means)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(covariance / np.sqrt(variances.prod(axis=1)))
