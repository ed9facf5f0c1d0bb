"""How far the optimum of a selected set is from that of its pool.

Near theta the loss of tosses S is lowest at theta + d_S, one Newton step away:

    d_S = (A0 + sum_S F)^-1 sum_S s                                          F Fisher matrices, s scores

In coordinates where the pool's mean toss is the identity all directions count by how sharply the pool knows them, and what
the scores of single tosses scatter by, sigma, is the natural unit: k tosses of which each knows as much as the average come
out sigma sqrt(1 / k - 1 / N) off. Real tosses know of few directions each, and sets that miss one are much further off, so that
a selected set is compared with subsets that are drawn.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.information.pool import Indices, Pool

DRAWN = 32
"""Random subsets of the same size, of which the median is taken."""

NEGLIGIBLE = 1e-9
"""Scores that scatter by less than this share of their mean square say the same."""


@dataclass(frozen=True)
class OptimumShift:
    """How far the optimum of a selected set is from its pool's.

    Attributes:
        distance: root mean square over the directions of d_S - d, in units of sigma; 0 where no toss moves the optimum.
        at_random: the median over random subsets of the same size.
    """

    distance: float
    at_random: float

    def to_mapping(self) -> dict[str, Any]:
        """The values as manifests hold them."""
        return {"distance": self.distance, "at_random": self.at_random}


@dataclass(frozen=True, eq=False)
class TossSums:
    """Sums over tosses that need not be in memory; they add up.

    Attributes:
        tosses: K.
        fisher: (P, P) of the Fisher matrices.
        score: (P,) of the scores s.
        square: (P, P) of s s^T.
    """

    tosses: int
    fisher: Array
    score: Array
    square: Array

    @staticmethod
    def of(pool: Pool) -> "TossSums":
        """Of a pool, through the sketch where there is one."""
        scores = _score_sums(pool)
        return TossSums(len(pool), pool.fisher, scores.sum(axis=0), scores.T @ scores)

    def __add__(self, other: "TossSums") -> "TossSums":
        tosses, fisher = self.tosses + other.tosses, self.fisher + other.fisher
        return TossSums(tosses, fisher, self.score + other.score, self.square + other.square)


@dataclass(frozen=True, eq=False)
class PoolScores:
    """The tosses' scores where the pool's mean toss is the identity, in units of what they scatter by.

    Attributes:
        scores: (K, p).
        shift: (p,) d, the difference from theta to the pool's optimum.
        scatter: their mean variance over the directions: 1, or 0 where the scores of all tosses are equal.
        prior: delta: A0 is this share of the mean toss.
    """

    scores: Array
    shift: Array
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
        scores = _score_sums(pool) @ coordinates
        scatter, unit = _units(float(scores.var(axis=0).mean()), float(np.square(scores).mean()))
        scores /= unit
        return PoolScores(scores, scores.sum(axis=0) / (prior + len(scores)), scatter, prior)

    @staticmethod
    def of_sums(pool: Pool, sums: TossSums, coordinates: Array, prior: float) -> "PoolScores":
        """The scores of a pool that is a part of the tosses of which the sums are; shift and scatter are those of all."""
        mean = sums.score @ coordinates / sums.tosses
        power = float(np.mean(np.sum(coordinates * (sums.square @ coordinates), axis=0))) / sums.tosses
        scatter, unit = _units(power - float(np.square(mean).mean()), power)
        shift = mean / unit * (sums.tosses / (prior + sums.tosses))
        return PoolScores(_score_sums(pool) @ coordinates / unit, shift, scatter, prior)


def optimum_shift(pool: Pool, coordinates: Array, selected: Sequence[int] | Indices, prior: float) -> OptimumShift:
    """Of k >= 1 tosses of a pool; the other arguments as in `PoolScores.of`."""
    known = PoolScores.of(pool, coordinates, prior)
    rng = np.random.default_rng(0)
    drawn = (np.sort(rng.choice(len(pool), len(selected), replace=False)) for _ in range(DRAWN))
    at_random = [_distance(pool, coordinates, known, subset) for subset in drawn]
    return OptimumShift(_distance(pool, coordinates, known, selected), float(np.median(at_random)))


def _distance(pool: Pool, coordinates: Array, known: PoolScores, chosen: Sequence[int] | Indices) -> float:
    rows = (pool.stacked(chosen) @ coordinates).reshape(-1, coordinates.shape[1])
    matrix = known.prior * np.eye(rows.shape[1]) + rows.T @ rows
    off = np.linalg.solve(matrix, known.scores[chosen].sum(axis=0)) - known.shift
    return float(np.sqrt(np.square(off).mean()))


def _score_sums(pool: Pool) -> Array:
    """(K, P) through the sketch where there is one."""
    return replace(pool, network_scores=None).toss_scores


def _units(scatter: float, power: float) -> tuple[float, float]:
    """The scatter in the unit of the scores, and the unit."""
    return (1.0, float(np.sqrt(scatter))) if scatter > NEGLIGIBLE * power else (0.0, float(np.sqrt(power or 1.0)))
