"""Reasons why tosses are selected or not, for criteria without their own: the gain of each in log-det (method.md 2.3)."""

from collections.abc import Callable, Mapping

import numpy as np

from contact_curation.information.accumulated import Accumulated
from contact_curation.information.criteria.criterion import Explanation, RankingConfig, criterion_named, criterion_names
from contact_curation.information.pool import Pool
from contact_curation.information.prior import log_det_prior


def by_log_det(
    pool: Pool,
    selected: Mapping[str, float],
    config: RankingConfig,
    why: Callable[[int], str],
    why_not: Callable[[float], str],
) -> Explanation:
    """Each toss's log-det gain over the selected set, and a reason.

    Args:
        pool: all tosses.
        selected: gain by the criterion of each selected toss, best first.
        config: with the prior.
        why: a toss is selected, by its place from 1.
        why_not: it is not, by its log-det gain [nats].
    """
    prior = log_det_prior(pool, config.prior, config.cut)
    gathered = Accumulated.prior_only(prior.coordinates).joined(pool.stacked(pool.indices_of(selected)))
    each = [gathered.gains(pool.stacked(indices)).log_det for indices in pool.chunks()]
    gains = dict(zip(pool.ids, np.concatenate(each).tolist(), strict=True))
    reasons = {one: why_not(gain) for one, gain in gains.items()}
    return Explanation(gains, reasons | {one: why(place) for place, one in enumerate(selected, start=1)})


def place_by(name: str) -> Callable[[int], str]:
    """The plainest reason to be selected: the place by a criterion."""
    return lambda place: f"selected: place {place} by {name}"


def explanation(name: str, pool: Pool, selected: Mapping[str, float], config: RankingConfig) -> Explanation:
    """Why tosses are selected or not by the criterion of that name, registered here or not; arguments as in `by_log_det`."""
    known = criterion_named(name).explain if name in criterion_names() else None
    if known is not None:
        return known(pool, selected, config)
    return by_log_det(pool, selected, config, place_by(name), lambda gain: f"not selected: {name} has {config.top} better")
