"""Ranks scored tosses by a configuration.

The same tosses give the same ranking in whatever order they come; ties go to the smaller id. Several parameter particles,
each with its own information of the same tosses, are ranked together (method.md 2.4): log-det, representative, herding,
facility-location, v-optimal and min-eig average over the particles, the other criteria average scores that are normalised per
particle, since their units differ from one theta to another.
"""

from collections.abc import Iterable, Sequence

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.criteria.criterion import DEFAULT_CRITERION as DEFAULT_CRITERION
from contact_curation.information.criteria.criterion import RankingConfig as RankingConfig
from contact_curation.information.criteria.criterion import criterion_named as criterion_named
from contact_curation.information.criteria.criterion import criterion_names as criterion_names
from contact_curation.information.criteria.criterion import moved_by_theta as moved_by_theta
from contact_curation.information.pool import Pool, pool_of
from contact_curation.information.ranking import Ranking, ranking_of
from contact_curation.information.record import TossInformation


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
        InvalidValueError: no particle, particles of different tosses, a criterion of one's own that gives back no ranking of
            these tosses, or as in `rank`.
        NotScoredError: as in `rank`.
    """
    if not pools:
        raise InvalidValueError("parameter particles", "none", "at least one")
    if any(pool.ids != pools[0].ids for pool in pools):
        raise InvalidValueError("parameter particles", "different tosses", "the same tosses under every particle")
    selection = criterion_named(config.criterion).select(pools, config)
    return ranking_of(config.criterion, pools[0].ids, selection, config.top)
