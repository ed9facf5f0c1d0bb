"""The door to ranking: tosses and a configuration in, a ranking out.

The same tosses give the same ranking in whatever order they come; ties go to the smaller id. Several parameter particles,
each with its own information of the same tosses, are ranked together (METHOD 2.4): log-det, representative and min-eig
average over the particles, the other criteria average scores that are normalised per particle, since their units differ from
one theta to another.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.criteria import modular, orthogonal
from contact_curation.information.criteria.log_det import select_by_log_det
from contact_curation.information.criteria.min_eig import select_by_min_eig
from contact_curation.information.criteria.representative import select_representative
from contact_curation.information.pool import Pool, pool_of
from contact_curation.information.pool_subspace import pool_subspace
from contact_curation.information.prior import log_det_prior
from contact_curation.information.ranking import Ranking, Selection, modular_selection, ranking_of
from contact_curation.information.record import TossInformation
from contact_curation.information.subspace import EIGENVALUE_CUT, IdentifiableSubspace

CRITERIA = ("trace", "log-det", "representative", "min-eig", "orthogonal", "leverage", "longest", "random")

DEFAULT_CRITERION = "representative"
"""The one to keep training sets by (docs/rule.md)."""

STREAMED_CRITERION = "log-det"
"""What stands in for the default where tosses are let go unranked: the default needs the whole pool."""


@dataclass(frozen=True)
class RankingConfig:
    """How tosses are ranked.

    Attributes:
        criterion: one of `CRITERIA`; log-det stands in for representative where a stream is not kept whole.
        top: k, how many tosses are kept.
        seed: of the random criterion.
        prior: delta: the prior information A0 is this share of the pool's mean toss (METHOD 1.6).
        normalisation: which trace: one of `NORMALISATIONS`.
        variant: which orthogonal selection: one of `VARIANTS`.
        whiten: whether toss scores are whitened by the pooled information before orthogonal selection.
        centre: whether toss scores are taken relative to the pool's mean score there.
        cut: eigenvalues of the pooled information below this share of the largest are not identifiable.
        certificate_steps: passes over the pool that tighten the certificate of log-det; 0 for none. Ten bring most of what
            there is and cost about as much as the selection, whatever the size of the pool: a small share of scoring it.
    """

    criterion: str = DEFAULT_CRITERION
    top: int = 32
    seed: int = 0
    prior: float = 1e-3
    normalisation: str = "sum"
    variant: str = "pivoted"
    whiten: bool = False
    centre: bool = False
    cut: float = EIGENVALUE_CUT
    certificate_steps: int = 10

    def __post_init__(self) -> None:
        choices = {"criterion": CRITERIA, "normalisation": modular.NORMALISATIONS, "variant": orthogonal.VARIANTS}
        for name, accepted in choices.items():
            if getattr(self, name) not in accepted:
                raise InvalidValueError(f"ranking.{name}", getattr(self, name), f"one of {', '.join(accepted)}")
        if self.top < 1:
            raise InvalidValueError("ranking.top", self.top, "at least 1 toss to keep")
        for name in ("seed", "certificate_steps"):
            if getattr(self, name) < 0:
                raise InvalidValueError(f"ranking.{name}", getattr(self, name), "a number of at least 0")
        if not (np.isfinite(self.prior) and self.prior > 0.0):
            raise InvalidValueError("ranking.prior", self.prior, "a positive number")
        if not 0.0 < self.cut < 1.0:
            raise InvalidValueError("ranking.cut", self.cut, "a number between 0 and 1")


def rank(infos: Iterable[TossInformation], config: RankingConfig, prior: Array | None = None) -> Ranking:
    """The ranking of tosses scored at one theta.

    Args:
        infos: at least one toss, each id once, in any order.
        config: how to rank.
        prior: (P, P) prior information for log-det in the units of theta, the tilt about the pool's centroid, instead of
            `config.prior` of the mean toss.

    Raises:
        InvalidValueError: no toss, an id twice, tosses that were scored at different thetas, or no information at all.
        NotScoredError: the trace of the mean Fisher matrix is wanted of a toss without a scored transition.
    """
    return rank_particles([pool_of(infos, prior)], config)


def rank_particles(pools: Sequence[Pool], config: RankingConfig) -> Ranking:
    """The ranking of tosses scored at several thetas.

    Args:
        pools: the same tosses, once per parameter particle.
        config: how to rank.

    Raises:
        InvalidValueError: no particle, particles of different tosses, or as in `rank`.
        NotScoredError: as in `rank`.
    """
    if not pools:
        raise InvalidValueError("parameter particles", "none", "at least one")
    if any(pool.ids != pools[0].ids for pool in pools):
        raise InvalidValueError("parameter particles", "different tosses", "the same tosses under every particle")
    return ranking_of(config.criterion, pools[0].ids, _select(pools, config))


def _select(pools: Sequence[Pool], config: RankingConfig) -> Selection:
    first, top = pools[0], config.top
    match config.criterion:
        case "log-det":
            coordinates = [log_det_prior(pool, config.prior, config.cut).coordinates for pool in pools]
            return select_by_log_det(pools, coordinates, top, config.certificate_steps)
        case "min-eig":
            coordinates = [_subspace(pool, config.cut).per_mean_toss(len(pool)) for pool in pools]
            return select_by_min_eig(pools, coordinates, top, config.prior)
        case "representative":
            coordinates = [_subspace(pool, config.cut).per_mean_toss(len(pool)) for pool in pools]
            return select_representative(pools, coordinates, top, config.prior)
        case "orthogonal":
            return orthogonal.select_orthogonal(_together([_toss_scores(pool, config) for pool in pools]), top, config.variant)
        case "trace":
            scores = [modular.traces(pool, config.normalisation) for pool in pools]
            return modular_selection(_averaged(scores), top, exact=len(pools) == 1)
        case "leverage":
            return modular_selection(_averaged([_leverages(pool, config) for pool in pools]), top)
        case "longest":
            return modular_selection(modular.durations(first), top, exact=True)
        case "random":
            return modular_selection(modular.shuffled(first, config.seed), top, exact=True)
    raise InvalidValueError("criterion", config.criterion, f"one of {', '.join(CRITERIA)}")


def _leverages(pool: Pool, config: RankingConfig) -> Array:
    """Leverages (K,) with the ridge A0, a share of the mean toss: F_pool + A0 = (1 + delta / K) F_pool."""
    ridge = 1.0 + config.prior / len(pool)
    return modular.leverages(pool, _subspace(pool, config.cut).whitening / np.sqrt(ridge))


def _toss_scores(pool: Pool, config: RankingConfig) -> Array:
    scores = orthogonal.toss_scores(pool, centre=config.centre)
    return np.asarray(scores @ _subspace(pool, config.cut).whitening) if config.whiten else scores


def _subspace(pool: Pool, cut: float) -> IdentifiableSubspace:
    return pool_subspace(pool, cut)


def _averaged(scores: Sequence[Array]) -> Array:
    """Scores (K,): as they are for one particle, otherwise the mean of those divided by their mean over the tosses."""
    if len(scores) == 1:
        return scores[0]
    return np.asarray(np.mean([each / (float(each.mean()) or 1.0) for each in scores], axis=0))


def _together(scores: Sequence[Array]) -> Array:
    """Toss scores (K, sum of P) side by side, each particle's divided by its root mean square length."""
    if len(scores) == 1:
        return scores[0]
    lengths = [float(np.sqrt((each * each).sum(axis=1).mean())) or 1.0 for each in scores]
    return np.concatenate([each / length for each, length in zip(scores, lengths)], axis=1)
