"""The identifiable subspace holds what the tosses tell about theta, whatever theta's units (method.md check 5)."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information import subspace
from contact_curation.information.pool import pool_of
from contact_curation.information.prior import log_det_prior, prior_of_matrix
from contact_curation.information.subspace import identifiable_subspace
from test.information.pools import blocks_of, toss, tosses

SIZE = 9
NOTHING = "at least one toss that tells something about theta"


def fisher_without(direction: Array, seed: int) -> Array:
    """A Fisher matrix that is exactly null along `direction` and of full rank otherwise."""
    scores = np.random.default_rng(seed).standard_normal((60, direction.size))
    unit = direction / np.linalg.norm(direction)
    scores -= np.outer(scores @ unit, unit)
    return np.asarray(scores.T @ scores)


def test_whitening_makes_the_pooled_information_the_identity() -> None:
    fisher = pool_of(tosses(30, SIZE, 4, seed=0)).fisher
    subspace = identifiable_subspace(fisher)
    assert subspace.dimension == SIZE == subspace.parameters
    np.testing.assert_allclose(subspace.whitening.T @ fisher @ subspace.whitening, np.eye(SIZE), atol=1e-10)
    per_toss = subspace.per_mean_toss(30)
    np.testing.assert_allclose(per_toss.T @ (fisher / 30) @ per_toss, np.eye(SIZE), atol=1e-10)


def test_a_gauge_freedom_is_singular_before_and_gone_after() -> None:
    gauge = np.random.default_rng(1).standard_normal(SIZE)
    fisher = fisher_without(gauge, seed=2)
    raw = np.linalg.eigvalsh(fisher)
    assert raw[0] / raw[-1] < 1e-12
    subspace = identifiable_subspace(fisher)
    assert subspace.dimension == SIZE - 1
    assert subspace.eigenvalues[0] > 1e-3
    np.testing.assert_allclose(subspace.whitening.T @ fisher @ subspace.whitening, np.eye(SIZE - 1), atol=1e-10)


@given(st.lists(st.floats(-3.0, 3.0), min_size=SIZE, max_size=SIZE), st.integers(0, 50))
def test_units_of_the_parameters_change_nothing(exponents: list[float], seed: int) -> None:
    scale = 10.0 ** np.array(exponents)
    gauge = np.random.default_rng(seed).standard_normal(SIZE)
    fisher, scores = fisher_without(gauge, seed), np.random.default_rng(seed + 1).standard_normal((3, SIZE))
    here = identifiable_subspace(fisher)
    scaled = scale[:, None] * fisher * scale
    there = identifiable_subspace(scaled)
    assert here.dimension == there.dimension == SIZE - 1
    one, other = scores @ here.whitening, (scores * scale) @ there.whitening
    np.testing.assert_allclose(one @ one.T, other @ other.T, rtol=1e-6, atol=1e-9)


def test_parameters_that_no_toss_measured_are_left_out() -> None:
    fisher = pool_of(tosses(30, SIZE, 4, seed=6)).fisher.copy()
    fisher[3] = fisher[:, 3] = 0.0
    fisher[5] = fisher[:, 5] = 1e-17
    fisher[5, 5] = 1e-30
    subspace = identifiable_subspace(fisher)
    assert subspace.dimension == SIZE - 2
    assert not subspace.whitening[[3, 5]].any()


def test_weak_directions_are_kept_down_to_the_cut() -> None:
    turn = np.linalg.qr(np.random.default_rng(7).standard_normal((3, 3)))[0]
    fisher = turn @ np.diag([1.0, 1.0, 1e-6]) @ turn.T
    assert identifiable_subspace(fisher, cut=1e-8).dimension == 3
    assert identifiable_subspace(fisher, cut=1e-3).dimension == 2


def test_no_information_at_all_is_an_error() -> None:
    with pytest.raises(InvalidValueError, match=rf"^pooled information: found zero, expected {NOTHING}$"):
        identifiable_subspace(np.zeros((4, 4)))


def test_a_prior_is_the_identity_in_its_coordinates() -> None:
    root = np.random.default_rng(8).standard_normal((5, 5))
    pivot = np.array([1.0, 2.0, 3.0])
    prior = prior_of_matrix(root @ root.T, pivot)
    np.testing.assert_array_equal(prior.pivot, pivot)
    np.testing.assert_allclose(prior.coordinates.T @ (root @ root.T) @ prior.coordinates, np.eye(5), atol=1e-9)
    with pytest.raises(
        InvalidValueError, match=r"^prior information: found smallest eigenvalue -1, expected a positive definite matrix$"
    ):
        prior_of_matrix(np.diag([1.0, -1.0]), np.zeros(3))


def test_a_pools_prior_is_a_share_of_its_mean_toss_unless_it_has_its_own() -> None:
    infos = tosses(20, 5, 4, seed=9)
    mean = pool_of(infos).fisher / 20
    coordinates = log_det_prior(pool_of(infos), 1e-3).coordinates
    np.testing.assert_allclose(coordinates.T @ (1e-3 * mean) @ coordinates, np.eye(5), atol=1e-9)
    own = log_det_prior(pool_of(infos, prior=4.0 * np.eye(5)), 1e-3).coordinates
    np.testing.assert_allclose(own, 0.5 * np.eye(5), atol=1e-12)


def test_a_prior_refuses_tosses_of_other_parameters() -> None:
    with pytest.raises(InvalidValueError, match=r"^parameters of toss toss-0000: found 5, expected 4, as in the prior$"):
        prior_of_matrix(np.eye(4), np.zeros(3)).rows(tosses(1, 5, 2, seed=0)[0])


def test_a_priors_rows_are_about_its_pivot() -> None:
    blocks, axes = blocks_of([("tilt", 2), ("height", 1)]), np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    info = toss("a", np.array([[1.0, 2.0, 4.0]]), blocks=blocks, tilt_axes=axes, centroid=np.array([1.0, 1.0, 1.0]))
    rows = prior_of_matrix(np.eye(3), np.array([3.0, 9.0, 0.5])).rows(info)
    np.testing.assert_allclose(rows, [[1.0 + 2.0 * 4.0, 2.0 - 0.5 * 4.0, 4.0]])


def test_leading_directions_are_the_largest_and_whiten() -> None:
    turn = np.linalg.qr(np.random.default_rng(7).standard_normal((4, 4)))[0]
    fisher = turn @ np.diag([1e-9, 4.0, 9.0, 16.0]) @ turn.T
    for directions, values in ((2, [9.0, 16.0]), (3, [4.0, 9.0, 16.0]), (9, [4.0, 9.0, 16.0])):
        leading = subspace.leading_subspace(fisher, directions)
        np.testing.assert_allclose(leading.eigenvalues, values, rtol=1e-10)
        whole = leading.whitening.T @ fisher @ leading.whitening
        np.testing.assert_allclose(whole, np.eye(len(values)), atol=1e-7)
    assert subspace.leading_subspace(fisher, 4, cut=0.5).eigenvalues == pytest.approx([9.0, 16.0])


def test_a_pool_of_a_networks_sketch_is_compared_in_its_leading_directions(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(subspace, "LEADING_DIRECTIONS", 2)
    rows = np.diag([1.0, 2.0, 3.0])
    sketched = pool_of([toss("a", rows, blocks=blocks_of([("gap network", 3)]))])
    np.testing.assert_allclose(subspace.pool_subspace(sketched).eigenvalues, [4.0, 9.0])
    assert subspace.pool_subspace(sketched, cut=0.5).dimension == 1
    plain = pool_of([toss("a", rows)])
    np.testing.assert_allclose(subspace.pool_subspace(plain).eigenvalues, [1.0, 1.0, 1.0])
    assert subspace.pool_subspace(plain, cut=0.9999).dimension == 3


def test_a_few_directions_of_many_parameters_are_the_same_however_they_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = np.random.default_rng(5).standard_normal((20, 60)) * np.linspace(1.0, 3.0, 60)
    whole = subspace.leading_subspace(rows.T @ rows, 8)
    monkeypatch.setattr(subspace, "LARGEST_DENSE", 10)
    few = subspace.leading_subspace(rows.T @ rows, 8)
    np.testing.assert_allclose(few.eigenvalues, whole.eigenvalues, rtol=1e-10)
    np.testing.assert_allclose(few.whitening @ few.whitening.T, whole.whitening @ whole.whitening.T, atol=1e-10)
    with pytest.raises(InvalidValueError, match=rf"^pooled information: found zero, expected {NOTHING}$"):
        subspace.leading_subspace(np.zeros((20, 20)), 8)
