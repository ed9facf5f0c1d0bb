"""Ties: scores that differ by rounding alone are equal, and the smaller id goes first.

The last bits of a product depend on where a toss stands in a batch, so two copies of one toss seldom score the same to the last
bit. Without a tolerance the result would depend on the batching.
"""

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.information.pool import Indices

RELATIVE = 1e-9
ABSOLUTE = 1e-12


def tie_floor(best: float, absolute: float = ABSOLUTE) -> float:
    """The lowest value that still counts as equal to the best."""
    return best - RELATIVE * abs(best) - absolute


def first_of_the_best(values: Array) -> int:
    """Index of the first value that ties with the largest; the pool is in the order of ids, so this is the smallest id."""
    return int(np.argmax(values >= tie_floor(float(values.max()))))


def descending(values: Array, relative: float = RELATIVE, absolute: float = ABSOLUTE) -> Indices:
    """Indices from the largest value down; neighbours that tie go by index. With tolerances of 0 only equal values tie."""
    order = np.argsort(-values, kind="stable")
    ordered = values[order]
    separate = ordered[:-1] - ordered[1:] > relative * np.abs(ordered[:-1]) + absolute
    group = np.concatenate([[0], np.cumsum(separate)])
    return np.asarray(order[np.lexsort((order, group))], dtype=np.int64)
