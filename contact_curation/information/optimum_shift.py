"""What a kept set answers, beside what its pool answers.

Near theta the loss of tosses S is lowest at theta + d_S, one Newton step away:

    d_S = (A0 + sum_S F)^-1 sum_S s                                          F Fisher matrices, s scores

In coordinates where the pool's mean toss is the identity all directions count by how sharply the pool knows them, and what
the scores of single tosses scatter by, sigma, is the natural unit: k tosses drawn at random come out sigma / sqrt k off.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.information.pool import Indices, Pool

NEGLIGIBLE = 1e-9
"""Scores that scatter by less than this share of their mean square say the same."""


@dataclass(frozen=True)
class Answer:
    """How far what a kept set answers is from what its pool answers.

    Attributes:
        off: root mean square over the directions of d_S - d, in units of sigma; 0 where no toss asks for anything else.
        by_chance: what it would be for as many tosses at random, if each knew as much as the average.
    """

    off: float
    by_chance: float


@dataclass(frozen=True, eq=False)
class PoolScores:
    """The tosses' scores where the pool's mean toss is the identity, in units of what they scatter by.

    Attributes:
        scores: (K, p).
        scatter: their mean variance over the directions: 1, or 0 where all tosses say the same.
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
    def answer(self) -> Array:
        """(p,) d."""
        return np.asarray(self.scores.sum(axis=0) / (self.prior + len(self.scores)))


def answer_of(pool: Pool, coordinates: Array, kept: Sequence[int] | Indices, prior: float) -> Answer:
    """The answer of k >= 1 tosses of a pool; the other arguments as in `PoolScores.of`."""
    known = PoolScores.of(pool, coordinates, prior)
    rows = (pool.stacked(kept) @ coordinates).reshape(-1, coordinates.shape[1])
    matrix = prior * np.eye(rows.shape[1]) + rows.T @ rows
    off = np.linalg.solve(matrix, known.scores[kept].sum(axis=0)) - known.answer
    return Answer(
        off=float(np.sqrt(np.square(off).mean())),
        by_chance=float(np.sqrt(known.scatter * (1.0 / len(kept) - 1.0 / len(pool)))),
    )
