"""An upper bound on the log-det of every set of k tosses, to prove how good a kept set is (METHOD 2.3).

Relax the choice of k tosses to weights w in [0, 1] that sum to k: log-det A(w), A(w) = A0 + sum w F, is concave, so its
tangent at any w bounds it everywhere. Over the weights the tangent is largest on the k tosses of the largest d = tr(A^-1 F):

    logdet A* <= logdet A + (sum of the k largest d) - tr(A^-1 (A - A0))

The bound is tight at the best weights. Frank and Wolfe's method (1956) goes there from the kept set: each step moves A
towards the tosses that the tangent prefers, as far as log-det rises.
"""

from collections.abc import Sequence

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.information.accumulated import Accumulated
from contact_curation.information.criteria.modular import leverages
from contact_curation.information.pool import Indices, Pool

BISECTIONS = 30


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
        slopes = np.mean([leverages(pool, state.half_inverse) for pool, state in zip(pools, states)], axis=0)  # (K,)
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
