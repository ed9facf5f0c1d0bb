"""Why a toss is kept or not, and how the kept set stands to its pool: the numbers behind the ranking's views.

A toss outside of the kept set has the gain that it would still add, by the explanation of the criterion that chose the set.
The set is compared with all tosses by the theorem's spectrum (METHOD 1.9) and by how far its optimum is from theirs.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.criteria.explanation import explanation
from contact_curation.information.diagnostics import SINGULAR, spectral_distance
from contact_curation.information.optimum_shift import OptimumShift, optimum_shift
from contact_curation.information.pool import Pool
from contact_curation.information.ranker import RankingConfig
from contact_curation.information.subspace import IdentifiableSubspace, pool_subspace

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
        gain: of a kept toss by the criterion; of another what it would add to the kept set: by representative by how much it
            would lower the expected error, by all others log-det [nats].
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
        shift: of the kept set's optimum from that of all tosses.
    """

    rows: tuple[EvidenceRow, ...]
    spectrum: KeptSpectrum
    shift: OptimumShift


def evidence_of(pool: Pool, kept: KeptSet) -> Evidence:
    """The evidence for a kept set.

    Args:
        pool: all tosses at the theta of the kept set.
        kept: at least one of them.

    Raises:
        InvalidValueError: a kept toss is not in the pool, or no toss carries information.
    """
    subspace = pool_subspace(pool, DEFAULT.cut)
    return Evidence(
        rows=_rows(pool, kept),
        spectrum=kept_spectrum(pool, subspace, kept.toss_ids),
        shift=optimum_shift(pool, subspace.per_mean_toss(len(pool)), pool.indices_of(kept.toss_ids), DEFAULT.prior),
    )


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
    selected = dict(zip(kept.toss_ids, kept.gains, strict=True))
    explained = explanation(kept.criterion, pool, selected, replace(DEFAULT, top=kept.capacity))
    gains = {**explained.gains, **selected}
    others = sorted((toss_id for toss_id in pool.ids if toss_id not in selected), key=lambda one: -gains[one])
    return tuple(
        EvidenceRow(rank, one, traces[one], gains[one], one in selected, explained.reasons[one])
        for rank, one in enumerate((*kept.toss_ids, *others), start=1)
    )
