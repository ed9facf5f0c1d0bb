"""TracIn and sketched influence against plain loops, and in a linear world where what they say is known exactly."""

import numpy as np
import pytest

from contact_curation.experiments import bodies
from contact_curation.experiments.cell_run import FIT
from contact_curation.experiments.counterfactuals.refitted import Laboratory
from contact_curation.experiments.counterfactuals.traced import checkpoints, sketched, toss_scores, traced
from contact_curation.learning.fits.polytope_sums import moved

TOSSES, DIRECTIONS = 20, 3


def test_the_traced_parts_of_all_tosses_add_up_to_what_small_steps_do_to_the_judging_loss() -> None:
    rng = np.random.default_rng(0)
    training, judging = rng.standard_normal((TOSSES, DIRECTIONS)), rng.standard_normal((9, DIRECTIONS))
    answers, asked = training @ np.ones(DIRECTIONS) + 0.1 * rng.standard_normal(TOSSES), judging @ np.ones(DIRECTIONS)
    theta, rate, pulls, scores = np.zeros(DIRECTIONS), 1e-4, [], []
    before = float(np.square(judging @ theta - asked).sum())
    for _ in range(400):
        each = training * (answers - training @ theta)[:, None]  # minus half the gradient of each toss's loss
        pulls.append(judging.T @ (asked - judging @ theta))
        scores.append(each)
        theta = theta + rate * each.sum(axis=0)
    parts = 2.0 * rate * traced(np.array(pulls), np.array(scores))
    lowered = before - float(np.square(judging @ theta - asked).sum())
    assert parts.sum() == pytest.approx(lowered, rel=0.02)
    plain = [sum(float(pull @ each[k]) for pull, each in zip(pulls, scores, strict=True)) for k in range(TOSSES)]
    assert parts == pytest.approx(2.0 * rate * np.array(plain))


def test_a_sketch_that_keeps_all_directions_is_influence_and_a_narrow_one_is_not() -> None:
    rng = np.random.default_rng(1)
    designs = rng.standard_normal((TOSSES, DIRECTIONS))
    whole, scores, pull = designs.T @ designs, rng.standard_normal((TOSSES, DIRECTIONS)), rng.standard_normal(DIRECTIONS)
    influence = [float(pull @ np.linalg.inv(whole) @ one) for one in scores]
    assert sketched(pull, scores, whole, rng.standard_normal((DIRECTIONS, DIRECTIONS))) == pytest.approx(influence)
    narrow = rng.standard_normal((DIRECTIONS, 1))
    along = float(pull @ narrow[:, 0]) / float(narrow[:, 0] @ whole @ narrow[:, 0])
    assert sketched(pull, scores, whole, narrow) == pytest.approx([along * float(one @ narrow[:, 0]) for one in scores])


@pytest.mark.slow
def test_checkpoints_lead_down_to_the_fit_and_scores_are_slopes_of_the_losses(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bodies, "SIMULATED", 8)
    laboratory = Laboratory.of("slab")
    models = checkpoints(laboratory)
    held = laboratory.pool.held_sum(laboratory.pool.data, *laboratory.pool._unweighted, laboratory.pool.model)
    sums = [held.iterate(model).objective for model in models]
    assert len(sums) > 3
    assert sums == sorted(sums, reverse=True)
    model = laboratory.pool.model
    scores = toss_scores(model, laboratory.judging, laboratory.weights)
    assert len(scores) == len(laboratory.bench.held_out)
    way = np.zeros(scores.shape[1])
    way[-4] = 1e-5  # friction
    ends = [laboratory.held_out_loss(moved(model, sign * way)) * len(laboratory.judging.dt) for sign in (1.0, -1.0)]
    assert -2.0 * scores.sum(axis=0)[-4] == pytest.approx((ends[0] - ends[1]) / 2e-5, rel=1e-3)
    assert FIT.early_tolerance > 0.0
