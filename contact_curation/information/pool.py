"""The tosses that are ranked together: all scored at one theta, in the order of their ids, about one pivot.

Sorting by id first makes every later sum, tie and result independent of the order in which the tosses came. A toss comes with
the ground's tilt taken about its own centroid; factors and scores that are added to others' are taken about the pool's.

With the plane n(tilt) . (x - pivot) = height, moving the pivot by d changes only which combination of tilt and height is called
tilt: d/dtilt_a becomes d/dtilt_a + (b_a . d) d/dheight, b_a the direction in which tilt a moves the normal (method.md 1.1,
2.2). So nothing depends on where the board's origin lies.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.record import ParameterBlock, TossInformation

Indices = NDArray[np.int64]

CHUNK = 64
"""Tosses whose factors are stacked at a time: less than a MB, which stays in the cache, however large the pool is."""

SHARED = ("body", "model", "parameters_version", "estimator", "influence_bound", "blocks")
"""What the tosses of a pool must have in common for their information to be comparable."""


@dataclass(frozen=True, eq=False)
class Pool:
    """K tosses scored at one theta; made by `pool_of`.

    Attributes:
        infos: K records in the order of their ids, as they were scored.
        pivot: (3,) centroid of the pool, about which the tilt is taken wherever tosses are added.
        prior: (P, P) positive definite prior information A0 in the units of theta, the tilt about the pivot; None for a share
            of the mean toss's.
        network_scores: (K, M) vectors whose inner products are exactly those of the tosses' scores by the weights of networks;
            None to do with the sketch of these scores.
    """

    infos: tuple[TossInformation, ...]
    pivot: Array
    prior: Array | None = None
    network_scores: Array | None = None

    def __len__(self) -> int:
        return len(self.infos)

    @cached_property
    def ids(self) -> tuple[str, ...]:
        """K ids, ascending."""
        return tuple(info.toss_id for info in self.infos)

    @property
    def parameters(self) -> int:
        """P."""
        return self.infos[0].parameters

    @cached_property
    def scored_transitions(self) -> Indices:
        """(K,) how many transitions of each toss carry a score."""
        return np.array([info.transitions - info.not_scored for info in self.infos], dtype=np.int64)

    @cached_property
    def fisher(self) -> Array:
        """(P, P) pooled Fisher sum, up to the factors' truncation."""
        pooled = np.zeros((self.parameters, self.parameters))
        for indices in self.chunks():
            rows = self.stacked(indices).reshape(-1, self.parameters)
            pooled += rows.T @ rows
        pooled.flags.writeable = False
        return pooled

    def chunks(self) -> Iterator[Indices]:
        """All indices, a handful of tosses at a time."""
        for first in range(0, len(self), CHUNK):
            yield np.arange(first, min(first + CHUNK, len(self)))

    def stacked(self, indices: Sequence[int] | Indices) -> Array:
        """Factors (b, R, P) of b tosses about the pivot; rows of zeros fill up the shorter ones and carry no information."""
        factors = _stacked_factors([self.infos[i] for i in indices])
        return factors if self._shifts is None else sheared(factors, self.infos[0].blocks, self._shifts[indices, None])

    def traces_in(self, coordinates: Array) -> Array:
        """(K,) tr(C^T F C) of each toss, C being the coordinates (P, p)."""
        norms = np.empty(len(self))
        for chunk in self.chunks():
            factors = self.stacked(chunk)
            rows = factors.reshape(-1, self.parameters) @ coordinates
            norms[chunk] = (rows * rows).sum(axis=1).reshape(chunk.size, -1).sum(axis=1)
        return norms

    @cached_property
    def toss_scores(self) -> Array:
        """(K, P) sums of each toss's scores, about the pivot; `network_scores` in place of sketched columns."""
        blocks = self.infos[0].blocks
        scores = np.stack([info.score_sum for info in self.infos])
        if self._shifts is not None:
            scores = sheared(scores, blocks, self._shifts)
        if self.network_scores is not None:
            exact = [scores[:, block.start : block.stop] for block in blocks if not block.sketched]
            scores = np.concatenate([*exact, self.network_scores], axis=1)
        scores.flags.writeable = False
        return scores

    @property
    def sketched(self) -> bool:
        """Whether some columns of the factors are a sketch."""
        return any(block.sketched for block in self.infos[0].blocks)

    def indices_of(self, toss_ids: Iterable[str]) -> Indices:
        """Where tosses stand in the pool.

        Raises:
            InvalidValueError: an id is not in the pool.
        """
        try:
            return np.array([self._index[toss_id] for toss_id in toss_ids], dtype=np.int64)
        except KeyError as error:
            raise InvalidValueError("toss id", error.args[0], f"one of the {len(self)} tosses of the pool") from error

    @cached_property
    def _shifts(self) -> Array | None:
        """(K, 2) from each toss's centroid to the pivot along the tilt's axes; None for models without a tilt."""
        axes = self.infos[0].tilt_axes
        return (self.pivot - np.array([info.centroid for info in self.infos])) @ axes.T if axes.size else None

    @cached_property
    def _index(self) -> dict[str, int]:
        return {toss_id: index for index, toss_id in enumerate(self.ids)}


def pool_of(infos: Iterable[TossInformation], prior: Array | None = None, network_scores: Array | None = None) -> Pool:
    """The pool of some tosses, in whatever order they come.

    Args:
        infos: at least one toss, each id once.
        prior: (P, P) prior information A0 in the units of theta, the tilt about the pool's centroid.
        network_scores: see `Pool`; in the order of the ids.

    Raises:
        InvalidValueError: no toss, an id twice, tosses scored at different thetas, or a prior or scores of the wrong shape.
    """
    ordered = sorted(infos, key=lambda info: info.toss_id)
    if not ordered:
        raise InvalidValueError("tosses to rank", "none", "at least one")
    for one, other in pairwise(ordered):
        if one.toss_id == other.toss_id:
            raise InvalidValueError("tosses to rank", f"{one.toss_id} twice", "each toss once")
        check_comparable(one, other)
    size = ordered[0].parameters
    if prior is not None and prior.shape != (size, size):
        raise InvalidValueError("prior information", f"shape {prior.shape}", f"({size}, {size})")
    if network_scores is not None and (network_scores.ndim != 2 or len(network_scores) != len(ordered)):
        raise InvalidValueError("network scores", f"shape {network_scores.shape}", f"({len(ordered)}, M)")
    return Pool(tuple(ordered), pool_centroid(ordered), prior, network_scores)


def check_comparable(one: TossInformation, other: TossInformation) -> None:
    """Raise InvalidValueError when two tosses were not scored at the same theta in the same way."""
    for name in SHARED:
        if getattr(one, name) != getattr(other, name):
            found = f"{getattr(one, name)!r} of {one.toss_id} and {getattr(other, name)!r} of {other.toss_id}"
            raise InvalidValueError(f"{name} of the tosses to rank", found, "the same for all")


def pool_centroid(infos: Sequence[TossInformation]) -> Array:
    """Mean position (3,) over all transitions of a pool [characteristic lengths]."""
    weights = np.array([info.transitions for info in infos], dtype=float)
    return np.asarray(weights @ np.array([info.centroid for info in infos]) / weights.sum())


def about_centroids(fishers: Array, score_sums: Array, blocks: Sequence[ParameterBlock], shifts: Array) -> tuple[Array, Array]:
    """Fisher matrices (K, P, P) and score sums (K, P) with their pivots moved by `shifts` (K, 2) along the tilt's axes."""
    half = sheared(fishers, blocks, shifts[:, None])
    whole = sheared(half.transpose(0, 2, 1), blocks, shifts[:, None])
    return whole, sheared(score_sums, blocks, shifts)


def sheared(rows: Array, blocks: Sequence[ParameterBlock], shift: Array) -> Array:
    """Rows (..., P) with shift (..., 2) times their height column added to their tilt columns."""
    spans = {block.name: block for block in blocks}
    tilt, height = spans["tilt"], spans["height"]
    moved = rows.copy()
    moved[..., tilt.start : tilt.stop] += rows[..., height.start : height.stop] * shift
    return moved


def _stacked_factors(infos: Sequence[TossInformation]) -> Array:
    """Factors (b, R, P) of b >= 1 tosses, R the most rows among them; shorter ones end in rows of zeros."""
    counts = {info.factor.shape[0] for info in infos}
    rows, parameters = max(counts), infos[0].parameters
    if len(counts) == 1:
        return np.concatenate([info.factor for info in infos], dtype=float).reshape(len(infos), rows, parameters)
    stack = np.zeros((len(infos), rows, parameters))
    for filled, info in zip(stack, infos):
        filled[: info.factor.shape[0]] = info.factor
    return stack
