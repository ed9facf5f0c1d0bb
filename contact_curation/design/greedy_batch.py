"""Throws for a batch: greedy from a pool of releases, by what each adds to what is known (METHOD 1.10, 5).

    next throw = argmax over the pool of mean_theta [ logdet(A + E[F(x)]) - logdet A ],    A = A0 + kept tosses + throws so far

The gain is monotone and submodular, so that greedy reaches (1 - 1/e) of the best batch from the pool. What is known already is
to the throws what A0 is to tosses: in coordinates where A is the identity a pool of throws is ranked like a pool of tosses,
with the same lazy queue. Place and heading of throws are not designed: every motion and toss counts about its own centroid.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact_curation.design.particle import Particle
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.accumulated import Accumulated
from contact_curation.information.criteria.log_det import select_by_log_det
from contact_curation.information.pool import Pool
from contact_curation.information.record import TossInformation
from contact_curation.information.subspace import EIGENVALUE_CUT, identifiable_subspace

JITTER = 1e-13
"""Added to the diagonal as a share of the trace, so that a singular matrix has a Cholesky factor."""


@dataclass(frozen=True, eq=False)
class Picked:
    """A greedy batch.

    Attributes:
        indices: (B,) in the pool, in the order of selection.
        gains: (B,) what each added when it was picked, mean log-det over the particles.
    """

    indices: NDArray[np.int64]
    gains: Array


def prior_coordinates(fishers: Array, share: float, cut: float = EIGENVALUE_CUT) -> Array:
    """(P, p) C with C^T A0 C = I where A0 is a share of the mean of (K, P, P) on what they identify (METHOD 1.6).

    Raises:
        InvalidValueError: no throw tells anything.
    """
    return np.asarray(identifiable_subspace(fishers.mean(axis=0), cut).whitening / np.sqrt(share))


def accumulated(coordinates: Array, known: Sequence[TossInformation]) -> Accumulated:
    """What is known from tosses, each about its own centroid.

    Raises:
        InvalidValueError: a toss was scored by other parameters.
    """
    state = Accumulated.prior_only(coordinates)
    for info in known:
        if info.parameters != len(coordinates):
            raise InvalidValueError(f"parameters of toss {info.toss_id}", info.parameters, f"{len(coordinates)}")
        state = state.joined(np.asarray(info.factor, dtype=float)[None])
    return state


def with_fishers(state: Accumulated, fishers: Array) -> Accumulated:
    """What is known with the information of throws (B, P, P) added."""
    added = state.coordinates.T @ fishers.sum(axis=0) @ state.coordinates
    return Accumulated(state.coordinates, state.matrix + 0.5 * (added + added.T))


def gains(states: Sequence[Accumulated], fishers: Sequence[Array]) -> Array:
    """(K,) mean over particles of what each throw would add in log-det; fishers (K, P, P) per particle."""
    each = []
    for state, matrices in zip(states, fishers, strict=True):
        own = state.half_inverse.T @ matrices @ state.half_inverse
        each.append(np.linalg.slogdet(np.eye(state.dimension) + 0.5 * (own + own.transpose(0, 2, 1)))[1])
    return np.asarray(np.mean(each, axis=0))


def greedy_batch(particles: Sequence[Particle], states: Sequence[Accumulated], fishers: Sequence[Array], count: int) -> Picked:
    """The greedy batch from a pool.

    Args:
        particles: thetas.
        states: per particle, what is known.
        fishers: per particle, expected information (K, P, P) of the pool's throws.
        count: of throws; fewer where the pool has fewer.
    """
    pools = [_pool(particle, matrices) for particle, matrices in zip(particles, fishers, strict=True)]
    selection = select_by_log_det(pools, [state.half_inverse for state in states], count)
    indices = selection.order[: selection.count]
    return Picked(indices, selection.gains[indices])


def _pool(particle: Particle, fishers: Array) -> Pool:
    """Throws as the tosses they would be, all with their centroids in one place."""
    scorer = particle.scorer
    size = scorer.form.size
    traces = np.trace(fishers, axis1=1, axis2=2)
    roots = np.linalg.cholesky(fishers + (JITTER * traces + np.finfo(float).tiny)[:, None, None] * np.eye(size))
    infos = tuple(
        TossInformation(
            toss_id=f"{number:09d}",
            body=particle.body.name,
            model="polytope",
            parameters_version=scorer.version,
            estimator=scorer.config.estimator.value,
            influence_bound=np.inf,
            blocks=scorer.blocks,
            transitions=1,
            not_scored=0,
            duration=0.0,
            mean_loss=0.0,
            block_traces=np.array([np.trace(fisher[b.start : b.stop, b.start : b.stop]) for b in scorer.blocks]),
            score_sum=np.zeros(size),
            factor=root.T,
            centroid=np.zeros(3),
            tilt_axes=scorer.form.tilt_axes,
        )
        for number, (fisher, root) in enumerate(zip(fishers, roots))
    )
    return Pool(infos, np.zeros(3))
