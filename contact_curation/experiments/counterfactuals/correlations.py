"""How well scores order the outcomes of refits: the linear datamodeling score (Park and others 2023).

A score foresees for each subset how bad the model is that learns from it; over the random subsets of one size this is compared
with the measured outcome by Spearman's rank correlation: 1 is a perfect order, 0 none. Intervals are percentiles over resampled
subsets, whose ranks are those among all. The rows of the body `all` have the mean over bodies, at all sizes that each of them
has: each is resampled, and the mean of these correlations has the interval.
"""

from collections import defaultdict
from collections.abc import Sequence
from typing import NamedTuple
from zlib import crc32

import numpy as np
from scipy.stats import rankdata

from contact_curation.experiments.cell_run import Row
from contact_curation.experiments.counterfactuals.table import FORESEEN, OUTCOMES
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.evaluation.bootstrap import BootstrapConfig, Interval

JUDGED = tuple(name for name in OUTCOMES if name != "friction")
"""Outcomes of which less is better."""

ALL_BODIES = "all"


class Correlation(NamedTuple):
    """Spearman's correlation, and those of resampled pairs (R,); NaN where one side is constant."""

    value: float
    resampled: Array

    def interval(self, config: BootstrapConfig) -> Interval:
        """Percentiles of the resampled ones."""
        outside = 0.5 * (1.0 - config.confidence)
        low, high = np.nanquantile(self.resampled, [outside, 1.0 - outside]) if np.isfinite(self.value) else (np.nan, np.nan)
        return Interval(self.value, float(low), float(high))


class Scored(NamedTuple):
    """The correlation of one score with one outcome, over the subsets of one size of one body."""

    body: str
    size: float
    subsets: int
    outcome: str
    score: str
    correlation: Correlation


def correlations(rows: Sequence[Row], config: BootstrapConfig) -> list[Scored]:
    """For each size, outcome and score, of the refits of one body (`table`)."""
    found: list[Scored] = []
    for size in sorted({float(row["size"]) for row in rows}):
        own = [row for row in rows if float(row["size"]) == size]
        body = str(own[0]["body"])
        draw = crc32(f"{body} {size:.0f}".encode())
        for outcome in JUDGED:
            measured = np.array([float(row[outcome]) for row in own])
            for name in FORESEEN:
                predicted = np.array([float(row[f"foreseen_{name}"]) for row in own])
                found.append(Scored(body, size, len(own), outcome, name, rank_correlation(predicted, measured, config, draw)))
    return found


def table_of(found: Sequence[Scored], config: BootstrapConfig) -> list[Row]:
    """A row for each correlation; of several bodies also the mean of each outcome and score, at the sizes that all have."""
    bodies = {one.body for one in found}
    shared = set.intersection(*({one.size for one in found if one.body == body} for body in bodies))
    groups: defaultdict[tuple[str, str], list[Scored]] = defaultdict(list)
    for one in found:
        if one.size in shared and np.isfinite(one.correlation.value):
            groups[one.outcome, one.score].append(one)
    means = [_mean(each) for each in groups.values()] if len(bodies) > 1 else []
    return [_row(one, config) for one in [*found, *means]]


def _mean(each: Sequence[Scored]) -> Scored:
    value = float(np.mean([one.correlation.value for one in each]))
    draws = np.mean([one.correlation.resampled for one in each], axis=0)
    return Scored(ALL_BODIES, 0.0, sum(one.subsets for one in each), each[0].outcome, each[0].score, Correlation(value, draws))


def _row(one: Scored, config: BootstrapConfig) -> Row:
    interval = one.correlation.interval(config)
    head: Row = {"body": one.body, "size": one.size, "subsets": float(one.subsets), "outcome": one.outcome, "score": one.score}
    return head | {"spearman": interval.value, "low": interval.low, "high": interval.high}


def rank_correlation(one: Array, other: Array, config: BootstrapConfig, draw: int = 0) -> Correlation:
    """Spearman's correlation of numbers (n,) and (n,) where both are finite; other draws are other resamples."""
    finite = np.isfinite(one) & np.isfinite(other)
    count = int(finite.sum())
    if count < 3 or not np.ptp(one[finite]) or not np.ptp(other[finite]):
        return Correlation(np.nan, np.full(config.resamples, np.nan))
    pairs = np.stack([rankdata(values[finite]) - 0.5 * (count + 1) for values in (one, other)])  # (2, n), centred
    rng = np.random.default_rng([config.seed, draw])
    draws = rng.multinomial(count, np.full(count, 1.0 / count), size=config.resamples) / count  # (R, n)
    return Correlation(float(_pearson(pairs, np.full((1, count), 1.0 / count))[0]), _pearson(pairs, draws))


def _pearson(pairs: Array, weights: Array) -> Array:
    """(R,) Pearson's correlations of pairs (2, n) under weights (R, n) that sum to 1."""
    means = weights @ pairs.T  # (R, 2)
    covariance = weights @ (pairs[0] * pairs[1]) - means[:, 0] * means[:, 1]
    variances = weights @ np.square(pairs).T - np.square(means)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(covariance / np.sqrt(variances.prod(axis=1)))
