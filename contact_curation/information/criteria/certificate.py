"""How far a kept set can be from the best one of its size: lower bounds on its D-efficiency (METHOD 2.3).

With A = A0 + sum_S F for the kept set S and A* for any other choice of k tosses, log-det being concave,

    logdet A* - logdet A <= tr(A^-1 (A* - A)) = sum over the other of d - sum over S of d,      d(toss) = tr(A^-1 F)

The other's sum is at most k max d, whatever tosses it repeats and however it weighs them: the bound of Kiefer and Wolfowitz
(1960), which for A0 = 0 is exp(1 - max tr(M^-1 F) / p) with M = A / k. It is also at most the sum of the k largest d when no
toss may be taken twice. Log-det being submodular, the gap is further at most the sum of the k largest gains outside S.
D-efficiency is (det A / det A*)^(1/p).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.information.accumulated import Accumulated, Gains
from contact_curation.information.pool import Indices


@dataclass(frozen=True)
class Certificate:
    """Proven lower bounds on the D-efficiency of a kept set, from 0 to 1; the prior counts on both sides.

    Attributes:
        kiefer_wolfowitz: against every weighting and repetition of the pool's tosses with total weight k.
        subset: against every set of k different tosses; never below the other.
    """

    kiefer_wolfowitz: float
    subset: float


def certificate_of(states: Sequence[Accumulated], gains: Gains, kept: Indices, upper_bound: float = np.inf) -> Certificate:
    """The certificate of a kept set.

    Args:
        states: the information of the kept set, one per parameter particle; log-dets are averaged over them.
        gains: log-det gains (K,) and tr(A^-1 F) (K,) of all tosses of the pool given the kept set, averaged over the particles.
        kept: (k,) which tosses are kept.
        upper_bound: on the mean log-det of every set of k tosses, where a better one is known (`log_det_bound`).
    """
    dimension = float(np.mean([state.dimension for state in states]))
    own = dimension - float(np.mean([state.prior_leverage for state in states]))  # sum of d over the kept set
    outside = np.delete(gains.log_det, kept)
    weighted_gap = kept.size * float(gains.leverage.max(initial=0.0)) - own
    subset_gaps = (
        _sum_of_largest(gains.leverage, kept.size) - own,
        _sum_of_largest(outside, kept.size),
        upper_bound - float(np.mean([state.log_det for state in states])),
        weighted_gap,
    )
    return Certificate(*(float(np.exp(-max(gap, 0.0) / dimension)) for gap in (weighted_gap, min(subset_gaps))))


def _sum_of_largest(values: Array, count: int) -> float:
    return float(np.sort(values)[::-1][:count].sum())
