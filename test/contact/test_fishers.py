"""Fisher sums: the kernel's structured Gauss-Newton matrix against the dense one, and what it must and must not know."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.data.thrown_bodies import ellipsoid, uniform
from contact_curation.contact.evaluation import Cone, Estimator, evaluate, fisher_sums
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.torch_contacts import Frames
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.transitions import transitions_of
from contact_curation.solver.certificate import FACET_NORMALS, FREE_TOLERANCE, free_directions
from test.contact.cases import CUBE, DT, KINDS, TRUE, Rows, noisy_geometry, rows_of_kind, tracked_transitions
from test.contact.torch_fisher import profile_fishers
from test.simulated import RIG_NOISE, simulated_tosses

HEIGHT = 57


def single_fishers(geometry: ContactGeometry, rows: Rows, estimator: Estimator, config: LossConfig) -> Array:
    """(N, 58, 58) a matrix per transition."""
    return fisher_sums(geometry, CUBE, rows.before, rows.after, DT, np.arange(len(rows) + 1), estimator, np.inf, config).fishers


@pytest.mark.parametrize("cone", list(Cone))
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("geometry", [TRUE, noisy_geometry(6, pivot=True)], ids=["true", "noisy"])
def test_the_gauss_newton_matrix_is_the_dense_one(kind: str, geometry: ContactGeometry, cone: Cone) -> None:
    """method.md 1.5, term by term: all 54 residuals, their Jacobians by autograd, projected."""
    rows, config = rows_of_kind(kind), LossConfig(cone=cone, regularization=1e-5, tolerance=1e-6)
    ours = single_fishers(geometry, rows, Estimator.GAUSS_NEWTON, config)
    impulses = evaluate(geometry, CUBE, rows.before, rows.after, DT, config).impulses
    frames = Frames.of(CUBE, rows.before, rows.after, np.full(len(rows), DT))
    dense = profile_fishers(geometry, frames, impulses, config)
    scale = np.abs(dense).max(axis=(1, 2), keepdims=True) + 1e-12
    assert (np.abs(ours - dense) / scale).max() < 1e-7
    assert np.abs(ours - ours.transpose(0, 2, 1)).max() == 0.0
    assert np.linalg.eigvalsh(dense / scale).min() > -1e-7


@pytest.mark.slow
@pytest.mark.parametrize("cone", list(Cone))
@pytest.mark.parametrize("corners", [5, 40])
def test_of_any_number_of_corners_the_matrix_is_the_dense_one(corners: int, cone: Cone) -> None:
    """Contacts in the air are eliminated one by one, those on the ground together: of which kind they are must not matter."""
    body = uniform("ellipsoid", [ellipsoid(corners, [0.06, 0.05, 0.04])], 900.0, 0.2).body
    config = LossConfig(cone=cone)
    geometry = ContactGeometry.of_body(body)
    rows = transitions_of(simulated_tosses(2, seed=3, noise=RIG_NOISE, body=body), body.length_scale)
    chosen = np.linspace(0, len(rows.before) - 1, 40).astype(int)
    before, after, dt = rows.before[chosen], rows.after[chosen], rows.dt[chosen]
    edges = np.arange(len(chosen) + 1)
    ours = fisher_sums(geometry, body, before, after, dt, edges, Estimator.GAUSS_NEWTON, np.inf, config).fishers
    impulses = evaluate(geometry, body, before, after, dt, config).impulses
    assert (np.count_nonzero(impulses[:, :, 0] > FREE_TOLERANCE, axis=1) > corners // 2).any()
    frames = Frames.of(body, before, after, dt)
    dense = profile_fishers(geometry, frames, impulses, config.for_theta(body, geometry.is_rigid))
    scale = np.abs(dense).max(axis=(1, 2), keepdims=True) + 1e-12
    assert (np.abs(ours - dense) / scale).max() < 1e-10


def test_impulses_move_freely_inside_along_the_cone_and_not_at_its_apex() -> None:
    impulses = np.array([[[0.0, 0.0, 0.0], [1.0, 0.2, 0.1], [1.0, 0.6, 0.8]]])
    gradients = np.array([[[0.5, 0.0, 0.0], [0.0, 0.0, 0.0], [0.3, -0.18, -0.24]]])
    apex, inside, rim = free_directions(impulses, gradients, Cone.CIRCULAR)[0]
    assert not apex.any()
    np.testing.assert_array_equal(inside, np.eye(3))
    np.testing.assert_allclose(rim[:, :2].T @ rim[:, :2], np.eye(2), atol=1e-15)
    np.testing.assert_allclose(rim.T @ gradients[0, 2], 0.0, atol=1e-15)
    assert not rim[:, 2].any()


def test_on_the_polyhedral_cone_impulses_move_in_their_facet_or_along_an_edge() -> None:
    edge = np.array([np.cos(np.pi / 8), np.cos(np.pi / 8), np.sin(np.pi / 8)])
    impulses = np.array([[[1.0, 1.0, 0.1], edge / edge[0]]])
    gradients = np.full((1, 2, 3), 0.2)
    facet, along = free_directions(impulses, gradients, Cone.POLYHEDRAL)[0]
    np.testing.assert_allclose(FACET_NORMALS[0] @ facet, 0.0, atol=1e-15)
    np.testing.assert_allclose(facet[:, :2].T @ facet[:, :2], np.eye(2), atol=1e-15)
    assert np.linalg.matrix_rank(along) == 1
    np.testing.assert_allclose(FACET_NORMALS[:2] @ along, 0.0, atol=1e-15)
    assert FREE_TOLERANCE < 1e-5


def test_an_empirical_matrix_is_the_sum_of_its_scores_outer_products() -> None:
    rows = tracked_transitions()
    sums = fisher_sums(TRUE, CUBE, rows.before, rows.after, rows.dt, rows.starts, Estimator.EMPIRICAL)
    found = evaluate(TRUE, CUBE, rows.before, rows.after, rows.dt)
    for k in range(len(rows.starts) - 1):
        own = found.scores[rows.starts[k] : rows.starts[k + 1]]
        np.testing.assert_allclose(sums.fishers[k], own.T @ own, rtol=1e-10, atol=1e-14)
        np.testing.assert_allclose(sums.score_sums[k], own.sum(axis=0), rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(sums.losses, found.losses, rtol=1e-12)


@pytest.mark.parametrize("estimator", list(Estimator))
def test_information_adds_and_traces_with_it(estimator: Estimator) -> None:
    """method.md 6.6."""
    rows = tracked_transitions()
    apart = fisher_sums(TRUE, CUBE, rows.before, rows.after, rows.dt, rows.starts, estimator).fishers
    together = fisher_sums(TRUE, CUBE, rows.before, rows.after, rows.dt, rows.starts[[0, -1]], estimator).fishers[0]
    np.testing.assert_allclose(apart.sum(axis=0), together, atol=1e-12 * np.trace(together))
    assert np.trace(apart, axis1=1, axis2=2).sum() == pytest.approx(np.trace(together), rel=1e-12)


@pytest.mark.parametrize("estimator", list(Estimator))
def test_a_bound_on_the_influence_scales_a_score_by_bound_over_loss(estimator: Estimator) -> None:
    rows = rows_of_kind("impact")
    losses = evaluate(TRUE, CUBE, rows.before, rows.after, DT).losses
    bound = float(np.median(losses))
    edges = np.arange(len(rows) + 1)
    free = fisher_sums(TRUE, CUBE, rows.before, rows.after, DT, edges, estimator)
    held = fisher_sums(TRUE, CUBE, rows.before, rows.after, DT, edges, estimator, bound)
    share = np.minimum(1.0, bound / losses)
    assert (share < 1.0).any()
    rounding = 1e-14 * np.abs(free.fishers).max()  # entries are differences of terms as large as the largest entry
    np.testing.assert_allclose(held.fishers, free.fishers * np.square(share)[:, None, None], rtol=1e-12, atol=rounding)
    np.testing.assert_allclose(held.score_sums, free.score_sums * share[:, None], rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("estimator", list(Estimator))
def test_a_transition_that_is_not_solved_enters_no_sum(estimator: Estimator) -> None:
    rows = rows_of_kind("impact")
    broken = rows.before.copy()
    broken[3, 8] = np.nan
    edges = np.array([0, len(rows)])
    found = fisher_sums(TRUE, CUBE, broken, rows.after, DT, edges, estimator)
    kept = np.arange(len(rows)) != 3
    rest = fisher_sums(TRUE, CUBE, rows.before[kept], rows.after[kept], DT, edges - [0, 1], estimator)
    np.testing.assert_allclose(found.fishers, rest.fishers, rtol=1e-9, atol=1e-12)
    assert (found.status != 0).sum() == 1


def test_flight_carries_no_information() -> None:
    rows, impacts = rows_of_kind("airborne"), rows_of_kind("impact")
    for estimator in Estimator:
        flying, hitting = (np.trace(single_fishers(TRUE, r, estimator, LossConfig()).sum(axis=0)) for r in (rows, impacts))
        assert flying < 1e-3 * hitting


def test_exact_rest_teaches_by_its_expected_information_only() -> None:
    """method.md 6.7: no residual, so no empirical information; yet the touching corners' heights are known."""
    rest = np.array([[0.3, -0.2, 1.0, 1.0, 0, 0, 0, 0, 0, 0, 0, 0, 0]])
    rows = Rows(rest, rest)
    empirical, profile = (single_fishers(TRUE, rows, estimator, LossConfig())[0] for estimator in Estimator)
    assert np.trace(empirical) < 1e-6
    touching = np.flatnonzero(TRUE.vertices_normal[:, 2] < 0)
    heights = np.diag(profile)[3 * touching + 2]
    assert heights.min() > 1e-3
    assert np.diag(profile)[HEIGHT] > heights.min()
    above = np.flatnonzero(TRUE.vertices_normal[:, 2] > 0)
    assert np.diag(profile)[3 * above + 2].max() < 1e-3 * heights.min()


def test_edges_that_do_not_cover_the_rows_are_refused() -> None:
    rows = rows_of_kind("impact")
    for edges in ([0, 3], [1, 8], [0, 5, 4, 8], [0], []):
        with pytest.raises(InvalidValueError) as refused:
            fisher_sums(TRUE, CUBE, rows.before, rows.after, DT, edges, Estimator.EMPIRICAL)
        assert str(refused.value) == f"starts: found {len(edges)} edges, expected rising edges from 0 to {len(rows)}"
    for bound in (0.0, np.nan):
        with pytest.raises(InvalidValueError) as refused:
            fisher_sums(TRUE, CUBE, rows.before, rows.after, DT, [0, 8], Estimator.EMPIRICAL, bound)
        assert str(refused.value) == f"influence_bound: found {bound}, expected a positive number, or inf for none"


def test_a_toss_without_transitions_has_no_information() -> None:
    rows = rows_of_kind("impact")
    sums = fisher_sums(TRUE, CUBE, rows.before, rows.after, DT, [0, 0, len(rows)], Estimator.EMPIRICAL)
    assert not sums.fishers[0].any()
    assert sums.fishers[1].any()


def test_threads_change_nothing_bit_for_bit() -> None:
    rows = tracked_transitions()
    for estimator in Estimator:
        alone, many = (
            fisher_sums(
                TRUE, CUBE, rows.before, rows.after, rows.dt, rows.starts, estimator, config=replace(LossConfig(), threads=n)
            )
            for n in (1, 4)
        )
        np.testing.assert_array_equal(alone.fishers, many.fishers)
