"""Refits of subsets: the minimum that the slow fit finds, its gradient gone, and the Hessian that the gradients have."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.impulse_noise import ImpulseNoise
from contact_curation.contact.models.polytope import FRICTIONS, PolytopeModel, initial_geometry
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import InvalidValueError
from contact_curation.information.impacts import merged_impacts
from contact_curation.learning.fits.damped_descent import DescentLimits, descend
from contact_curation.learning.fits.held_fit import HeldFitConfig, HeldSum
from contact_curation.learning.fits.polytope_sums import moved, physical_difference
from contact_curation.learning.fits.refits import RefitConfig, RefitPool, _point, _within_bounds, subset
from contact_curation.motion.transitions import transitions_of
from test.simulated import RIG_NOISE, simulated_tosses

ONCE = HeldFitConfig(renewals=1, noise=(0.06,))


def theta_0(form: Form = Form.RIGID) -> PolytopeModel:
    geometry = initial_geometry(CONTACTNETS_CUBE, Form.PHYSICAL, np.zeros(3), np.random.default_rng(0), 0.03)
    level = replace(geometry, normal=np.array([0.0, 0.0, 1.0]), tangents=0.2 * np.eye(2, 3), height=0.0)
    if form is Form.RIGID:
        level = replace(level, vertices_tangent=level.vertices_normal, noise=ImpulseNoise())
    return PolytopeModel(level, CONTACTNETS_CUBE, form)


@pytest.fixture(scope="module")
def pool() -> RefitPool:
    data = transitions_of(simulated_tosses(4, seed=2, noise=RIG_NOISE), CONTACTNETS_CUBE.length_scale)
    return RefitPool.of(theta_0(), data, RefitConfig(ONCE, tolerance=1e-7))


def test_a_refit_is_the_minimum_that_damped_steps_find_of_the_same_sum(pool: RefitPool) -> None:
    chosen = np.array([0, 2, 3])
    found = pool.refit(chosen)
    assert found.converged
    slow = descend(found.model, found.held.iterate, DescentLimits(1e-12, 40, 1e-3, 1e6)).iterate
    assert found.objective == pytest.approx(found.held.iterate(found.model).objective, rel=1e-9)
    assert found.objective == pytest.approx(slow.objective, rel=1e-3)
    way = physical_difference(slow.model.geometry(), found.model.geometry())
    assert np.abs(way[:-3]).max() < 0.02


def test_the_hessian_is_the_slope_of_the_scores_and_near_gauss_newtons(pool: RefitPool) -> None:
    hessian = pool.hessian()
    whole = pool.sums.fishers.sum(axis=0)
    known = np.diagonal(whole) > 1e-3 * np.diagonal(whole).max()
    ratios = (np.diagonal(hessian) / np.diagonal(whole))[:-3][known[:-3]]  # the prior holds the tilt
    assert ((ratios > 0.3) & (ratios < 3.0)).all()
    np.testing.assert_allclose(pool.hessian(2e-4), hessian, atol=0.05 * np.abs(hessian).max())


@pytest.mark.parametrize(("step", "friction"), [(-1e4, FRICTIONS[0]), (1e4, FRICTIONS[1]), (15.0, FRICTIONS[1])])
def test_no_step_leads_to_a_friction_without_a_model(pool: RefitPool, step: float, friction: float) -> None:
    steps = np.zeros(pool.sums.scores.shape[1])
    steps[-4], steps[-3:-1] = step, 0.1
    there = moved(pool.model, steps)
    assert np.linalg.norm(there.geometry().tangents[0]) == pytest.approx(friction)
    assert np.isfinite(pool.refit(np.array([0, 1])).held.iterate(there).objective)


def test_a_refit_from_a_friction_at_the_bottom_comes_back(pool: RefitPool) -> None:
    steps = np.zeros(pool.sums.scores.shape[1])
    steps[-4] = -30.0
    chosen = np.array([0, 2, 3])
    found = replace(pool, model=moved(pool.model, steps)).refit(chosen)
    assert FRICTIONS[0] <= np.linalg.norm(found.model.geometry().tangents[0]) <= FRICTIONS[1]
    assert found.objective < 1.01 * pool.refit(chosen).objective  # of this minimum or a lower one


def test_a_subset_has_the_transitions_of_its_tosses(pool: RefitPool) -> None:
    data, rows = subset(pool.data, np.array([1, 3]))
    assert data.toss_ids == (pool.data.toss_ids[1], pool.data.toss_ids[3])
    np.testing.assert_array_equal(np.unique(pool.data.toss_index[rows]), [1, 3])
    np.testing.assert_array_equal(data.before, pool.data.before[rows])
    assert np.diff(data.starts).tolist() == np.diff(pool.data.starts)[[1, 3]].tolist()


@pytest.mark.parametrize(("form", "renewals"), [(Form.PHYSICAL, 2), (Form.RIGID, 0)])
def test_models_without_a_learned_noise_are_refused(form: Form, renewals: int) -> None:
    data = transitions_of(simulated_tosses(1, seed=2), CONTACTNETS_CUBE.length_scale)
    with pytest.raises(InvalidValueError, match="model to refit"):
        RefitPool.of(theta_0(form), data, RefitConfig(HeldFitConfig(renewals=renewals)))


@pytest.mark.slow
def test_refits_learn_a_restitution_with_equal_variances_as_the_fit_to_the_pool_does() -> None:
    """And one at its bound ends no refit: tosses that do not bounce may pull it below 0."""
    geometry = replace(ContactGeometry.of_body(CONTACTNETS_CUBE).rigid(), restitution=0.3)
    for tosses, expected in ((simulated_tosses(4, 1, geometry=geometry), 0.3), (simulated_tosses(4, 2), 0.0)):
        data = merged_impacts(transitions_of(tosses, CONTACTNETS_CUBE.length_scale), CONTACTNETS_CUBE)
        pool = RefitPool.of(theta_0().bouncing(), data, RefitConfig(ONCE, tolerance=1e-4))
        found = pool.refit(np.array([0, 1, 2, 3]))
        assert found.converged
        assert found.model.geometry().restitution == pytest.approx(expected, abs=0.1)
        assert found.model.geometry().restitution == pytest.approx(pool.model.geometry().restitution, abs=0.02)


def test_a_direction_leaves_a_restitution_that_may_not_move() -> None:
    data = transitions_of(simulated_tosses(1, 2), CONTACTNETS_CUBE.length_scale)
    model = theta_0().bouncing()
    point = _point(HeldSum(data, np.ones(1), ONCE, model.geometry(), 0.06, restitution_held=True), model)
    direction = _within_bounds(point, np.ones(len(point.score)))
    assert np.flatnonzero(direction == 0.0).tolist() == [24]
    free = _point(HeldSum(data, np.ones(1), ONCE, model.geometry(), 0.06), model)
    assert _within_bounds(free, np.ones(len(free.score))).all()
