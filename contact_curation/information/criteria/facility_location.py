"""facility-location: every toss of the pool has a similar one among the selected (CRAIG; Mirzasoleiman, Bilmes, Leskovec 2020).

A toss is described by its score sum s, in coordinates in which the pool's mean toss is the identity. The set S maximises

    f(S) = mean_i max(0, r - min_{j in S} |s_i - s_j|)                                                  i over the pool

With r above every distance this is the mean distance to the nearest selected toss, lowered as far as it goes, which bounds by
how much the sum of scores of S, each weighted by the tosses nearest to it, misses the pool's. Here the tosses of S count once
each. f is monotone and submodular, so greedy selection reaches 63 % of the best f, and a gain only falls: a toss is looked at
again only while its last gain could be the largest (Minoux 1978). Distances are made for a few tosses at a time; no matrix of
all pairs is held.
"""

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.information.criteria.herding import score_criterion
from contact_curation.information.pool import CHUNK, Indices
from contact_curation.information.ranking import Selection, greedy_selection
from contact_curation.information.ties import first_of_the_best, tie_floor


def select_by_facility_location(features: Array, top: int) -> Selection:
    """Up to `top` tosses that are near to all; what a toss gains is by how much it lowers the mean distance.

    Args:
        features: (K, p), in the order of the ids.
        top: how many tosses to select.
    """
    everyone = np.arange(len(features))
    farthest = 2.0 * float(np.linalg.norm(features - features.mean(axis=0), axis=1).max())
    nearest = np.full(len(features), farthest)  # (K,) from each toss to the selected ones
    alone = _gains(features, nearest, everyone)
    bounds, picks, pick_gains = alone.copy(), list[int](), list[float]()
    for _ in range(min(top, len(features))):
        pick = _best(features, nearest, bounds)
        picks.append(pick)
        pick_gains.append(float(bounds[pick]))
        nearest = np.minimum(nearest, _distances(features, features[[pick]])[:, 0])
        bounds[pick] = -np.inf
    return greedy_selection(np.array(picks), np.array(pick_gains), alone, _gains(features, nearest, everyone))


def _best(features: Array, nearest: Array, bounds: Array) -> int:
    """The toss of the largest gain; those that could have it are looked at, and their `bounds` (K,) become their gains."""
    best = -np.inf
    order = np.argsort(-bounds, kind="stable")
    for first in range(0, len(order), CHUNK):
        block = order[first : first + CHUNK]
        block = block[bounds[block] >= tie_floor(best)] if np.isfinite(best) else block[np.isfinite(bounds[block])]
        if not block.size:
            break
        bounds[block] = _gains(features, nearest, block)
        best = max(best, float(bounds[block].max()))
    return first_of_the_best(bounds)


def _gains(features: Array, nearest: Array, indices: Indices) -> Array:
    """(b,) by how much the mean distance falls with each of some tosses."""
    blocks = [indices[first : first + CHUNK] for first in range(0, len(indices), CHUNK)]
    falls = [np.maximum(nearest[:, None] - _distances(features, features[block]), 0.0).mean(axis=0) for block in blocks]
    return np.concatenate(falls)


def _distances(features: Array, others: Array) -> Array:
    """(K, b) Euclidean distances."""
    from scipy.spatial.distance import cdist  # takes a while to import

    return np.asarray(cdist(features, others))  # toss by toss: no digits cancel, and none depend on the block


FACILITY_LOCATION = score_criterion(
    "facility-location",
    "fall of the mean distance to a selected toss",
    "deviation of the scores",
    select_by_facility_location,
)
