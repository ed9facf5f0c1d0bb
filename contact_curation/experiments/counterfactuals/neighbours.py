"""What each training toss is worth to a forecast by nearest neighbours: its Shapley value (Jia and others 2019).

A judging toss is forecast by the k training tosses whose releases are nearest; a training toss forecasts it as well as its
outcome is near, exp (-d^2 / 2) with d the distance of outcomes. The value of a set is the sum of this over its (at most) k
nearest, over k. With training tosses sorted by nearness and v their forecasts, the Shapley value is exact without subsets:

    phi_N = min(k, N) / (k N) v_N,      phi_i = phi_(i+1) + (v_i - v_(i+1)) / k * min(k, i) / i

Releases are height, speeds and spin, outcomes duration, distance and turn; each is divided by its deviation over the training
tosses. No model of contact is asked.
"""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.distance import cdist

from contact_curation.experiments.comparison.baselines import RELEASE, traits
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.toss import Toss

NEIGHBOURS = 5


def knn_shapley(training: Sequence[Toss], judging: Sequence[Toss]) -> Array:
    """(K,) mean values of the training tosses over the judging ones."""
    own, theirs = (np.array([traits(toss) for toss in side]) for side in (training, judging))
    spread = np.where(own.std(axis=0) > 0.0, own.std(axis=0), 1.0)
    own, theirs = own / spread, theirs / spread
    nearness = cdist(theirs[:, :RELEASE], own[:, :RELEASE])
    forecasts = np.exp(-0.5 * cdist(theirs[:, RELEASE:], own[:, RELEASE:], "sqeuclidean"))
    return shapley_values(nearness, forecasts, NEIGHBOURS).mean(axis=0)


def shapley_values(distances: Array, values: Array, neighbours: int) -> Array:
    """(J, K) Shapley values of K players in J games, by their distances (J, K) and what each adds as a neighbour (J, K)."""
    order = np.argsort(distances, axis=1, kind="stable")
    sorted_values = np.take_along_axis(values, order, axis=1)
    count = values.shape[1]
    places = np.arange(1, count)
    steps = (sorted_values[:, :-1] - sorted_values[:, 1:]) / neighbours * np.minimum(neighbours, places) / places
    last = sorted_values[:, -1:] * min(neighbours, count) / (neighbours * count)
    sums = np.cumsum(np.concatenate([last, steps[:, ::-1]], axis=1), axis=1)[:, ::-1]
    found = np.empty_like(values)
    np.put_along_axis(found, order, sums, axis=1)
    return found
