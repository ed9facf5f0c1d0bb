"""How far a selected set can be from the best one of its size: lower bounds on its D-efficiency (method.md 2.3).

With A = A0 + sum_S F for the selected set S and A* for any other choice of k tosses, log-det being concave,

    logdet A* - logdet A <= tr(A^-1 (A* - A)) = sum over the other of d - sum over S of d,      d(toss) = tr(A^-1 F)

The other's sum is at most k max d, whatever tosses it repeats and however it weighs them: the bound of Kiefer and Wolfowitz
(1960), which for A0 = 0 is exp(1 - max tr(M^-1 F) / p) with M = A / k. It is also at most the sum of the k largest d when no
toss may be taken twice. Log-det being submodular, the gap is further at most the sum of the k largest gains outside S.
D-efficiency is (det A / det A*)^(1/p).

A tighter bound relaxes the choice of k tosses to weights w in [0, 1] that sum to k: log-det A(w), A(w) = A0 + sum w F, is
concave, so its tangent at any w bounds it everywhere. Over the weights the tangent is largest on the k tosses of the largest d:

    logdet A* <= logdet A + (sum of the k largest d) - tr(A^-1 (A - A0))

The bound is tight at the best weights. Frank and Wolfe's method (1956) goes there from the selected set: each step moves A
towards the tosses that the tangent prefers, as far as log-det rises.
"""

from collections.abc import Sequence

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.information.accumulated import Accumulated, Gains
from contact_curation.information.pool import Indices, Pool
from contact_curation.information.ranking import Certificate

BISECTIONS = 30


def certificate_of(states: Sequence[Accumulated], gains: Gains, selected: Indices, upper_bound: float = np.inf) -> Certificate:
    """The certificate of a selected set.

    Args:
        states: the information of the selected set, one per parameter particle; log-dets are averaged over them.
        gains: log-det gains (K,) and tr(A^-1 F) (K,) of all tosses of the pool given the set, averaged over the particles.
        selected: (k,) which tosses are selected.
        upper_bound: on the mean log-det of every set of k tosses, where a better one is known (`log_det_bound`).
    """
    dimension = float(np.mean([state.dimension for state in states]))
    own = dimension - float(np.mean([state.prior_leverage for state in states]))  # sum of d over the selected set
    outside = np.delete(gains.log_det, selected)
    weighted_gap = selected.size * float(gains.leverage.max(initial=0.0)) - own
    subset_gaps = (
        _sum_of_largest(gains.leverage, selected.size) - own,
        _sum_of_largest(outside, selected.size),
        upper_bound - float(np.mean([state.log_det for state in states])),
        weighted_gap,
    )
    return Certificate(*(float(np.exp(-max(gap, 0.0) / dimension)) for gap in (weighted_gap, min(subset_gaps))))


def log_det_bound(pools: Sequence[Pool], states: Sequence[Accumulated], top: int, steps: int) -> float:
    """An upper bound on f of every set of up to `top` tosses, averaged over the parameter particles.

    Args:
        pools: the same tosses, once per particle.
        states: where to start, one per particle: a good set of `top` tosses.
        top: k.
        steps: how many steps to take; each costs one product over the pool. The best of the bounds on the way is given.
    """
    bound = np.inf
    for _ in range(steps):
        slopes = np.mean([pool.traces_in(state.half_inverse) for pool, state in zip(pools, states)], axis=0)  # (K,)
        preferred = np.argsort(-slopes, kind="stable")[:top]
        constant = np.mean([state.log_det - state.dimension + state.prior_leverage for state in states])
        bound = min(bound, float(constant) + float(slopes[preferred].sum()))
        states = _moved(states, [_gathered(pool, state.coordinates, preferred) for pool, state in zip(pools, states)])
    return bound


def _gathered(pool: Pool, coordinates: Array, indices: Indices) -> Accumulated:
    """The information of the prior and some tosses."""
    return Accumulated.prior_only(coordinates).joined(pool.stacked(indices))


def _moved(states: Sequence[Accumulated], goals: Sequence[Accumulated]) -> list[Accumulated]:
    """The states moved towards the goals, all by the share g of the way for which their mean log-det is largest.

    logdet((1 - g) A + g B) = logdet A + sum log(1 + g (mu - 1)) with mu the eigenvalues of A^-1 B; its slope falls with g.
    """
    excess = np.concatenate([_relative_eigenvalues(state, goal) for state, goal in zip(states, goals)]) - 1.0
    low, high = 0.0, 1.0
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if (excess / (1.0 + middle * excess)).sum() > 0.0 else (low, middle)
    mixed = [(1.0 - low) * state.matrix + low * goal.matrix for state, goal in zip(states, goals)]
    return [Accumulated(state.coordinates, matrix) for state, matrix in zip(states, mixed)]


def _relative_eigenvalues(state: Accumulated, goal: Accumulated) -> Array:
    """(p,) eigenvalues of A^-1 B."""
    half = np.linalg.solve(state.lower, goal.matrix)
    return np.asarray(np.linalg.eigvalsh(np.linalg.solve(state.lower, half.T)))


def _sum_of_largest(values: Array, count: int) -> float:
    return float(np.sort(values)[::-1][:count].sum())
