"""How rules differ: paired over seeds and judging tosses, with intervals over both, and sign tests over the seeds.

A seed's difference is the mean over its judging tosses of rule minus baseline, on the same tosses. Seeds share tosses, and
each has only so many judges: a resample draws seeds, and within each the judging tosses, both with replacement (Efron and
Tibshirani 1993, section 8.3); percentiles are those of a mean of so few seeds (`bootstrap`). Beside each interval stands the
two-sided sign test over the seeds, which assumes no distribution, and the same times the number of comparisons (Bonferroni) by
that measure, on that body and with the same rule.
"""

from collections import Counter, defaultdict
from collections.abc import Sequence

import numpy as np
from scipy.stats import binomtest

from contact_curation.experiments.cell_run import Row
from contact_curation.experiments.engines import MEASURES
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.evaluation.bootstrap import BootstrapConfig, Interval, mean_interval

LEAST_SEEDS = 10
"""Fewer seeds have a difference, and no interval."""

AGAINST = ("random", "longest", "representative")
"""Rules that each rule is compared with."""


def differences(rows: Sequence[Row], config: BootstrapConfig, against: Sequence[str] = AGAINST) -> list[Row]:
    """A row for each body, size, measure, rule and rule that it is compared with."""
    cells: defaultdict[tuple[str, float, str], dict[float, Row]] = defaultdict(dict)
    for row in rows:
        cells[str(row["body"]), float(row["size"]), str(row["rule"])][float(row["seed"])] = row
    found: list[Row] = []
    for (body, size, rule), own in cells.items():
        for measure in MEASURES:
            mean = float(np.mean([np.nanmean(_values(row, measure)) for row in own.values()]))
            head: Row = {"body": body, "size": size, "measure": measure, "rule": rule, "mean": mean}
            for other in against:
                others = cells.get((body, size, other), {})
                if other != rule and others.keys() & own.keys():
                    found.append({**head, "minus": other, **_difference(own, others, measure, config)})
    counts = Counter(map(_family, found))
    return [row | {"p_bonferroni": min(1.0, counts[_family(row)] * float(row["p_sign"]))} for row in found]


def _family(row: Row) -> tuple[str, ...]:
    return tuple(str(row[name]) for name in ("body", "measure", "minus"))


def _difference(own: dict[float, Row], others: dict[float, Row], measure: str, config: BootstrapConfig) -> Row:
    seeds = sorted(own.keys() & others.keys())
    each = [_values(own[seed], measure) - _values(others[seed], measure) for seed in seeds]
    each = [values[np.isfinite(values)] for values in each]
    each = [values for values in each if values.size]
    interval = nested_interval(each, config)
    better = sum(float(values.mean()) < 0.0 for values in each)
    ties = sum(float(values.mean()) == 0.0 for values in each)
    p = float(binomtest(better, len(each) - ties).pvalue) if len(each) > ties else 1.0
    low, high = (interval.low, interval.high) if len(each) >= LEAST_SEEDS else (np.nan, np.nan)
    ends: Row = {"seeds": float(len(each)), "difference": interval.value, "low": low, "high": high}
    return ends | {"seeds_better": float(better), "p_sign": p}


def nested_interval(each: Sequence[Array], config: BootstrapConfig) -> Interval:
    """The mean over seeds of the means over judges (n,) of each, resampled together; ends are NaN of fewer than two seeds."""
    if not each:
        return Interval(np.nan, np.nan, np.nan)
    value = float(np.mean([values.mean() for values in each]))
    if len(each) < 2:
        return Interval(value, np.nan, np.nan)
    return mean_interval(value, resampled_means(each, config), len(each), config)


def resampled_means(each: Sequence[Array], config: BootstrapConfig) -> Array:
    """(R,) means over drawn seeds of the means over drawn judges."""
    rng = np.random.default_rng(config.seed)
    drawn = rng.integers(len(each), size=(config.resamples, len(each)))
    means = np.empty(drawn.shape)
    for seed, values in enumerate(each):
        here = drawn == seed
        means[here] = values[rng.integers(values.size, size=(int(here.sum()), values.size))].mean(axis=1)
    return np.asarray(means.mean(axis=1))


def _values(row: Row, measure: str) -> Array:
    return np.array(str(row[measure]).split(), dtype=float)
