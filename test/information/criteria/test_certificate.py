"""The relaxation's bound lies above every set, and comes down with the steps."""

from itertools import pairwise

import numpy as np
import pytest

from contact_curation.information.accumulated import Accumulated
from contact_curation.information.criteria.certificate import log_det_bound
from contact_curation.information.pool import pool_of
from contact_curation.information.prior import prior_of_matrix
from test.information.oracles import best_log_det, log_det_value, mean_toss
from test.information.pools import toss, tosses


@pytest.mark.parametrize("seed", range(6))
def test_the_bound_is_above_every_set_and_falls_with_the_steps(seed: int) -> None:
    infos = tosses(9, 3, 2, seed)
    a0 = 0.1 * mean_toss(infos)
    pool, coordinates = pool_of(infos), prior_of_matrix(a0, np.zeros(3)).coordinates
    start = Accumulated.prior_only(coordinates).joined(pool.stacked([0, 1, 2]))
    best = best_log_det(infos, a0, 3)
    bounds = [log_det_bound([pool], [start], 3, steps) for steps in (1, 2, 5, 20, 100)]
    assert all(later <= earlier for earlier, later in pairwise(bounds))
    assert best <= bounds[-1] + 1e-9
    assert bounds[-1] < bounds[0]


def test_the_bound_is_exact_where_the_relaxation_is() -> None:
    """With k = K there is one choice, and the tangent there is the value."""
    infos = tosses(5, 3, 2, seed=7)
    a0 = 0.1 * mean_toss(infos)
    pool, coordinates = pool_of(infos), prior_of_matrix(a0, np.zeros(3)).coordinates
    start = Accumulated.prior_only(coordinates).joined(pool.stacked(range(5)))
    assert log_det_bound([pool], [start], 5, 1) == pytest.approx(log_det_value(infos, a0), rel=1e-10)


def test_the_steps_find_the_best_weights() -> None:
    """Two equal tosses per direction, one to be kept of each: half a toss of each is as good, and no weights are better."""
    infos = [toss(f"{axis}{copy}", 2.0 * np.eye(3)[axis : axis + 1]) for axis in range(3) for copy in range(2)]
    pool, coordinates = pool_of(infos), np.eye(3)
    start = Accumulated.prior_only(coordinates).joined(pool.stacked([0, 1, 2]))
    truth = 3 * np.log(5.0)
    assert log_det_bound([pool], [start], 3, 200) == pytest.approx(truth, rel=1e-3)
    assert log_det_bound([pool], [start], 3, 200) >= truth - 1e-9
