"""The three Fisher matrices of a toss, from its scores g_t (method.md 1.5).

    sum:      F = sum_t g_t g_t^T            information adds: the default everywhere
    mean:     F / T                          the paper's empirical Fisher matrix
    coherent: (sum_t g_t)(sum_t g_t)^T       rank one, from the toss's own score

Each may be centred: g_t - c with c the pool's mean score, which matters where the mean gradient is far from zero.
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array


def fisher_sum(scores: Array, centre: Array | None = None) -> Array:
    """Fisher sum (P, P) of a toss.

    Args:
        scores: (T, P) scores of its transitions.
        centre: (P,) mean score to take away first; none when not given.

    Raises:
        InvalidValueError: `scores` is not a matrix, or `centre` does not fit it.
    """
    centred = _centred(scores, centre)
    return np.asarray(centred.T @ centred)


def fisher_mean(scores: Array, centre: Array | None = None) -> Array:
    """Fisher sum (P, P) divided by the number T of transitions; arguments and errors as in `fisher_sum`, and T >= 1."""
    if len(scores) == 0:
        raise InvalidValueError("scores of a toss", "none", "at least one transition")
    return fisher_sum(scores, centre) / len(scores)


def fisher_coherent(scores: Array, centre: Array | None = None) -> Array:
    """Outer product (P, P) of the toss's score with itself; arguments and errors as in `fisher_sum`."""
    toss_score = _centred(scores, centre).sum(axis=0)
    return np.outer(toss_score, toss_score)


def fisher_sums(scores: Array, starts: NDArray[np.int64], centre: Array | None = None) -> Array:
    """Fisher sums (K, P, P) of K tosses.

    Args:
        scores: (N, P) scores of all their transitions.
        starts: (K + 1,) toss k owns rows starts[k]:starts[k + 1], as in `Transitions`.
        centre: (P,) mean score to take away first; none when not given.

    Raises:
        InvalidValueError: the shapes do not fit, or `starts` does not cover the rows in order.
    """
    centred = _centred(scores, centre)
    if starts.ndim != 1 or starts.size < 1 or starts[0] != 0 or starts[-1] != len(scores) or np.any(np.diff(starts) < 0):
        raise InvalidValueError("starts", f"{starts.size} numbers", f"increasing numbers from 0 to {len(scores)}")
    sums = np.empty((starts.size - 1, scores.shape[1], scores.shape[1]))  # (K, P, P)
    for toss, (first, last) in enumerate(pairwise(starts)):
        np.matmul(centred[first:last].T, centred[first:last], out=sums[toss])
    return sums


def _centred(scores: Array, centre: Array | None) -> Array:
    if scores.ndim != 2:
        raise InvalidValueError("scores", f"shape {scores.shape}", "(T, P)")
    if centre is None:
        return scores
    if centre.shape != (scores.shape[1],):
        raise InvalidValueError("centre of the scores", f"shape {centre.shape}", f"({scores.shape[1]},)")
    return np.asarray(scores - centre)
