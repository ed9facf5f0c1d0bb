"""The criteria that are sums over tosses, so that the best set is simply the top k (METHOD 1.6, 1.7, 2.2).

trace: tr F, of the Fisher sum, mean or coherent matrix (METHOD 1.5).
leverage: tr((F_pool + A0)^-1 F): the trace in units in which the pool knows every direction equally well. With A0 a share of
the pooled F it is the same under every linear change of parameters, and over all tosses it sums to the effective dimension.
longest: the toss's duration, a strong baseline (METHOD 0.10).
random: a shuffle of the ids, the other baseline.
"""

import numpy as np

from contact_curation.errors import InvalidValueError, NotScoredError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.pool import Pool
from contact_curation.information.record import TossInformation

NORMALISATIONS = ("sum", "mean", "coherent")


def toss_trace(info: TossInformation, normalisation: str = "sum") -> float:
    """Trace of a toss's Fisher sum, mean or coherent matrix.

    Raises:
        NotScoredError: the mean is wanted of a toss without a scored transition.
        InvalidValueError: the normalisation is none of `NORMALISATIONS`.
    """
    if normalisation == "sum":
        return info.trace
    if normalisation == "coherent":
        return float(info.score_sum @ info.score_sum)
    if normalisation != "mean":
        raise InvalidValueError("normalisation", normalisation, f"one of {', '.join(NORMALISATIONS)}")
    scored = info.transitions - info.not_scored
    if scored < 1:
        raise NotScoredError(info.toss_id, f"none of its {info.transitions} transitions has a certified impulse")
    return info.trace / scored


def traces(pool: Pool, normalisation: str = "sum") -> Array:
    """Traces (K,) of the tosses of a pool; errors as in `toss_trace`."""
    return np.array([toss_trace(info, normalisation) for info in pool.infos])


def leverages(pool: Pool, coordinates: Array) -> Array:
    """Leverages (K,) of the tosses of a pool.

    Args:
        pool: K tosses.
        coordinates: (P, p) C with C^T (F_pool + A0) C = I on the identifiable subspace.
    """
    norms = np.empty(len(pool))
    for chunk in pool.chunks():
        factors = pool.stacked(chunk)
        rows = factors.reshape(-1, pool.parameters) @ coordinates
        norms[chunk] = (rows * rows).sum(axis=1).reshape(chunk.size, -1).sum(axis=1)
    return norms


def durations(pool: Pool) -> Array:
    """Durations (K,) of the tosses of a pool [s]."""
    return np.array([info.duration for info in pool.infos])


def shuffled(pool: Pool, seed: int) -> Array:
    """Distinct scores (K,) between 0 and 1 in a random order that depends on the ids and the seed only."""
    return (1.0 + np.random.default_rng(seed).permutation(len(pool))) / len(pool)
