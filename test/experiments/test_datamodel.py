"""The rule by counterfactual prediction: its regression against plain left-out fits, and its search in a linear world."""

import numpy as np
import pytest

from contact_curation.experiments.comparison.datamodel import STRENGTHS, Datamodel, features, ridge
from test.experiments.counterfactuals.linear_world import DIRECTIONS, TOSSES, linear_world


def test_the_ridge_is_the_one_that_foresees_left_out_rows_best() -> None:
    rng = np.random.default_rng(0)
    rows = rng.standard_normal((24, 5)) * np.array([1.0, 30.0, 0.1, 2.0, 1.0])
    outcomes = rows @ np.array([0.5, 0.0, 4.0, 0.0, 0.2]) + 0.8 * rng.standard_normal(24) + 7.0
    scaled = (rows - rows.mean(axis=0)) / rows.std(axis=0)

    def fit(strength: float, kept: list[int]) -> tuple[np.ndarray, float]:
        one = np.concatenate([scaled[kept], np.ones((len(kept), 1))], axis=1)
        found = np.linalg.solve(one.T @ one + np.diag([strength] * 5 + [0.0]), one.T @ outcomes[kept])
        return found[:5], float(found[5])

    def left_out(strength: float) -> float:
        misses = []
        for row in range(24):
            weights, constant = fit(strength, [other for other in range(24) if other != row])
            misses.append(outcomes[row] - scaled[row] @ weights - constant)
        return float(np.square(misses).mean())

    best = min(STRENGTHS, key=left_out)
    assert STRENGTHS[0] < best < STRENGTHS[-1]
    assert ridge(rows, outcomes) * rows.std(axis=0) == pytest.approx(fit(best, list(range(24)))[0])


def test_the_search_finds_a_set_that_its_model_prefers_to_all_random_ones() -> None:
    world, _ = linear_world(5)
    known = world._replace(plain={"duration": np.ones(TOSSES)})
    weights = np.array([1.0, 0.0, 0.0, 0.0, 0.0])  # of the logarithm of `v-optimal`
    model = Datamodel(known, weights)
    chosen = model.best(6, np.random.default_rng(0))
    assert len(set(chosen.tolist())) == 6
    rng = np.random.default_rng(1)
    others = [model.foreseen(rng.choice(TOSSES, 6, replace=False)) for _ in range(300)]
    assert model.foreseen(chosen) < min(others)
    assert features(known, chosen).shape == (5,)
    assert known.scores.shape == (TOSSES, DIRECTIONS)
