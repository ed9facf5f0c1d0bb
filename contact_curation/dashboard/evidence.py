"""Why a toss is selected or not, and how the selected set stands to its pool: the numbers behind the ranking's views.

A toss outside of the selected set comes with its gain: where `representative` chose the set, by how much it would lower the
expected error; else what it would add to the set's log-det (METHOD 2.3). The set is compared with all tosses by the theorem's
spectrum (METHOD 1.9) and by the estimate that follows from it.
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
class SelectedSet:
    """A selected set, best first, as whoever chose it says.

    Attributes:
        criterion: that chose it.
        capacity: how many may be selected.
        toss_ids: of the k selected tosses.
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
            raise InvalidValueError("gains of the selected tosses", len(self.gains), f"{len(self.toss_ids)}, one each")


@dataclass(frozen=True)
class EvidenceRow:
    """One toss of the ranking.

    Attributes:
        rank: from 1.
        toss_id: the toss.
        trace: of its information.
        gain: of a selected toss by the criterion; of another toss what it would add to the selected set: with representative
            by how much it would lower the expected error, with all others log-det [nats].
        selected: whether it is.
        reason: why, in a few words.
    """

    rank: int
    toss_id: str
    trace: float
    gain: float
    selected: bool
    reason: str


@dataclass(frozen=True, eq=False)
class SelectedSpectrum:
    """How a selected set stands to its pool.

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
    """The reasons for a selected set.

    Attributes:
        rows: all tosses, the selected ones first.
        spectrum: of the selected set.
        answer: of the selected set, beside that of all tosses.
    """

    rows: tuple[EvidenceRow, ...]
    spectrum: SelectedSpectrum
    answer: Answer


def evidence_of(pool: Pool, selected: SelectedSet) -> Evidence:
    """The evidence for a selected set.

    Args:
        pool: all tosses at the theta of the selected set.
        selected: at least one of them.

    Raises:
        InvalidValueError: a selected toss is not in the pool, or no toss carries information.
    """
    subspace = pool_subspace(pool, DEFAULT.cut)
    coordinates, indices = subspace.per_mean_toss(len(pool)), pool.indices_of(selected.toss_ids)
    return Evidence(
        rows=_rows(pool, selected, _reasons(pool, selected, coordinates)),
        spectrum=selected_spectrum(pool, subspace, selected.toss_ids),
        answer=answer_of(pool, coordinates, indices, DEFAULT.prior),
    )


def selected_spectrum(pool: Pool, subspace: IdentifiableSubspace, selected: Sequence[str]) -> SelectedSpectrum:
    """The spectrum of at least one selected toss on the pool's subspace; errors as `evidence_of`."""
    plain = spectral_distance(pool, subspace, selected)
    values = plain.eigenvalues * (len(pool) / len(selected))
    singular = values[0] <= SINGULAR * values[-1]
    return SelectedSpectrum(
        eigenvalues=values,
        epsilon=float(np.abs(values - 1.0).max()),
        missing=plain.epsilon,
        efficiency=0.0 if singular else float(np.exp(np.log(values).mean())),
    )


@dataclass(frozen=True)
class _Reasons:
    """By toss id: what each would add to the selected set, and why it is selected or not."""

    gains: Mapping[str, float]
    reasons: Mapping[str, str]


def _rows(pool: Pool, selected: SelectedSet, found: _Reasons) -> tuple[EvidenceRow, ...]:
    traces = {info.toss_id: info.trace for info in pool.infos}
    gains = {**found.gains, **dict(zip(selected.toss_ids, selected.gains, strict=True))}
    inside = frozenset(selected.toss_ids)
    others = sorted((toss_id for toss_id in pool.ids if toss_id not in inside), key=lambda one: -gains[one])
    return tuple(
        EvidenceRow(rank, one, traces[one], gains[one], one in inside, found.reasons[one])
        for rank, one in enumerate((*selected.toss_ids, *others), start=1)
    )


def _reasons(pool: Pool, selected: SelectedSet, coordinates: Array) -> _Reasons:
    if selected.criterion == "representative":
        return _reasons_by_error(pool, selected, coordinates)
    gains, inside = _log_det_gains(pool, selected), frozenset(selected.toss_ids)
    smallest = min(info.trace for info in pool.infos if info.toss_id in inside)
    reasons = {one: _why_not(selected, gain, smallest) for one, gain in gains.items()}
    reasons |= {one: _why_selected(selected, rank) for rank, one in enumerate(selected.toss_ids, start=1)}
    return _Reasons(gains, reasons)


def _reasons_by_error(pool: Pool, selected: SelectedSet, coordinates: Array) -> _Reasons:
    """By representative: what becomes of the expected error without a selected toss, and with another one more."""
    standing = standing_of([pool], [coordinates], pool.indices_of(selected.toss_ids).tolist(), DEFAULT.prior)
    before = standing.error or 1.0  # 0 of a pool that says nothing, with or without a toss
    joined = dict(zip(pool.ids, standing.joined.tolist(), strict=True))
    without = zip(selected.toss_ids, standing.without.tolist(), strict=True)
    reasons = {
        one: f"not selected: one more, with it the expected error is {error / before:.4g} times as large"
        for one, error in joined.items()
    }
    reasons |= {
        one: f"selected: without it the expected error is {error / before:.4g} times as large" for one, error in without
    }
    return _Reasons({one: standing.error - error for one, error in joined.items()}, reasons)


def _log_det_gains(pool: Pool, selected: SelectedSet) -> Mapping[str, float]:
    """By toss, what it would add to the selected set's log-det."""
    prior = log_det_prior(pool, DEFAULT.prior, DEFAULT.cut)
    gathered = Accumulated.prior_only(prior.coordinates).joined(pool.stacked(pool.indices_of(selected.toss_ids)))
    gains = [gathered.gains(pool.stacked(indices)).log_det for indices in pool.chunks()]
    return dict(zip(pool.ids, np.concatenate(gains).tolist(), strict=True))


def _why_selected(selected: SelectedSet, rank: int) -> str:
    if selected.criterion != "log-det":
        return f"selected: place {rank} by {selected.criterion}"
    return "selected: most new by itself" if rank == 1 else f"selected: most new beside the {rank - 1} above"


def _why_not(selected: SelectedSet, gain: float, smallest: float) -> str:
    if selected.criterion == "log-det":
        last = selected.gains[-1]
        return f"not selected: less new than the last, {last:.3g}" if gain < last else "not selected: came after"
    if selected.criterion == "trace":
        return f"not selected: trace below {smallest:.3g}"
    return f"not selected: {selected.criterion} has {selected.capacity} better"
