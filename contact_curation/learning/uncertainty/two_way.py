"""Covariance of an estimate whose model is not quite right: clustered by toss and by impact (method.md 2.8).

    V = (K - 1) / K sum_k d_k d_k^T + B (sum_g s_g s_g^T) B + B sigma^4 A0 B
    d_k = (H - H_k + sigma^2 A0)^-1 s_k        B = (H + sigma^2 A0)^-1

The first sum is over the K tosses: the jackknife's form of the sandwich, which allows for few tosses (MacKinnon and White
1985). The second is over groups of transitions with alike impulses, from free flight to the hardest impacts. At the optimum
all pulls s_g on theta add up to zero. If the model is right each of them is as small as chance makes it. If slow contacts
want another friction than hard impacts, each group pulls with a force that grows with the number of tosses, so that this term
stays where the first one vanishes. Both together are two-way clustering (Cameron, Gelbach and Miller 2011) without its third
term, which subtracts what both contain; it is left out, because with few clusters the difference may be negative.

An interval has Student's t with one degree of freedom less than there are tosses or groups, whichever are fewer.
"""

import numpy as np
from scipy.stats import t as student

from contact_curation.contact.evaluation import Estimator, predicted_impulses
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.fits.polytope_sums import PolytopeSums, polytope_sums
from contact_curation.motion.transitions import Transitions

IMPULSES = (1e-9, 0.5, 1.5, 3.0, 6.0, 12.0, 25.0, 50.0)
"""Groups of transitions end at these normal impulses, relative to those of the body at rest."""

CONFIDENCE = 0.95
"""Of an interval."""


def impact_scores(model: PolytopeModel, data: Transitions, loss: LossConfig) -> Array:
    """(G, P) sums of the scores of transitions with alike predicted impulses; only groups that have any."""
    impulses = np.nan_to_num(predicted_impulses(model.geometry(), model.body, data.before, data.dt))
    groups = np.digitize(impulses, IMPULSES)
    order = np.argsort(groups, kind="stable")
    names, counts = np.unique(groups, return_counts=True)
    starts = np.concatenate([[0], np.cumsum(counts)])
    sorted_data = Transitions(tuple(map(str, names)), data.before[order], data.after[order], data.dt[order], starts)
    return polytope_sums(model, sorted_data, Estimator.EMPIRICAL, loss).scores


def two_way_covariance(sums: PolytopeSums, groups: Array, variance: float, prior: Array) -> Array:
    """The covariance V (P, P).

    Args:
        sums: of K tosses, with Gauss-Newton matrices.
        groups: (G, P) as `impact_scores` gives them.
        variance: sigma^2 of the residuals.
        prior: (P, P) A0.
    """
    held = sums.fishers.sum(axis=0) + variance * prior
    count = len(sums.scores)
    pulls = [np.linalg.solve(held - own, score) for own, score in zip(sums.fishers, sums.scores, strict=True)]
    away = np.array(pulls) - np.mean(pulls, axis=0)  # (K, P)
    steps = np.linalg.solve(held, np.concatenate([groups, variance * np.sqrt(prior)]).T).T
    return np.asarray((count - 1) / count * away.T @ away + steps.T @ steps)


def interval_factor(tosses: int, groups: int) -> float:
    """How many deviations an interval of `CONFIDENCE` has on either side."""
    return float(student.ppf(0.5 + 0.5 * CONFIDENCE, max(min(tosses, groups) - 1, 1)))
