"""counterfactual: the set that a model of refits says predicts best; it reads training tosses only.

Some random sets of training tosses, of several sizes, are refitted exactly, and each is judged on training tosses that it left
out. A ridge regression foresees the outcome, the logarithms of mean position and rotation errors added, from what is known of a
set without a refit (`counterfactuals.scores`): logarithms of v-optimal, representative and herding, log-det, and the mean
duration. Its strength is that with the least error on left-out refits (Allen 1974). Datamodels (Ilyas and others 2022) regress
on membership, which takes many more refits than tosses. The set is then searched for: the best of some random ones, improved
by exchanges.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from contact_curation.experiments.cell_run import ONE_THREAD
from contact_curation.experiments.counterfactuals.scores import Known, foreseen, whitened
from contact_curation.geometry.quaternions import Array
from contact_curation.information.pool import Indices
from contact_curation.learning.evaluation.evaluation import EvaluationConfig, predicted_motions
from contact_curation.learning.fits.refits import RefitPool
from contact_curation.motion.toss import Toss

SIZES, REFITS, LEFT_OUT = (4, 8, 16, 32), 32, 64
"""Sizes of the refitted sets in turn, how many of all sizes, and left-out tosses that judge each."""

STRENGTHS = tuple(10.0**power for power in range(-2, 4))
RANDOM_SETS, PASSES, CANDIDATES = 300, 2, 30
"""Of the search: sets to begin with, rounds over the tosses of a set, and candidates in place of each."""


@dataclass(frozen=True, eq=False)
class Datamodel:
    """What foresees a set's outcome, up to a constant; lower is better.

    Attributes:
        known: of the K training tosses.
        weights: (f,) of the features of a set.
    """

    known: Known
    weights: Array

    def foreseen(self, chosen: Indices) -> float:
        """For tosses (k,) by their places."""
        return float(self.weights @ features(self.known, chosen))

    def best(self, size: int, rng: np.random.Generator) -> Indices:
        """(size,) places of the set that is foreseen as best, ascending."""
        count = len(self.known.scores)
        starts = [rng.choice(count, size, replace=False) for _ in range(RANDOM_SETS)]
        chosen = min(starts, key=self.foreseen)
        lowest = self.foreseen(chosen)
        for place in [*range(size)] * PASSES:
            others = np.setdiff1d(np.arange(count), chosen)
            for other in rng.choice(others, min(CANDIDATES, len(others)), replace=False):
                tried = chosen.copy()
                tried[place] = other
                if (value := self.foreseen(tried)) < lowest:
                    chosen, lowest = tried, value
        return np.sort(chosen)


def datamodel_of(pool: RefitPool, tosses: Sequence[Toss], seed: int) -> Datamodel:
    """Refits random sets of a pool's tosses and learns to foresee their outcomes.

    Args:
        pool: of the training tosses, at their fit.
        tosses: the same, K.
        seed: of the sets.
    """
    rng = np.random.default_rng([seed, 19])
    durations = np.array([toss.duration for toss in tosses])
    _, fishers, scores = whitened(pool)
    nothing = np.zeros(scores.shape[1])
    known = Known(
        fishers, scores, nothing, np.eye(len(nothing)), np.zeros((len(nothing), len(nothing))), {"duration": durations}
    )
    rows, outcomes = list[Array](), list[float]()
    for number in range(REFITS):
        order = rng.permutation(len(tosses))
        size = min(SIZES[number % len(SIZES)], len(tosses) // 2)
        chosen, judging = np.sort(order[:size]), order[size : size + LEFT_OUT]
        model = pool.refit(chosen).model
        errors = predicted_motions(model, [tosses[place] for place in judging], EvaluationConfig(loss=ONE_THREAD)).errors
        rows.append(features(known, chosen))
        outcomes.append(float(np.log(np.nanmean(errors.position)) + np.log(np.nanmean(errors.rotation))))
    return Datamodel(known, ridge(np.array(rows), np.array(outcomes)))


def features(known: Known, chosen: Indices) -> Array:
    """(f,) of tosses (k,) by their places."""
    found = foreseen(known, chosen)
    logs = [np.log(max(found[name], 1e-12)) for name in ("v-optimal", "representative", "herding")]
    return np.array([*logs, found["log-det"], found["duration"] / len(chosen)])


def ridge(rows: Array, outcomes: Array) -> Array:
    """(f,) weights of features (n, f) for outcomes (n,), by the strength with the least error on left-out rows.

    The features are divided by their deviations before they are regularised; the constant is free.
    """
    spread = np.where(rows.std(axis=0) > 0.0, rows.std(axis=0), 1.0)
    scaled, wanted = (rows - rows.mean(axis=0)) / spread, outcomes - outcomes.mean()
    found = [_with_strength(scaled, wanted, strength) for strength in STRENGTHS]
    return np.asarray(min(found, key=lambda each: each[0])[1] / spread)


def _with_strength(scaled: Array, wanted: Array, strength: float) -> tuple[float, Array]:
    """The mean square error on left-out rows, by the leverages of the others, and the weights."""
    inverse = np.linalg.inv(scaled.T @ scaled + strength * np.eye(scaled.shape[1]))
    weights = inverse @ scaled.T @ wanted
    leverages = np.einsum("ni,ij,nj->n", scaled, inverse, scaled) + 1.0 / len(wanted)
    return float(np.square((wanted - scaled @ weights) / (1.0 - leverages)).mean()), weights
