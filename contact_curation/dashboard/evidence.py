"""Why a toss is selected or not, and how the selected set stands to its pool: the numbers behind the ranking's views.

A toss outside of the selected set has the gain that it would still add, by the explanation of the criterion that chose the set.
The set is compared with all tosses by the theorem's spectrum (method.md 1.9) and by how far its optimum is from theirs.
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
class SelectedSet:
    """A selected set, best first, as its curator reports it.

    Attributes:
        criterion: criterion that chose it.
        capacity: how many may be selected.
        toss_ids: ids of the k selected tosses.
        gains: k marginal gains by the criterion.
        version: version of theta that the tosses were scored at.
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
        rank: place in the ranking, from 1.
        toss_id: the toss.
        trace: trace of its information.
        gain: gain of a selected toss by the criterion; of another toss what it would add to the set: with representative
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
        spectrum: spectrum of the selected set.
        shift: shift of the selected set's optimum from that of all tosses.
    """

    rows: tuple[EvidenceRow, ...]
    spectrum: SelectedSpectrum
    shift: OptimumShift


def evidence_of(pool: Pool, selected: SelectedSet, config: RankingConfig = DEFAULT) -> Evidence:
    """The evidence for a selected set.

    Args:
        pool: all tosses at the theta of the selected set.
        selected: at least one of them.
        config: how it was chosen; criterion and number are those of the selected set.

    Raises:
        InvalidValueError: a selected toss is not in the pool, or no toss carries information.
    """
    subspace = pool_subspace(pool, config.cut)
    coordinates, indices = subspace.per_mean_toss(len(pool)), pool.indices_of(selected.toss_ids)
    return Evidence(
        rows=_rows(pool, selected, config),
        spectrum=selected_spectrum(pool, subspace, selected.toss_ids),
        shift=optimum_shift(pool, coordinates, indices, config.prior),
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


def _rows(pool: Pool, selected: SelectedSet, config: RankingConfig) -> tuple[EvidenceRow, ...]:
    traces = {info.toss_id: info.trace for info in pool.infos}
    own = dict(zip(selected.toss_ids, selected.gains, strict=True))
    explained = explanation(selected.criterion, pool, own, replace(config, top=selected.capacity))
    gains = {**explained.gains, **own}
    others = sorted((toss_id for toss_id in pool.ids if toss_id not in own), key=lambda one: -gains[one])
    return tuple(
        EvidenceRow(rank, one, traces[one], gains[one], one in own, explained.reasons[one])
        for rank, one in enumerate((*selected.toss_ids, *others), start=1)
    )
