"""Uncertainty of medians and means over tosses: percentile intervals of the bootstrap (Efron 1979), seeded.

Tosses are drawn with replacement, as many as there are. Two models are compared over the same tosses, by the differences that
each toss makes: hard tosses are hard for both, so that a difference is far surer than the two figures themselves.

Percentiles of a mean of few values are too close: 95 % ones of 10 normal values hold the true mean in 90 % of the cases. Theirs
are taken further out, so that the interval of normal values is as wide as Student's (the expanded percentiles of Hesterberg
2015). Medians need no such correction.
"""

from dataclasses import dataclass
from math import ceil, log2
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtr, stdtrit

from contact_curation.configs import set_whole_numbers
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array


@dataclass(frozen=True)
class BootstrapConfig:
    """How intervals are made.

    Attributes:
        resamples: how often tosses are drawn.
        confidence: share of the resamples inside an interval.
        seed: of the draws.
    """

    resamples: int = 2000
    confidence: float = 0.95
    seed: int = 0

    def __post_init__(self) -> None:
        set_whole_numbers(self, ("resamples",), 1, prefix="bootstrap.")
        if not 0.0 < self.confidence < 1.0:
            raise InvalidValueError("bootstrap.confidence", self.confidence, "a number between 0 and 1")
        set_whole_numbers(self, ("seed",), prefix="bootstrap.")

    @property
    def fewest(self) -> int:
        """Tosses that an interval needs: all n of them are on one side of the true median in 2^(1 - n) of the cases."""
        return max(2, ceil(1.0 - log2(1.0 - self.confidence)))


class Interval(NamedTuple):
    """A statistic over tosses and its interval, whose ends are NaN of fewer tosses than one needs, 6 for 95 %."""

    value: float
    low: float
    high: float


class Spread(NamedTuple):
    """Median and mean of one number per toss, with intervals; a few bad tosses can dominate the mean."""

    median: Interval
    mean: Interval


def spread(values: ArrayLike, config: BootstrapConfig) -> Spread:
    """Median and mean of one number per toss.

    Args:
        values: (K,), finite.
        config: how intervals are made.

    Raises:
        InvalidValueError: there is no toss, or a number is not finite.
    """
    numbers = np.asarray(values, dtype=float)
    if numbers.ndim != 1 or not numbers.size or not np.isfinite(numbers).all():
        found = f"shape {numbers.shape}, {np.count_nonzero(~np.isfinite(numbers))} not finite"
        raise InvalidValueError("numbers per toss", found, "at least one, all finite")
    drawn = np.random.default_rng(config.seed).integers(numbers.size, size=(config.resamples, numbers.size))
    resamples = numbers[drawn]  # (R, K)
    median, mean = float(np.median(numbers)), float(numbers.mean())
    if numbers.size < config.fewest:
        return Spread(Interval(median, np.nan, np.nan), Interval(mean, np.nan, np.nan))
    outside = 0.5 * (1.0 - config.confidence)
    low, high = np.quantile(np.median(resamples, axis=1), [outside, 1.0 - outside])
    return Spread(Interval(median, float(low), float(high)), mean_interval(mean, resamples.mean(axis=1), numbers.size, config))


def mean_interval(value: float, means: Array, count: int, config: BootstrapConfig) -> Interval:
    """Expanded percentiles of resampled means (R,) of a count of values, at least 2."""
    wider = np.sqrt(count / (count - 1)) * stdtrit(count - 1, 0.5 + 0.5 * config.confidence)
    low, high = np.quantile(means, [ndtr(-wider), ndtr(wider)])
    return Interval(value, float(low), float(high))


def paired_spread(ours: ArrayLike, theirs: ArrayLike, config: BootstrapConfig) -> Spread:
    """Median and mean of the differences ours - theirs, both (K,) over the same tosses.

    Raises:
        InvalidValueError: the tosses cannot be the same, or as `spread`.
    """
    first, second = np.asarray(ours, dtype=float), np.asarray(theirs, dtype=float)
    if first.shape != second.shape:
        raise InvalidValueError("numbers per toss", f"shapes {first.shape} and {second.shape}", "the same tosses twice")
    return spread(first - second, config)
