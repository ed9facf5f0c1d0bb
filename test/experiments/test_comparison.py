"""The comparison of rules: intervals over seeds and judges together, rules with weights, and the command to its table."""

import csv
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import t

from contact_curation.experiments import bodies
from contact_curation.experiments.cell_run import Row
from contact_curation.experiments.comparison.baselines import BASELINES, matched, medoids
from contact_curation.experiments.comparison.intervals import differences, nested_interval
from contact_curation.experiments.engines import MEASURES
from contact_curation.information.pool import pool_of
from contact_curation.learning.evaluation.bootstrap import BootstrapConfig, spread
from test.cli.commands import Cli
from test.information.network_cases import tosses
from test.information.pools import toss

CONFIG = BootstrapConfig(resamples=2000)


def test_an_interval_holds_the_mean_as_often_as_it_says_where_seeds_and_judges_both_scatter() -> None:
    rng, held = np.random.default_rng(0), {"both": 0, "judges": 0}
    for _ in range(120):
        each = [rng.normal(0.0, 1.0) + rng.normal(0.0, 1.0, 15) for _ in range(12)]
        both = nested_interval(each, BootstrapConfig(resamples=300))
        alone = spread(np.concatenate(each), BootstrapConfig(resamples=300)).mean
        held["both"] += both.low < 0.0 < both.high
        held["judges"] += alone.low < 0.0 < alone.high
    assert held["both"] > 108 > held["judges"]


def test_an_interval_over_ten_seeds_is_as_wide_as_students() -> None:
    rng, ratios = np.random.default_rng(5), []
    for _ in range(100):
        each = [rng.normal() + 0.01 * rng.standard_normal(40) for _ in range(10)]
        found = nested_interval(each, BootstrapConfig(resamples=1000))
        means = [values.mean() for values in each]
        ratios.append((found.high - found.low) / (2.0 * t.ppf(0.975, 9) * np.std(means, ddof=1) / np.sqrt(10.0)))
    assert np.median(ratios) == pytest.approx(1.0, abs=0.05)


def test_a_difference_is_paired_by_seed_and_judge() -> None:
    rng = np.random.default_rng(1)
    rows: list[Row] = []
    for seed in range(10):
        hard = 20.0 * rng.standard_normal(30)
        for rule, gain in (("random", 0.0), ("herding", -1.0), ("trace", 1.0)):
            values = " ".join(f"{value:.6f}" for value in 50.0 + hard + gain + 0.5 * rng.standard_normal(30))
            head: Row = {"body": "slab", "size": 8.0, "rule": rule, "seed": float(seed)}
            rows.append(head | dict.fromkeys(MEASURES, values))
    found = [row for row in differences(rows, CONFIG) if row["rule"] == "herding"]
    assert [row["measure"] for row in found] == list(MEASURES)
    assert float(found[0]["difference"]) == pytest.approx(-1.0, abs=0.15)
    assert -1.3 < float(found[0]["low"]) < float(found[0]["high"]) < -0.7
    assert found[0]["seeds_better"] == 10.0
    assert found[0]["p_sign"] == pytest.approx(2.0**-9)
    assert float(found[0]["p_bonferroni"]) == pytest.approx(2 * 2.0**-9)  # of two rules
    few = differences([row for row in rows if float(row["seed"]) < 9.0], CONFIG)
    assert few[0]["difference"] == pytest.approx(-1.0, abs=0.15)
    assert np.isnan(float(few[0]["low"]))


def test_weights_bring_the_mean_score_near_the_pools() -> None:
    scores = np.random.default_rng(2).standard_normal((50, 6)) + 1.0
    picks, weights = matched(scores, 12)
    assert len(set(picks)) == 12
    assert weights.sum() == pytest.approx(12.0)
    assert weights.min() > 0.0
    misses = [np.linalg.norm(scores.mean(axis=0) - weights @ scores[picks] / 12.0),
              np.linalg.norm(scores.mean(axis=0) - scores[:12].mean(axis=0))]  # fmt: skip
    assert misses[0] < 0.3 * misses[1]


def test_each_group_has_its_medoid() -> None:
    group = np.arange(40) % 4
    features = 8.0 * np.eye(4)[group] + np.random.default_rng(3).uniform(-1.0, 1.0, (40, 4))
    found = medoids(features, 4)
    assert sorted(group[found]) == [0, 1, 2, 3]
    for place in found:
        own = features[group == group[place]]
        totals = np.linalg.norm(own[:, None] - own[None], axis=2).sum(axis=1)
        assert np.linalg.norm(own - features[place], axis=1).sum() == pytest.approx(totals.min())


@pytest.mark.parametrize("rule", ["k-medoids", "strata"])
def test_what_needs_no_scores_selects_as_many_tosses_as_asked(rule: str) -> None:
    thrown = tosses()
    pool = pool_of(toss(each.toss_id, np.eye(2)) for each in thrown)
    assert len(BASELINES[rule](pool, thrown, 3, 0)) == 3
    assert set(BASELINES[rule](pool, thrown, len(thrown), 0)) == {each.toss_id for each in thrown}


@pytest.mark.slow
def test_the_command_compares_rules_with_and_without_weights(cli: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bodies, "SIMULATED", 12)
    rules = ("random", "v-optimal", "gradient-matching", "strata")
    words = ("reproduce", "criteria", "--bodies", "wedge", "--quick", "--rules", *rules, "--json", "--out", tmp_path)
    assert cli(*words).json["run"] == 8
    again = cli(*words)
    assert (again.json["cells"], again.json["run"]) == (8, 0)
    with (tmp_path / "differences.csv").open(newline="") as file:
        table = list(csv.DictReader(file))
    assert {row["rule"] for row in table} == set(rules) - {"random"}
    assert {row["measure"] for row in table} == set(MEASURES)
    assert all(np.isfinite(float(row["difference"])) for row in table)
