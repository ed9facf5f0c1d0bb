"""Rules of the literature that select tosses with weights, or from what criteria do not see; for comparison only.

- gradient-matching: tosses and weights whose weighted sum of scores is nearest to the pool's, by orthogonal matching pursuit:
  each step takes the toss along which the residual is largest, and all weights are then the best non-negative ones (GradMatch;
  Killamsetty and others 2021). With w of sum k, a toss counts w times.
- facility-weighted: the tosses of `facility-location`, each counted as often as pool tosses are nearest to it (CRAIG;
  Mirzasoleiman, Bilmes and Leskovec 2020).
- k-medoids: tosses amid k groups of releases and outcomes (height, speeds, spin, duration, distance and turn), by alternation
  (Park and Jun 2009) from a start by `facility-location`.
- strata: the pool sorted by duration and cut into k parts; one toss of each at random.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy.optimize import nnls
from scipy.spatial.distance import cdist

from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.information.criteria.criterion import RankingConfig
from contact_curation.information.criteria.facility_location import select_by_facility_location
from contact_curation.information.criteria.herding import whitened_scores
from contact_curation.information.pool import Indices, Pool
from contact_curation.motion.toss import Toss

SUM_HELD = 10.0
"""How much the sum of the weights of gradient-matching counts beside their match, in lengths of scores. At an optimum the mean
score of the pool is zero, which weights of zero would match."""

ROUNDS = 50
"""Of the alternation of k-medoids, at most."""

RELEASE = 4
"""Numbers of `traits` that are known at the release."""

type Weights = Mapping[str, float]
"""How often each selected toss counts, by its id."""


def gradient_matching(pool: Pool, tosses: Sequence[Toss], size: int, seed: int) -> Weights:
    """See the module."""
    scores = whitened_scores(pool, RankingConfig("herding"))
    picks, weights = matched(scores, size)
    return {pool.ids[pick]: float(weight) for pick, weight in zip(picks, weights, strict=True)}


def matched(scores: Array, size: int) -> tuple[list[int], Array]:
    """Places of up to `size` tosses of scores (K, p), and their weights (size,), which sum to `size` and are above 0."""
    one = SUM_HELD * float(np.sqrt(np.square(scores).sum(axis=1).mean())) * np.ones((len(scores), 1))
    rows = np.concatenate([scores, one], axis=1)
    target, picks, weights = rows.mean(axis=0), list[int](), np.zeros(0)
    for _ in range(min(size, len(rows))):
        along = rows @ (target - weights @ rows[picks])
        along[picks] = -np.inf
        picks.append(int(along.argmax()))
        weights, _ = nnls(rows[picks].T, target)
    weights = np.maximum(weights, 1e-3 * max(float(weights.max()), 1e-12))  # a fit is refused weights of zero alone
    return picks, weights * len(picks) / weights.sum()


def facility_weighted(pool: Pool, tosses: Sequence[Toss], size: int, seed: int) -> Weights:
    """See the module."""
    scores = whitened_scores(pool, RankingConfig("herding"))
    picks = select_by_facility_location(scores, size).order[:size]
    counts = np.bincount(cdist(scores, scores[picks]).argmin(axis=1), minlength=len(picks))
    return {pool.ids[pick]: len(picks) * count / len(scores) for pick, count in zip(picks, counts, strict=True)}


def k_medoids(pool: Pool, tosses: Sequence[Toss], size: int, seed: int) -> Weights:
    """See the module."""
    known = np.array([traits(toss) for toss in tosses])
    spread = known.std(axis=0)
    places = medoids((known - known.mean(axis=0)) / np.where(spread > 0.0, spread, 1.0), size)
    return {tosses[place].toss_id: 1.0 for place in places}


def medoids(features: Array, size: int) -> Indices:
    """(size,) places of the medoids of features (K, p)."""
    distances = cdist(features, features)
    chosen = np.sort(select_by_facility_location(features, size).order[:size])
    for _ in range(ROUNDS):
        group = distances[:, chosen].argmin(axis=1)
        moved = []
        for place in range(len(chosen)):
            members = np.flatnonzero(group == place)
            moved.append(int(members[distances[np.ix_(members, members)].sum(axis=1).argmin()]))
        if (np.sort(moved) == chosen).all():
            break
        chosen = np.sort(moved)
    return chosen


def strata(pool: Pool, tosses: Sequence[Toss], size: int, seed: int) -> Weights:
    """See the module."""
    rng = np.random.default_rng([seed, size, 13])
    order = np.argsort([toss.duration for toss in tosses], kind="stable")
    return {tosses[int(rng.choice(part))].toss_id: 1.0 for part in np.array_split(order, min(size, len(tosses)))}


def traits(toss: Toss) -> list[float]:
    """What is known of a toss without a model [m, m/s, m/s, rad/s, s, m, rad]; the first `RELEASE` are its release."""
    velocity, ends = toss.linear_velocities[0], toss.positions[[0, -1]]
    turn = quaternions.angle_between(toss.orientations_wxyz[:1], toss.orientations_wxyz[-1:])[0]
    across = float(np.linalg.norm(ends[1, :2] - ends[0, :2]))
    spin = float(np.linalg.norm(toss.angular_velocities[0]))
    return [ends[0, 2], float(np.linalg.norm(velocity[:2])), velocity[2], spin, toss.duration, across, float(turn)]


type Baseline = Callable[[Pool, Sequence[Toss], int, int], Weights]
BASELINES: dict[str, Baseline] = {
    "gradient-matching": gradient_matching,
    "facility-weighted": facility_weighted,
    "k-medoids": k_medoids,
    "strata": strata,
}
"""By name: from a scored pool, its tosses, a size and a seed to the selected tosses and their weights."""
