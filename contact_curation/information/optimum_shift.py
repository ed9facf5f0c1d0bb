"""How far the optimum of a selected set is from that of its pool.

Near theta the loss of tosses S is lowest at theta + d_S, one Newton step away:

    d_S = (A0 + sum_S F)^-1 sum_S s                                          F Fisher matrices, s scores

In coordinates where the pool's mean toss is the identity all directions count by how sharply the pool knows them, and what
the scores of single tosses scatter by, sigma, is the natural unit: k tosses drawn at random come out sigma / sqrt k off.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.information.pool import Indices, Pool

NEGLIGIBLE = 1e-9
"""Scores that scatter by less than this share of their mean square say the same."""


@dataclass(frozen=True)
class OptimumShift:
    """How far the optimum of a selected set is from its pool's.

    Attributes:
        distance: root mean square over the directions of d_S - d, in units of sigma; 0 where no toss moves the optimum.
        at_random: expected for random subsets of the same size, if each toss knew as much as the average.
    """

    distance: float
    at_random: float

    def to_mapping(self) -> dict[str, Any]:
        """The values as manifests hold them."""
        return {"distance": self.distance, "at_random": self.at_random}


@dataclass(frozen=True, eq=False)
class PoolScores:
    """The tosses' scores where the pool's mean toss is the identity, in units of what they scatter by.

    Attributes:
        scores: (K, p).
        scatter: their mean variance over the directions: 1, or 0 where the scores of all tosses are equal.
        prior: delta: A0 is this share of the mean toss.
    """

    scores: Array
    scatter: float
    prior: float

    @staticmethod
    def of(pool: Pool, coordinates: Array, prior: float) -> "PoolScores":
        """The scores of a pool, through the sketch where there is one.

        Args:
            pool: the pool.
            coordinates: (P, p) in which its mean toss is the identity.
            prior: delta > 0.
        """
        scores = replace(pool, network_scores=None).toss_scores @ coordinates
        scatter, power = float(scores.var(axis=0).mean()), float(np.square(scores).mean())
        if scatter > NEGLIGIBLE * power:
            return PoolScores(scores / np.sqrt(scatter), 1.0, prior)
        return PoolScores(scores / np.sqrt(power or 1.0), 0.0, prior)

    @cached_property
    def shift(self) -> Array:
        """(p,) d, the difference from theta to the pool's optimum."""
        return np.asarray(self.scores.sum(axis=0) / (self.prior + len(self.scores)))


def optimum_shift(pool: Pool, coordinates: Array, selected: Sequence[int] | Indices, prior: float) -> OptimumShift:
    """Of k >= 1 tosses of a pool; the other arguments as in `PoolScores.of`."""
    known = PoolScores.of(pool, coordinates, prior)
    rows = (pool.stacked(selected) @ coordinates).reshape(-1, coordinates.shape[1])
    matrix = prior * np.eye(rows.shape[1]) + rows.T @ rows
    off = np.linalg.solve(matrix, known.scores[selected].sum(axis=0)) - known.shift
    return OptimumShift(
        distance=float(np.sqrt(np.square(off).mean())),
        at_random=float(np.sqrt(known.scatter * (1.0 / len(selected) - 1.0 / len(pool)))),
    )
