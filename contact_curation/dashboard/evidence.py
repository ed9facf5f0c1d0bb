"""Why a toss is kept or not, and how the kept set stands to its pool: the numbers behind the ranking's views.

A toss outside of the kept set is told what it would still add: where `representative` chose the set, by how much it would lower
the expected error; else what it would add to the set's log-det (METHOD 2.3). The set is held against all tosses by the
theorem's spectrum (METHOD 1.9) and by what it answers.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.accumulated import Accumulated
from contact_curation.information.criteria.representative import standing_of
from contact_curation.information.diagnostics import SINGULAR, spectral_distance
from contact_curation.information.optimum_shift import Answer, answer_of
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
        answer: of the kept set, beside that of all tosses.
    """

    rows: tuple[EvidenceRow, ...]
    spectrum: KeptSpectrum
    answer: Answer


def evidence_of(pool: Pool, kept: KeptSet) -> Evidence:
    """The evidence for a kept set.

    Args:
        pool: all tosses at the theta of the kept set.
        kept: at least one of them.

    Raises:
        InvalidValueError: a kept toss is not in the pool, or no toss carries information.
    """
    subspace = pool_subspace(pool, DEFAULT.cut)
    coordinates, indices = subspace.per_mean_toss(len(pool)), pool.indices_of(kept.toss_ids)
    return Evidence(
        rows=_rows(pool, kept, _told(pool, kept, coordinates)),
        spectrum=kept_spectrum(pool, subspace, kept.toss_ids),
        answer=answer_of(pool, coordinates, indices, DEFAULT.prior),
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


@dataclass(frozen=True)
class _Told:
    """What tosses are told, by id: what each would add to the kept set, and why it is kept or not."""

    gains: Mapping[str, float]
    reasons: Mapping[str, str]


def _rows(pool: Pool, kept: KeptSet, told: _Told) -> tuple[EvidenceRow, ...]:
    traces = {info.toss_id: info.trace for info in pool.infos}
    gains = {**told.gains, **dict(zip(kept.toss_ids, kept.gains, strict=True))}
    inside = frozenset(kept.toss_ids)
    others = sorted((toss_id for toss_id in pool.ids if toss_id not in inside), key=lambda one: -gains[one])
    return tuple(
        EvidenceRow(rank, one, traces[one], gains[one], one in inside, told.reasons[one])
        for rank, one in enumerate((*kept.toss_ids, *others), start=1)
    )


def _told(pool: Pool, kept: KeptSet, coordinates: Array) -> _Told:
    if kept.criterion == "representative":
        return _told_by_error(pool, kept, coordinates)
    gains, inside = _log_det_gains(pool, kept), frozenset(kept.toss_ids)
    smallest = min(info.trace for info in pool.infos if info.toss_id in inside)
    reasons = {one: _why_not(kept, gain, smallest) for one, gain in gains.items()}
    return _Told(gains, reasons | {one: _why_kept(kept, rank) for rank, one in enumerate(kept.toss_ids, start=1)})


def _told_by_error(pool: Pool, kept: KeptSet, coordinates: Array) -> _Told:
    """By representative: what becomes of the expected error without a kept toss, and with another one more."""
    standing = standing_of([pool], [coordinates], pool.indices_of(kept.toss_ids).tolist(), DEFAULT.prior)
    before = standing.error or 1.0  # 0 of a pool that says nothing, with or without a toss
    joined = dict(zip(pool.ids, standing.joined.tolist(), strict=True))
    without = zip(kept.toss_ids, standing.without.tolist(), strict=True)
    reasons = {
        one: f"not kept: one more, with it the expected error is {error / before:.4g} times as large"
        for one, error in joined.items()
    }
    reasons |= {one: f"kept: without it the expected error is {error / before:.4g} times as large" for one, error in without}
    return _Told({one: standing.error - error for one, error in joined.items()}, reasons)


def _log_det_gains(pool: Pool, kept: KeptSet) -> Mapping[str, float]:
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
