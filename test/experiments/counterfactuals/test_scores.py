"""Scores of subsets against plain formulas, the correlation against SciPy's, and a linear world in which influence is exact."""

import numpy as np
import pytest
from scipy.stats import spearmanr

from contact_curation.experiments.cell_run import Row
from contact_curation.experiments.counterfactuals.scores import PRIOR, Known, datamodeling_scores, foreseen, rank_correlation
from contact_curation.experiments.counterfactuals.table import OUTCOMES
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.evaluation.bootstrap import BootstrapConfig

TOSSES, DIRECTIONS = 60, 3
CONFIG = BootstrapConfig(resamples=400)


def linear_world(seed: int) -> tuple[Known, Array]:
    """Tosses that measure three numbers linearly with noise, at the fit to all, and the designs (K, 4, 3) that they have."""
    rng = np.random.default_rng(seed)
    designs = rng.standard_normal((TOSSES, 4, DIRECTIONS))
    whole = np.einsum("kri,krj->ij", designs, designs) / TOSSES
    designs = designs @ np.linalg.inv(np.linalg.cholesky(whole)).T
    residuals = rng.standard_normal((TOSSES, 4))
    fit = np.linalg.lstsq(designs.reshape(-1, DIRECTIONS), residuals.ravel())[0]
    scores = np.einsum("kri,kr->ki", designs, residuals - designs @ fit)
    fishers = np.einsum("kri,krj->kij", designs, designs)
    pull = 30.0 * rng.standard_normal(DIRECTIONS)
    plain = {"trace": -np.trace(fishers, axis1=1, axis2=2)}
    return Known(fishers, scores, pull, fishers.sum(axis=0), 20.0 * np.eye(DIRECTIONS), plain), designs


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
    away = np.mean([known.scores[k] for k in chosen], axis=0) - known.scores.mean(axis=0)
    assert found["herding"] == pytest.approx(away @ away)


def test_influence_foresees_the_order_of_losses_in_a_linear_world_and_the_trace_does_not() -> None:
    known, _ = linear_world(1)
    rng, rows = np.random.default_rng(2), list[Row]()
    for draw in range(300):
        chosen = np.sort(rng.choice(TOSSES, 30, replace=False))
        matrix = PRIOR * np.eye(DIRECTIONS) + known.fishers[chosen].sum(axis=0)
        shift = np.linalg.solve(matrix, known.scores[chosen].sum(axis=0))
        loss = float(shift @ known.judging @ shift - 2.0 * known.pull @ shift)
        outcomes = dict.fromkeys(OUTCOMES, np.nan) | {"loss": loss}
        rows.append({"body": "line", "size": 30.0, "draw": float(draw), "tosses": " ".join(map(str, chosen)), **outcomes})
    found = {row["score"]: row for row in datamodeling_scores(known, [str(k) for k in range(TOSSES)], rows, CONFIG)
             if row["outcome"] == "loss"}  # fmt: skip
    assert found["influence-set"]["spearman"] == pytest.approx(1.0)
    assert float(found["influence"]["spearman"]) > 0.9
    assert abs(float(found["trace"]["spearman"])) < 0.3
    assert float(found["influence"]["low"]) < float(found["influence"]["spearman"]) < float(found["influence"]["high"])


def test_the_correlation_is_spearmans_and_its_interval_narrows_with_the_pairs() -> None:
    rng = np.random.default_rng(0)
    one = rng.standard_normal(400)
    other = one + rng.standard_normal(400)
    few, many = (rank_correlation(one[:count], other[:count], CONFIG) for count in (40, 400))
    assert many.value == pytest.approx(spearmanr(one, other).statistic)
    assert few.high - few.low > 2.0 * (many.high - many.low) > 0.0
    assert np.isnan(rank_correlation(np.ones(9), other[:9], CONFIG).value)
