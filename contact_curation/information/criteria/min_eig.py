"""min-eig: greedy selection by the smallest eigenvalue (E-optimality), on the accumulated set (method.md 1.6).

Everything is whitened by the pool's mean toss on the identifiable subspace, A = delta I + sum_S Z^T Z, so the smallest
eigenvalue says how many average tosses' worth is known about the least known direction. It is not submodular, so an old gain
bounds nothing. But

    lambda_min(A) <= lambda_min(A + Z^T Z) <= lambda_min(V^T (A + Z^T Z) V)        for any orthonormal columns V

with V the eigenvectors of A's smallest eigenvalues (Rayleigh, Ritz): from the lowest one alone for the whole pool, from
sixteen for those that are left, and the exact value only for what may still win. The result is that of the full search.

While too few tosses are selected for A to have full rank, its smallest eigenvalue is the prior's whatever is added. Ties in it
are broken by the log-det gain, then by the id.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.information.accumulated import gains_of_rows
from contact_curation.information.criteria.criterion import Criterion, Need, RankingConfig, register
from contact_curation.information.pool import CHUNK, Indices, Pool
from contact_curation.information.ranking import Selection, greedy_selection
from contact_curation.information.subspace import pool_subspace
from contact_curation.information.ties import ABSOLUTE, RELATIVE, first_of_the_best, tie_floor

RITZ_DIRECTIONS = 16
BLOCK = 32
"""Candidates looked at together, from the largest first bound down."""


def select_by_min_eig(pools: Sequence[Pool], coordinates: Sequence[Array], top: int, prior: float) -> Selection:
    """The greedy set of up to `top` tosses.

    Args:
        pools: the same tosses, once per parameter particle; smallest eigenvalues are averaged over them.
        coordinates: per particle (P, p) C in which the pool's mean toss is the identity.
        top: how many tosses to select.
        prior: delta > 0.
    """
    state = _Particles(tuple(_Whitened.of(pool, c, prior * np.eye(c.shape[1])) for pool, c in zip(pools, coordinates)))
    singles = state.all_exact()
    left = np.ones(len(pools[0]), dtype=np.bool_)
    picks: list[int] = []
    lowest = [state.lowest]
    while left.any() and len(picks) < top:
        pick = _best(state, np.flatnonzero(left))
        state = state.joined(pick)
        left[pick] = False
        picks.append(pick)
        lowest.append(state.lowest)
    final = state.all_exact() - state.lowest
    return greedy_selection(np.array(picks), np.diff(lowest), singles, final, diagnostics=_rank_warning(state, prior))


def _best(state: "_Particles", left: Indices) -> int:
    """The toss of the largest smallest eigenvalue among those left; ties go by log-det gain, then by id."""
    bounds = state.first_bounds()[left]
    if bounds.max() <= state.lowest + state.slack:
        tied = left
    else:
        order = np.argsort(-bounds, kind="stable")
        tied = _largest_smallest_eigenvalue(state, left[order], bounds[order])
    return int(tied[0] if tied.size == 1 else tied[first_of_the_best(state.log_det_gains(tied))])


def _largest_smallest_eigenvalue(state: "_Particles", ordered: Indices, bounds: Array) -> Indices:
    """The tosses that tie for the largest value, ascending, given all candidates from the largest first bound down."""
    found: list[tuple[float, int]] = []
    best = -np.inf
    for first in range(0, ordered.size, BLOCK):
        if bounds[first] < tie_floor(best, state.slack):
            break
        block = ordered[first : first + BLOCK]
        block = block[state.ritz_bounds(block) >= tie_floor(best, state.slack)]
        if block.size:
            values = state.exact(block).tolist()
            found.extend(zip(values, block.tolist()))
            best = max(best, *values)
    return np.array(sorted(index for value, index in found if value >= tie_floor(best, state.slack)), dtype=np.int64)


def _rank_warning(state: "_Particles", prior: float) -> tuple[str, ...]:
    rank, directions = state.rank(prior)
    if rank >= directions:
        return ()
    return (f"the selected tosses' information has rank {rank} of {directions}: their smallest eigenvalue is the prior's",)


@dataclass(frozen=True, eq=False)
class _Particles:
    """The selected set under every particle; each value is the mean over them."""

    states: tuple["_Whitened", ...]

    @property
    def lowest(self) -> float:
        """Smallest eigenvalue of the selected set."""
        return float(np.mean([state.values[0] for state in self.states]))

    @property
    def slack(self) -> float:
        """How far rounding may move a smallest eigenvalue."""
        return max(ABSOLUTE, *(state.values.size * np.finfo(float).eps * float(state.values[-1]) for state in self.states))

    def rank(self, prior: float) -> tuple[int, int]:
        """Rank of the selected tosses' information, and the number of directions, of the particle with the smallest rank."""
        counts = [(int(np.count_nonzero(s.values > prior + RELATIVE * prior + self.slack)), s.values.size) for s in self.states]
        return min(counts, key=lambda count: count[0] - count[1])

    def joined(self, index: int) -> "_Particles":
        return _Particles(tuple(state.joined(index) for state in self.states))

    def first_bounds(self) -> Array:
        """(K,) upper bounds for all tosses of the pool."""
        return _mean([state.first_bounds() for state in self.states])

    def ritz_bounds(self, indices: Indices) -> Array:
        """(b,) tighter upper bounds."""
        return _mean([state.ritz_bounds(indices) for state in self.states])

    def exact(self, indices: Indices) -> Array:
        """(b,) smallest eigenvalue with each of the tosses added."""
        return _mean([state.exact(indices) for state in self.states])

    def all_exact(self) -> Array:
        """(K,) the same for all tosses; computed only where the first bound allows anything but the present value."""
        values = np.full(len(self.states[0].pool), self.lowest)
        open_ones = np.flatnonzero(self.first_bounds() > self.lowest + self.slack)
        for first in range(0, open_ones.size, CHUNK):
            chunk = open_ones[first : first + CHUNK]
            values[chunk] = self.exact(chunk)
        return values

    def log_det_gains(self, indices: Indices) -> Array:
        """(b,) log-det gain of each of the tosses."""
        chunks = [indices[first : first + CHUNK] for first in range(0, indices.size, CHUNK)]
        return np.concatenate([_mean([state.log_det_gains(chunk) for state in self.states]) for chunk in chunks])


@dataclass(frozen=True, eq=False)
class _Whitened:
    """The selected set of one particle.

    Attributes:
        pool: its tosses.
        coordinates: (P, p) in which the mean toss is the identity.
        matrix: (p, p) A.
        values: (p,) eigenvalues of A, ascending.
        vectors: (p, p) their eigenvectors, as columns.
    """

    pool: Pool
    coordinates: Array
    matrix: Array
    values: Array
    vectors: Array

    @staticmethod
    def of(pool: Pool, coordinates: Array, matrix: Array) -> "_Whitened":
        return _Whitened(pool, coordinates, matrix, *np.linalg.eigh(matrix))

    def joined(self, index: int) -> "_Whitened":
        rows = self.pool.stacked([index])[0] @ self.coordinates
        return _Whitened.of(self.pool, self.coordinates, self.matrix + rows.T @ rows)

    def first_bounds(self) -> Array:
        """(K,) from the eigenvector of the smallest eigenvalue, and from A's other eigenvalues (Weyl)."""
        direction = self.coordinates @ self.vectors[:, :1]  # (P, 1)
        bounds = np.empty(len(self.pool))
        for chunk in self.pool.chunks():
            factors = self.pool.stacked(chunk)
            along = (factors.reshape(-1, factors.shape[2]) @ direction).reshape(chunk.size, -1)
            above = self.values[factors.shape[1]] if factors.shape[1] < self.values.size else np.inf
            bounds[chunk] = np.minimum(self.values[0] + (along * along).sum(axis=1), above)
        return bounds

    def ritz_bounds(self, indices: Indices) -> Array:
        """(b,) from the eigenvectors of the smallest eigenvalues."""
        directions = self.vectors[:, :RITZ_DIRECTIONS]
        along = self.pool.stacked(indices) @ (self.coordinates @ directions)  # (b, R, m)
        return _smallest(np.diag(self.values[: directions.shape[1]]) + along.swapaxes(1, 2) @ along)

    def exact(self, indices: Indices) -> Array:
        rows = self.pool.stacked(indices) @ self.coordinates  # (b, R, p)
        return _smallest(self.matrix + rows.swapaxes(1, 2) @ rows)

    def log_det_gains(self, indices: Indices) -> Array:
        half_inverse = self.coordinates @ (self.vectors / np.sqrt(self.values))  # (P, p)
        return gains_of_rows(self.pool.stacked(indices) @ half_inverse).log_det


def _smallest(matrices: Array) -> Array:
    return np.asarray(np.linalg.eigvalsh(matrices)[:, 0])


def _mean(values: Sequence[Array]) -> Array:
    return np.asarray(np.mean(values, axis=0))


def _select(pools: Sequence[Pool], config: RankingConfig) -> Selection:
    coordinates = [pool_subspace(pool, config.cut).per_mean_toss(len(pool)) for pool in pools]
    return select_by_min_eig(pools, coordinates, config.top, config.prior)


MIN_EIG = register(
    Criterion(
        "min-eig",
        "smallest eigenvalue with the toss alone",
        "mean tosses",
        _select,
        needs=frozenset({Need.THETA, Need.SUBSPACE, Need.PRIOR}),
    )
)
