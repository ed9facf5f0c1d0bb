"""The kept set whose own answer is the pool's.

Near theta the loss of tosses S is lowest at theta + d_S, one Newton step away, and that of the whole pool at theta + d:

    d_S = (A0 + sum_S F)^-1 sum_S s,        d likewise over the pool;   F Fisher matrices, s scores

Kept is the set for which, in coordinates where the pool's mean toss is the identity,

    |d_S - d|^2 + c sigma^2 tr (A0 + sum_S F)^-1                         sigma^2: the scores' variance in the pool

is small. The first term is what the pool's loss per toss is above its lowest at what S teaches; the second is what it would be
in the mean if the scores of S were noise. Where theta is far off, sigma^2 is large and the set is chosen for what it knows
(A-optimality); near the optimum the scores are known, and the set is chosen so that they cancel as the pool's do.

Why not for what it knows alone: how much a toss knows goes with how it came out. A toss in which the body happened to slide
easily lasts longer and knows more, so that the most informative tosses, and the longest ones, agree on too low a friction
(docs/rule.md). Here they are balanced by tosses that pull the other way.

The set is built greedily and then improved by exchanges of one toss for another, until none helps. There is no guarantee: the
sum is not submodular.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.information.pool import Indices, Pool
from contact_curation.information.ranking import Selection, greedy_selection
from contact_curation.information.ties import first_of_the_best

CAUTION = 0.1
"""c. At 1 a set would be as much for what it knows as for what it says; a tenth keeps it from directions that nothing holds."""

EXCHANGES = 2
"""Passes over the kept tosses, each of which may give way to a better one."""


def select_representative(pools: Sequence[Pool], coordinates: Sequence[Array], top: int, prior: float) -> Selection:
    """The set of up to `top` tosses.

    Args:
        pools: the same tosses, once per parameter particle; the sums above are averaged over them.
        coordinates: per particle (P, p) in which the pool's mean toss is the identity.
        top: how many tosses to keep.
        prior: delta > 0: A0 is this share of the mean toss.
    """
    targets = [_Target.of(pool, c, prior) for pool, c in zip(pools, coordinates)]
    singles = -_costs(targets, [])
    picks: list[int] = []
    while len(picks) < min(top, len(pools[0])):
        picks.append(_best(targets, picks))
    for _ in range(EXCHANGES):
        before = list(picks)
        for place in range(len(picks)):
            picks[place] = _best(targets, picks[:place] + picks[place + 1 :])
        if picks == before:
            break
    values = [_cost(targets, picks[:count]) for count in range(len(picks) + 1)]
    others = np.setdiff1d(np.arange(len(pools[0])), picks)
    final = np.zeros(len(pools[0]))
    final[others] = values[-1] - _costs(targets, picks)[others]
    return greedy_selection(np.array(picks), -np.diff(values), singles, final)


def _best(targets: Sequence["_Target"], kept: Sequence[int]) -> int:
    """The toss that is best added to the kept ones; ties go to the smaller id."""
    return first_of_the_best(-_costs(targets, kept))


def _costs(targets: Sequence["_Target"], kept: Sequence[int]) -> Array:
    """(K,) what is to be small, with each toss added to the kept ones; inf for those themselves."""
    costs = np.asarray(np.mean([target.costs(kept) for target in targets], axis=0))
    costs[list(kept)] = np.inf
    return costs


def _cost(targets: Sequence["_Target"], kept: Sequence[int]) -> float:
    return float(np.mean([target.cost(kept) for target in targets]))


@dataclass(frozen=True, eq=False)
class _Target:
    """What one particle's sets are measured by.

    Attributes:
        pool: its tosses.
        coordinates: (P, p) in which the mean toss is the identity.
        scores: (K, p) of the tosses, there.
        prior: delta.
        answer: (p,) d.
        doubt: c sigma^2.
    """

    pool: Pool
    coordinates: Array
    scores: Array
    prior: float
    answer: Array
    doubt: float

    @staticmethod
    def of(pool: Pool, coordinates: Array, prior: float) -> "_Target":
        scores = replace(pool, network_scores=None).toss_scores @ coordinates
        answer = scores.sum(axis=0) / (prior + len(scores))
        return _Target(pool, coordinates, scores, prior, answer, CAUTION * float(scores.var(axis=0).mean()))

    def cost(self, kept: Sequence[int]) -> float:
        """Of one set."""
        inverse, score = self._sums(kept)
        off = inverse @ score - self.answer
        return float(off @ off + self.doubt * np.trace(inverse))

    def costs(self, kept: Sequence[int]) -> Array:
        """(K,) of the set with each toss added, by the Sherman-Morrison-Woodbury formula."""
        inverse, score = self._sums(kept)
        costs = np.empty(len(self.pool))
        for chunk, rows in self._rows():
            costs[chunk] = self._joined(inverse, score, rows, self.scores[chunk])
        return costs

    def _joined(self, inverse: Array, score: Array, rows: Array, scores: Array) -> Array:
        """(b,) for tosses of factors (b, R, p) and scores (b, p)."""
        gained = rows @ inverse  # (b, R, p) Z X
        steps = (score + scores) @ inverse  # (b, p)
        inner = np.eye(rows.shape[1]) + gained @ rows.swapaxes(1, 2)
        along = np.concatenate([gained @ gained.swapaxes(1, 2), (rows @ steps[..., None])], axis=2)  # (b, R, R + 1)
        solved = np.linalg.solve(inner, along)
        off = steps - (gained.swapaxes(1, 2) @ solved[..., -1:])[..., 0] - self.answer
        traces = np.trace(inverse) - np.trace(solved[..., :-1], axis1=1, axis2=2)
        return np.asarray((off * off).sum(axis=1) + self.doubt * traces)

    def _sums(self, kept: Sequence[int]) -> tuple[Array, Array]:
        """(p, p) inverse of A0 + sum F, and (p,) sum of the scores."""
        size = self.coordinates.shape[1]
        rows = self._whitened(np.array(kept, dtype=np.int64)).reshape(-1, size) if kept else np.zeros((0, size))
        return np.linalg.inv(self.prior * np.eye(size) + rows.T @ rows), self.scores[list(kept)].sum(axis=0)

    def _rows(self) -> Iterator[tuple[Indices, Array]]:
        for chunk in self.pool.chunks():
            yield chunk, self._whitened(chunk)

    def _whitened(self, indices: Indices) -> Array:
        """(b, R, p)."""
        return self.pool.stacked(indices) @ self.coordinates
