"""Why a toss is kept or not, and how the kept set stands to its pool: the numbers behind the ranking's views.

Whatever chose the kept set, a toss outside of it is told what it would still add to the set's log-det (METHOD 2.3), and the set
is held against all tosses by the theorem's spectrum (METHOD 1.9).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.accumulated import Accumulated
from contact_curation.information.diagnostics import SINGULAR, spectral_distance
from contact_curation.information.pool import Pool
from contact_curation.information.pool_subspace import pool_subspace
from contact_curation.information.prior import log_det_prior
from contact_curation.information.ranker import RankingConfig
from contact_curation.information.subspace import IdentifiableSubspace

DEFAULT = RankingConfig()


@dataclass(frozen=True)
class KeptSet:
    """A kept set, best first, as whoever chose it says.

    Attributes:
        criterion: that chose it.
        capacity: how many may be kept.
        toss_ids: of the k kept tosses.
        gains: k marginal gains by the criterion.
        version: of theta that the tosses were scored at.
        seen: how many tosses were looked at.
        bound: what is proven of its D-efficiency against the best set of its size; 0: nothing.
    """

    criterion: str
    capacity: int
    toss_ids: tuple[str, ...]
    gains: tuple[float, ...]
    version: str = ""
    seen: int = 0
    bound: float = 0.0

    def __post_init__(self) -> None:
        if len(self.gains) != len(self.toss_ids):
            raise InvalidValueError("gains of the kept tosses", len(self.gains), f"{len(self.toss_ids)}, one each")


@dataclass(frozen=True)
class EvidenceRow:
    """One toss of the ranking.

    Attributes:
        rank: from 1.
        toss_id: the toss.
        trace: of its information.
        gain: of a kept toss by the criterion; of another the log-det that it would add to the kept set [nats].
        kept: whether it is.
        reason: why, in a few words.
    """

    rank: int
    toss_id: str
    trace: float
    gain: float
    kept: bool
    reason: str


@dataclass(frozen=True, eq=False)
class KeptSpectrum:
    """How a kept set stands to its pool.

    Attributes:
        eigenvalues: (p,) ascending: its information per toss against the pool's.
        epsilon: how far they reach from 1.
        missing: share of the pool's information that it lacks in the worst direction.
        efficiency: its D-efficiency per toss; 1 is an average toss.
    """

    eigenvalues: Array
    epsilon: float
    missing: float
    efficiency: float


@dataclass(frozen=True, eq=False)
class Evidence:
    """What speaks for a kept set.

    Attributes:
        rows: all tosses, the kept ones first.
        spectrum: of the kept set.
    """

    rows: tuple[EvidenceRow, ...]
    spectrum: KeptSpectrum


def evidence_of(pool: Pool, kept: KeptSet) -> Evidence:
    """The evidence for a kept set.

    Args:
        pool: all tosses at the theta of the kept set.
        kept: at least one of them.

    Raises:
        InvalidValueError: a kept toss is not in the pool, or no toss carries information.
    """
    spectrum = kept_spectrum(pool, pool_subspace(pool, DEFAULT.cut), kept.toss_ids)
    return Evidence(_rows(pool, kept), spectrum)


def kept_spectrum(pool: Pool, subspace: IdentifiableSubspace, kept: Sequence[str]) -> KeptSpectrum:
    """The spectrum of at least one kept toss on the pool's subspace; errors as `evidence_of`."""
    plain = spectral_distance(pool, subspace, kept)
    values = plain.eigenvalues * (len(pool) / len(kept))
    singular = values[0] <= SINGULAR * values[-1]
    return KeptSpectrum(
        eigenvalues=values,
        epsilon=float(np.abs(values - 1.0).max()),
        missing=plain.epsilon,
        efficiency=0.0 if singular else float(np.exp(np.log(values).mean())),
    )


def _rows(pool: Pool, kept: KeptSet) -> tuple[EvidenceRow, ...]:
    traces = {info.toss_id: info.trace for info in pool.infos}
    inside = frozenset(kept.toss_ids)
    first = [
        EvidenceRow(rank, toss_id, traces[toss_id], gain, True, _why_kept(kept, rank))
        for rank, (toss_id, gain) in enumerate(zip(kept.toss_ids, kept.gains, strict=True), start=1)
    ]
    gains = _gains_of_others(pool, kept)
    others = sorted((toss_id for toss_id in pool.ids if toss_id not in inside), key=lambda one: -gains[one])
    smallest = min(traces[toss_id] for toss_id in kept.toss_ids)
    return (
        *first,
        *(
            EvidenceRow(rank, one, traces[one], gains[one], False, _why_not(kept, gains[one], smallest))
            for rank, one in enumerate(others, start=len(first) + 1)
        ),
    )


def _gains_of_others(pool: Pool, kept: KeptSet) -> Mapping[str, float]:
    """By toss, what it would add to the kept set's log-det."""
    prior = log_det_prior(pool, DEFAULT.prior, DEFAULT.cut)
    gathered = Accumulated.prior_only(prior.coordinates).joined(pool.stacked(pool.indices_of(kept.toss_ids)))
    gains = [gathered.gains(pool.stacked(indices)).log_det for indices in pool.chunks()]
    return dict(zip(pool.ids, np.concatenate(gains).tolist(), strict=True))


def _why_kept(kept: KeptSet, rank: int) -> str:
    if kept.criterion != "log-det":
        return f"kept: place {rank} by {kept.criterion}"
    return "kept: most new by itself" if rank == 1 else f"kept: most new beside the {rank - 1} above"


def _why_not(kept: KeptSet, gain: float, smallest: float) -> str:
    if kept.criterion == "log-det":
        return f"not kept: less new than the last, {kept.gains[-1]:.3g}" if gain < kept.gains[-1] else "not kept: came after"
    if kept.criterion == "trace":
        return f"not kept: trace below {smallest:.3g}"
    return f"not kept: {kept.criterion} has {kept.capacity} better"
