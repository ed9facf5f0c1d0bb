"""Scores of subsets against plain formulas, the correlation against SciPy's, and a linear world in which influence is exact."""

import numpy as np
import pytest
from scipy.stats import spearmanr

from contact_curation.experiments.cell_run import Row
from contact_curation.experiments.counterfactuals.correlations import correlations, rank_correlation, table_of
from contact_curation.experiments.counterfactuals.scores import PRIOR, Known, foreseen
from contact_curation.experiments.counterfactuals.table import FORESEEN, FORESEEN_BY, OUTCOMES
from contact_curation.learning.evaluation.bootstrap import BootstrapConfig
from test.experiments.counterfactuals.linear_world import DIRECTIONS, TOSSES, linear_world

CONFIG = BootstrapConfig(resamples=400)


def test_scores_of_a_set_are_what_plain_formulas_give() -> None:
    known, _ = linear_world(0)
    chosen = np.array([3, 10, 41, 59])
    found = foreseen(known, chosen)
    matrix = PRIOR * np.eye(DIRECTIONS) + sum(known.fishers[k] for k in chosen)
    assert found["trace"] == pytest.approx(-sum(np.trace(known.fishers[k]) for k in chosen))
    assert found["log-det"] == pytest.approx(-np.log(np.linalg.det(matrix)))
    assert found["v-optimal"] == pytest.approx(np.trace(np.linalg.inv(matrix)))
    nearest = [min(np.linalg.norm(one - known.scores[k]) for k in chosen) for one in known.scores]
    assert found["facility-location"] == pytest.approx(np.mean(nearest))
    assert set(found) == set(FORESEEN) - {"trace-empirical", "tracin", "trak", "knn-shapley", "loss", "duration", "smoothness"}
    away = np.mean([known.scores[k] for k in chosen], axis=0) - known.scores.mean(axis=0)
    assert found["herding"] == pytest.approx(away @ away)


def refits(known: Known, body: str, size: int, draws: int) -> list[Row]:
    """Subsets of the linear world with the judging loss at their exact optima."""
    rng, rows = np.random.default_rng(2), list[Row]()
    for _ in range(draws):
        chosen = np.sort(rng.choice(TOSSES, size, replace=False))
        matrix = PRIOR * np.eye(DIRECTIONS) + known.fishers[chosen].sum(axis=0)
        shift = np.linalg.solve(matrix, known.scores[chosen].sum(axis=0))
        outcomes = dict.fromkeys(OUTCOMES, np.nan) | {"loss": float(shift @ known.judging @ shift - 2.0 * known.pull @ shift)}
        said = dict.fromkeys(FORESEEN_BY, np.nan) | {f"foreseen_{k}": value for k, value in foreseen(known, chosen).items()}
        rows.append({"body": body, "size": float(size), **outcomes, **said})
    return rows


def of_the_loss(rows: list[Row]) -> dict[str, Row]:
    found = table_of(correlations(rows, CONFIG), CONFIG)
    return {str(row["score"]): row for row in found if row["outcome"] == "loss" and row["body"] != "all"}


def test_influence_foresees_the_order_of_losses_in_a_linear_world_and_the_trace_does_not() -> None:
    known, _ = linear_world(1)
    found = of_the_loss(refits(known, "line", 30, 300))
    assert found["influence-set"]["spearman"] == pytest.approx(1.0)
    assert float(found["influence"]["spearman"]) > 0.9
    assert abs(float(found["trace"]["spearman"])) < 0.3
    assert float(found["influence"]["low"]) < float(found["influence"]["spearman"]) < float(found["influence"]["high"])


def test_influence_of_single_tosses_fails_for_small_subsets_and_holds_near_the_whole_pool() -> None:
    known, _ = linear_world(3)
    known = known._replace(pull=known.pull / 10.0)
    few, most = (float(of_the_loss(refits(known, "line", size, 300))["influence"]["spearman"]) for size in (4, 54))
    assert few < 0.6
    assert most > 0.9


def test_the_mean_over_bodies_and_sizes_has_a_narrower_interval_than_each() -> None:
    known, _ = linear_world(4)
    rows = [refits(known, body, size, 60) for body in ("line", "plane") for size in (10, 20)]
    found = [one for each in rows for one in correlations(each, CONFIG)]
    table = [row for row in table_of(found, CONFIG) if (row["outcome"], row["score"]) == ("loss", "trace")]
    mean, each = table[-1], table[:-1]
    assert (mean["body"], mean["subsets"], len(each)) == ("all", 240.0, 4)
    assert mean["spearman"] == pytest.approx(np.mean([float(row["spearman"]) for row in each]))
    widths = [float(row["high"]) - float(row["low"]) for row in table]
    assert 0.0 < widths[-1] < 0.7 * min(widths[:-1])


def test_the_correlation_is_spearmans_and_its_interval_narrows_with_the_pairs() -> None:
    rng = np.random.default_rng(0)
    one = rng.standard_normal(400)
    other = one + rng.standard_normal(400)
    few, many = (rank_correlation(one[:count], other[:count], CONFIG).interval(CONFIG) for count in (40, 400))
    assert many.value == pytest.approx(spearmanr(one, other).statistic)
    assert few.high - few.low > 2.0 * (many.high - many.low) > 0.0
    assert np.isnan(rank_correlation(np.ones(9), other[:9], CONFIG).value)
