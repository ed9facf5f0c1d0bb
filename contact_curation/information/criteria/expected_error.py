"""The expected error of parameters that are estimated from some tosses of a pool, against all of them.

Of a set S, in coordinates where the pool's mean toss is the identity and in units of the scores' variance there,

    |d_S - d|^2 + c tr A_S^-1,      d_S = A_S^-1 sum_S s,  A_S = A0 + sum_S F,  d likewise over the pool

F Fisher matrices, s scores (see `optimum_shift`). The first term is the excess of the pool's loss per toss at the
estimate from S over its minimum; the second is its mean if the scores of S were noise.

One toss more, of factor Z and score s, changes A^-1 by Sherman, Morrison and Woodbury: `joined`. Most tosses need not be looked
at so closely, for a lower bound costs a tenth of it (`bounds`). With A' = A + F and r = sum s - A' d the first term is
|A'^-1 r|^2, and for every vector z, by Cauchy and Schwarz, and for every matrix B, the trace of the inverse being convex,

    |A'^-1 r| >= z.r / |A' z|,        tr A'^-1 >= tr B^-1 - tr B^-2 (A' - B)

Taken are B = A plus the mean toss, and z = B^-2 r, for which the first would be an equality if A' were B.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.information.optimum_shift import PoolScores
from contact_curation.information.pool import CHUNK, Indices, Pool

CAUTION = 0.1
"""c. At 1 a set would be as much for what it knows as for what it says; a tenth keeps it from directions that nothing holds."""

LARGEST_HELD = 1 << 25
"""Numbers in the whitened factors of a pool that are held, 256 MB; those of a larger pool are made when they are needed."""

DIRECTIONS = 16
"""In which a toss's information counts exactly in a bound: those known worst. In the others it counts as in the next one."""


class Sums(NamedTuple):
    """Sums over some tosses: A (p, p), its inverse, and the sum of their scores (p,)."""

    matrix: Array
    inverse: Array
    score: Array


class _Tosses(NamedTuple):
    """Some tosses: factors (b, R, p), filled up with rows of zeros; s - F d (b, p), how each pulls away from d; tr F (b,)."""

    rows: Array
    pulls: Array
    traces: Array


@dataclass(frozen=True, eq=False)
class ExpectedError:
    """The expected error of sets of tosses for one particle; made by `of`.

    Attributes:
        pool: K tosses.
        coordinates: (P, p) in which the mean toss is the identity.
        known: the tosses' scores, there.
        doubt: c; without regard to what is meant, 0 where the scores of all tosses are equal.
    """

    pool: Pool
    coordinates: Array
    known: PoolScores
    doubt: float

    @staticmethod
    def of(pool: Pool, coordinates: Array, prior: float) -> "ExpectedError":
        """The measure of a pool's sets.

        Args:
            pool: the pool.
            coordinates: (P, p) in which its mean toss is the identity.
            prior: delta > 0: A0 is this share of the mean toss.
        """
        return ExpectedError.against(PoolScores.of(pool, coordinates, prior), pool, coordinates)

    @staticmethod
    def against(known: PoolScores, pool: Pool, coordinates: Array) -> "ExpectedError":
        """The measure of a pool's sets against the tosses whose shift and scatter are known."""
        silent = not known.scores.any()  # then sets differ by what they know alone
        return ExpectedError(pool, coordinates, known, CAUTION if silent else CAUTION * known.scatter)

    def sums(self, selected: Sequence[int]) -> Sums:
        """Of a set."""
        rows = self._rows(selected).reshape(-1, self._size)
        return _sums_of(self.known.prior * np.eye(self._size) + rows.T @ rows, self.known.scores[list(selected)].sum(axis=0))

    def with_toss(self, sums: Sums, index: int) -> Sums:
        """Sums of the set and one more toss."""
        rows = self._rows([index])[0]
        return _sums_of(sums.matrix + rows.T @ rows, sums.score + self.known.scores[index])

    def value(self, sums: Sums) -> float:
        """The expected error of the set."""
        off = sums.inverse @ sums.score - self.known.shift
        return float(off @ off + self.doubt * np.trace(sums.inverse))

    def joined(self, sums: Sums, indices: Indices) -> Array:
        """(b,) expected errors of the set with each of some tosses added."""
        rows, scores = self._rows(indices), sums.score + self.known.scores[indices]
        gained = (rows.reshape(-1, self._size) @ sums.inverse).reshape(rows.shape)  # (b, R, p) Z A^-1
        steps = scores @ sums.inverse  # (b, p)
        inner = gained @ rows.swapaxes(1, 2)  # (b, R, R)
        np.einsum("brr->br", inner)[...] += 1.0
        along = np.concatenate([gained @ gained.swapaxes(1, 2), rows @ steps[..., None]], axis=2)  # (b, R, R + 1)
        solved = np.linalg.solve(inner, along)
        off = steps - (solved[:, None, :, -1] @ gained)[:, 0] - self.known.shift
        traces = np.trace(sums.inverse) - np.trace(solved[..., :-1], axis1=1, axis2=2)
        return np.asarray((off * off).sum(axis=1) + self.doubt * traces)

    def bounds(self, sums: Sums, indices: Indices) -> Array:
        """(n,) lower bounds on `joined` for some tosses."""
        values, vectors = np.linalg.eigh(sums.matrix + np.eye(self._size))
        half, weights = vectors / values, values**-2  # B^-1 = half @ vectors^T; weights descending
        count = min(DIRECTIONS, self._size - 1)
        weak = vectors[:, :count] * np.sqrt(weights[:count] - weights[count])
        pull, most = sums.score - sums.matrix @ self.known.shift, (1.0 / values).sum() + weights.sum()
        found = [np.zeros(0)]
        for first in range(0, len(indices), CHUNK):
            rows, pulls, traces = self._tosses(indices[first : first + CHUNK])
            residuals = (pull + pulls) @ half  # (b, p)
            lengths = np.square(residuals).sum(axis=1)  # z.r
            trials = residuals @ half.T  # (b, p) z
            turned = trials @ sums.matrix + ((rows @ trials[..., None])[..., 0][:, None] @ rows)[:, 0]  # (b, p) A' z
            told = weights[count] * traces + np.square(rows @ weak).sum(axis=(1, 2))
            reached = np.square(turned).sum(axis=1)
            offs = np.divide(lengths * lengths, reached, out=np.zeros_like(reached), where=reached > 0.0)
            found.append(offs + self.doubt * np.maximum(most - told, 0.0))
        return np.concatenate(found)

    @property
    def _size(self) -> int:
        return int(self.coordinates.shape[1])

    @cached_property
    def _held(self) -> _Tosses | None:
        """All tosses; None where their factors would be too many numbers."""
        most = max(info.factor.shape[0] for info in self.pool.infos)
        if len(self.pool) * most * self._size > LARGEST_HELD:
            return None
        held = _Tosses(np.zeros((len(self.pool), most, self._size)), np.empty_like(self.known.scores), np.empty(len(self.pool)))
        for chunk in self.pool.chunks():
            rows, held.pulls[chunk], held.traces[chunk] = self._whitened(chunk)
            held.rows[chunk, : rows.shape[1]] = rows
        return held

    def _rows(self, indices: Sequence[int] | Indices) -> Array:
        """(b, R, p) of some tosses."""
        where = np.asarray(indices, dtype=np.int64)
        if self._held is not None:
            return np.asarray(self._held.rows[where])
        return self.pool.stacked(where) @ self.coordinates if where.size else np.zeros((0, 0, self._size))

    def _tosses(self, indices: Indices) -> _Tosses:
        held = self._held
        return self._whitened(indices) if held is None else _Tosses(*(each[indices] for each in held))

    def _whitened(self, indices: Indices) -> _Tosses:
        rows = self.pool.stacked(indices) @ self.coordinates
        pulls = self.known.scores[indices] - ((rows @ self.known.shift)[:, None] @ rows)[:, 0]
        return _Tosses(rows, pulls, np.square(rows).sum(axis=(1, 2)))


def _sums_of(matrix: Array, score: Array) -> Sums:
    return Sums(matrix, np.linalg.inv(matrix), score)
