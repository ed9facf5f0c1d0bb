"""How well a selected set represents its pool (method.md 1.9, 2.2, 2.3).

The paper's theorem as a diagnostic: with the pooled information F whitened to the identity on the identifiable subspace, the
spectrum of F^(-1/2) (sum_S a F_tau) F^(-1/2) says in which directions the selected set S knows less or more than the pool.
With a = 1 it lies in [0, 1], and epsilon is the share missing in the worst direction; a = K / k or Horvitz-Thompson weights
compare the two per toss.

D- and E-efficiency are the geometric mean and the smallest of the same spectrum per selected toss, in units of the pool's mean
toss: 1 means that every direction gets what an average toss gives.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.pool import CHUNK, Pool
from contact_curation.information.record import TossInformation
from contact_curation.information.subspace import IdentifiableSubspace

DOMINANT = 0.5
"""A block with a larger share of the trace than this decides a trace ranking alone (method.md 2.2)."""

SINGULAR = 1e-12
"""An eigenvalue below this share of the largest is rounding: the selected set tells nothing in that direction."""

ROUNDING = float(np.finfo(np.float32).eps)
"""Scores of networks are kept in single precision."""


@dataclass(frozen=True, eq=False)
class SpectralDistance:
    """A weighted selected set's information relative to the pool's.

    Attributes:
        eigenvalues: (p,) ascending, all 1 when the selected set stands for the pool exactly.
    """

    eigenvalues: Array

    @property
    def epsilon(self) -> float:
        """How far the spectrum reaches from 1, on either side."""
        return max(1.0 - float(self.eigenvalues[0]), float(self.eigenvalues[-1]) - 1.0)


@dataclass(frozen=True)
class Efficiency:
    """Information of a selected set per toss in units of the pool's mean toss, or per transition of its mean transition.

    Attributes:
        determinant: D-efficiency: geometric mean over the directions.
        smallest: E-efficiency: the worst direction.
    """

    determinant: float
    smallest: float


@dataclass(frozen=True)
class SelectedGram:
    """The non-zero eigenvalues of a selected set's Gram matrix.

    Attributes:
        smallest: of those above rounding; 0 where there is none.
        largest: of all.
        rank: how many are above rounding.
        effective_rank: see above; 0 where all scores are zero.
    """

    smallest: float
    largest: float
    rank: int
    effective_rank: float


class BlockShare(NamedTuple):
    """The share of a pool's trace in one parameter block."""

    name: str
    share: float


def spectral_distance(
    pool: Pool, subspace: IdentifiableSubspace, selected: Sequence[str], weights: Array | float = 1.0
) -> SpectralDistance:
    """How far a selected set is from its pool.

    Args:
        pool: the pool.
        subspace: the identifiable subspace of the pool's Fisher matrix.
        selected: k ids.
        weights: (k,) of the selected tosses, or one for all: 1 for the plain sum, K / k to rescale it, 1 / inclusion
            probability for a random set (Horvitz and Thompson).

    Raises:
        InvalidValueError: a selected toss is not in the pool, or there is not one weight for each.
    """
    return SpectralDistance(np.linalg.eigvalsh(_relative_information(pool, subspace, selected, weights)))


def smallest_sufficient_k(
    pool: Pool, subspace: IdentifiableSubspace, order: Sequence[str], epsilon: float, *, rescaled: bool = False
) -> int | None:
    """The smallest k for which the first k tosses of a ranking are within epsilon of the pool; None if no k is.

    Args:
        pool: the pool.
        subspace: the identifiable subspace of the pool's Fisher matrix.
        order: ids, best first.
        epsilon: the largest `SpectralDistance.epsilon` allowed.
        rescaled: whether the sum over k tosses is weighted by K / k.

    Raises:
        InvalidValueError: an id is not in the pool.
    """
    indices = pool.indices_of(order)
    gathered = np.zeros((subspace.dimension, subspace.dimension))
    for first in range(0, indices.size, CHUNK):
        rows = pool.stacked(indices[first : first + CHUNK]) @ subspace.whitening  # (b, R, p)
        sums = gathered + np.cumsum(rows.swapaxes(1, 2) @ rows, axis=0)  # (b, p, p)
        gathered = sums[-1]
        if not rescaled and SpectralDistance(np.linalg.eigvalsh(gathered)).epsilon > epsilon:
            continue  # plain sums only come nearer, so none of this chunk is near enough
        counts = first + 1 + np.arange(len(sums))
        values = np.linalg.eigvalsh(sums) * ((len(pool) / counts)[:, None] if rescaled else 1.0)  # (b, p)
        enough = np.maximum(1.0 - values[:, 0], values[:, -1] - 1.0) <= epsilon
        if enough.any():
            return int(counts[enough.argmax()])
    return None


def efficiency(
    pool: Pool, subspace: IdentifiableSubspace, selected: Sequence[str], *, per_transition: bool = False
) -> Efficiency:
    """D- and E-efficiency of a selected set against its pool.

    Args:
        pool: the pool.
        subspace: the identifiable subspace of the pool's Fisher matrix.
        selected: at least one id.
        per_transition: whether to divide by the set's scored transitions instead of its tosses, since long tosses know more.

    Raises:
        InvalidValueError: nothing is selected, or a selected toss is not in the pool.
    """
    if not selected:
        raise InvalidValueError("selected tosses", "none", "at least one")
    counts = pool.scored_transitions if per_transition else np.ones(len(pool))
    fair_share = float(counts[pool.indices_of(selected)].sum() / counts.sum())
    values = np.linalg.eigvalsh(_relative_information(pool, subspace, selected, 1.0)) / fair_share
    if values[0] <= SINGULAR * values[-1]:
        return Efficiency(0.0, 0.0)
    return Efficiency(float(np.exp(np.log(values).mean())), float(values[0]))


def block_shares(infos: Sequence[TossInformation]) -> tuple[BlockShare, ...]:
    """Each parameter block's share of the trace of all tosses together; zeros when nothing is known.

    Raises:
        InvalidValueError: there is no toss.
    """
    if not infos:
        raise InvalidValueError("tosses", "none", "at least one")
    traces = np.sum([info.block_traces for info in infos], axis=0)
    total = float(traces.sum()) or 1.0
    return tuple(BlockShare(block.name, float(trace) / total) for block, trace in zip(infos[0].blocks, traces))


def dominance_warnings(shares: Sequence[BlockShare]) -> tuple[str, ...]:
    """A sentence about the block that holds more than half of the trace, if one of several does."""
    return tuple(
        f"block {share.name} holds {100.0 * share.share:.0f} % of the trace: a trace ranking is mostly a ranking by that block"
        for share in shares
        if share.share > DOMINANT and len(shares) > 1
    )


def selected_gram(scores: Array) -> SelectedGram:
    """The eigenvalues for scores (k, P) of k >= 1 selected tosses, or any vectors with the same inner products."""
    values = np.linalg.eigvalsh(scores @ scores.T)
    told = values[values > len(values) * ROUNDING * values[-1]]
    if not told.size:
        return SelectedGram(0.0, 0.0, 0, 0.0)
    shares = told / told.sum()
    return SelectedGram(float(told[0]), float(told[-1]), told.size, float(np.exp(-(shares * np.log(shares)).sum())))


def _relative_information(pool: Pool, subspace: IdentifiableSubspace, selected: Sequence[str], weights: Array | float) -> Array:
    """(p, p) weighted information of the selected set in coordinates where the pool's is the identity."""
    indices = pool.indices_of(selected)
    if np.ndim(weights) and np.shape(weights) != indices.shape:
        raise InvalidValueError("weights of the selected tosses", f"shape {np.shape(weights)}", f"({indices.size},)")
    roots = np.broadcast_to(np.sqrt(weights), indices.shape)
    total = np.zeros((subspace.dimension, subspace.dimension))
    for first in range(0, indices.size, CHUNK):
        chunk = slice(first, first + CHUNK)
        rows = (pool.stacked(indices[chunk]) * roots[chunk, None, None]).reshape(-1, pool.parameters) @ subspace.whitening
        total += rows.T @ rows
    return total
