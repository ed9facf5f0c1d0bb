"""Bootstrap intervals: coverage where the truth is known, seeds, pairs."""

import numpy as np
import pytest
from scipy.stats import t

from contact_curation.errors import InvalidValueError
from contact_curation.learning.evaluation.bootstrap import BootstrapConfig, Interval, paired_spread, spread

CONFIG = BootstrapConfig(resamples=500, confidence=0.9, seed=3)


def test_values_are_the_plain_statistics() -> None:
    found = spread([1.0, 2.0, 2.0, 3.0, 3.0, 13.0], CONFIG)
    assert (found.median.value, found.mean.value) == (2.5, 4.0)
    assert 1.0 <= found.mean.low < 4.0 < found.mean.high <= 13.0
    assert 1.0 <= found.median.low <= 2.5 <= found.median.high <= 10.0


def test_an_interval_of_the_mean_is_as_wide_as_theory_says() -> None:
    values = np.random.default_rng(1).normal(5.0, 2.0, 400)
    mean = spread(values, BootstrapConfig(resamples=4000, confidence=0.9)).mean
    assert mean.high - mean.low == pytest.approx(2 * 1.645 * values.std() / 20.0, rel=0.06)


def test_intervals_cover_the_truth_as_often_as_they_promise() -> None:
    rng = np.random.default_rng(2)
    intervals = [spread(rng.exponential(1.0, 60), CONFIG) for _ in range(200)]
    means = np.mean([each.mean.low < 1.0 < each.mean.high for each in intervals])
    medians = np.mean([each.median.low < np.log(2.0) < each.median.high for each in intervals])
    assert 0.83 < means < 0.95
    assert 0.83 < medians < 0.96


@pytest.mark.parametrize("count", [6, 10, 20])
def test_means_of_few_values_have_intervals_as_wide_as_students_and_hold_the_truth_as_often(count: int) -> None:
    rng, config = np.random.default_rng(count), BootstrapConfig(resamples=1000)
    drawn = rng.standard_normal((400, count))
    found = [spread(values, config).mean for values in drawn]
    held = np.mean([each.low < 0.0 < each.high for each in found])
    students = 2.0 * t.ppf(0.975, count - 1) * drawn.std(axis=1, ddof=1) / np.sqrt(count)
    ratios = np.array([each.high - each.low for each in found]) / students
    assert held == pytest.approx(0.95, abs=0.025)
    assert np.median(ratios) == pytest.approx(1.0, abs=0.1)


def test_the_same_seed_gives_the_same_interval_and_another_one_another() -> None:
    values = np.random.default_rng(4).standard_normal(30)
    assert spread(values, CONFIG) == spread(values, CONFIG)
    assert spread(values, CONFIG) != spread(values, BootstrapConfig(500, 0.9, seed=4))


def test_pairs_are_far_surer_than_two_figures_where_hard_tosses_are_hard_for_both() -> None:
    rng = np.random.default_rng(5)
    hardness = rng.exponential(20.0, 100)
    ours, theirs = hardness + 0.5, hardness + 0.1 * rng.standard_normal(100)
    paired = paired_spread(ours, theirs, CONFIG).mean
    assert 0.4 < paired.low < 0.5 < paired.high < 0.6
    alone = spread(ours, CONFIG).mean
    assert alone.high - alone.low > 30.0 * (paired.high - paired.low)


@pytest.mark.parametrize(("confidence", "fewest"), [(0.5, 2), (0.9, 5), (0.95, 6), (0.99, 8)])
def test_tosses_too_few_to_have_the_true_median_among_them_so_often_have_no_interval(confidence: float, fewest: int) -> None:
    config = BootstrapConfig(500, confidence)
    median = spread(np.arange(1.0, fewest), config).median
    assert median.value == 0.5 * fewest
    assert np.isnan([median.low, median.high]).all()
    assert isinstance(median, Interval)
    assert np.isfinite(spread(np.arange(1.0, fewest + 1.0), config).median.low)


@pytest.mark.parametrize("values", [[], [1.0, np.nan], [np.inf], [[1.0]]])
def test_what_is_no_list_of_finite_numbers_is_refused(values: list[float]) -> None:
    with pytest.raises(InvalidValueError, match="numbers per toss"):
        spread(values, CONFIG)


def test_other_tosses_are_no_pairs() -> None:
    with pytest.raises(InvalidValueError, match="the same tosses"):
        paired_spread([1.0, 2.0], [1.0], CONFIG)


@pytest.mark.parametrize(
    ("name", "value"), [("resamples", 0), ("confidence", 0.0), ("confidence", 1.0), ("confidence", np.nan), ("seed", -1)]
)
def test_a_setting_out_of_range_is_refused(name: str, value: float) -> None:
    with pytest.raises(InvalidValueError, match=name):
        BootstrapConfig(**{name: value})  # type: ignore[arg-type]
