"""Fits of the polytope: a known body is recovered from its simulated tosses, weights are repetitions, steps are exact."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.evaluation import Estimator
from contact_curation.contact.geometry_parameters import UPWARD, ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.model import Rows
from contact_curation.contact.models.polytope import PolytopeModel, initial_geometry
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import InvalidValueError
from contact_curation.learning.fits.polytope_fit import FitConfig, PolytopeFit, fit_polytope
from contact_curation.learning.fits.polytope_sums import moved, polytope_sums
from contact_curation.motion.transitions import Transitions, transitions_of
from test.simulated import RIG_NOISE, TrackerNoise, simulated_tosses

LOSS = LossConfig(threads=1)
CONFIG = FitConfig(loss=LOSS)


def a_body() -> ContactGeometry:
    """No cube: every corner 1.5 mm or so away from one, and another friction."""
    corners = CONTACTNETS_CUBE.scaled_vertices + 0.03 * np.random.default_rng(7).standard_normal((8, 3))
    return ContactGeometry(corners, UPWARD, corners, 0.23 * np.eye(2, 3))


@pytest.fixture(scope="module")
def rows() -> Transitions:
    """With the simulation's own velocities: a tracker's median filter moves impacts, and with them the optimum, by 7 mm."""
    return transitions_of(simulated_tosses(24, 2, geometry=a_body()), CONTACTNETS_CUBE.length_scale)


def start(seed: int, rows: Transitions) -> PolytopeModel:
    pivot = np.array([*rows.before[:, :2].mean(axis=0), 0.0])
    geometry = initial_geometry(CONTACTNETS_CUBE, Form.PHYSICAL, pivot, np.random.default_rng(seed))
    return PolytopeModel(geometry, CONTACTNETS_CUBE, Form.PHYSICAL)


@pytest.fixture(scope="module")
def fit(rows: Transitions) -> PolytopeFit:
    return fit_polytope(start(1, rows), rows, CONFIG)


@pytest.mark.slow
def test_a_known_body_is_recovered_within_a_millimetre_and_a_hundredth_of_friction(fit: PolytopeFit) -> None:
    found, true = fit.model.geometry(), a_body()
    assert fit.converged
    assert fit.not_solved == 0
    distances_mm = 52.4 * np.linalg.norm(found.vertices_normal - true.vertices_normal, axis=1)
    assert distances_mm.max() < 1.0
    assert np.linalg.norm(found.tangents[0]) == pytest.approx(0.23, abs=0.01)
    assert np.degrees(np.arccos(found.normal[2])) < 0.1


@pytest.mark.slow
def test_velocities_through_a_trackers_median_filter_move_the_optimum_by_millimetres() -> None:
    tracked = simulated_tosses(24, 2, TrackerNoise(0.0, 0.0), geometry=a_body())
    rows = transitions_of(tracked, CONTACTNETS_CUBE.length_scale)
    found = fit_polytope(PolytopeModel(a_body(), CONTACTNETS_CUBE, Form.PHYSICAL), rows, CONFIG).model.geometry()
    distances_mm = 52.4 * np.linalg.norm(found.vertices_normal - a_body().vertices_normal, axis=1)
    assert 5.0 < distances_mm.mean() < 10.0  # noise or none: the filter spreads impacts over frames
    assert np.linalg.norm(found.tangents[0]) == pytest.approx(0.23, abs=0.01)


@pytest.mark.slow
def test_the_score_vanishes_where_a_fit_ends_and_the_loss_is_lower_nowhere_near(rows: Transitions, fit: PolytopeFit) -> None:
    sums = polytope_sums(fit.model, rows, Estimator.GAUSS_NEWTON, LOSS)
    information = sums.fishers.sum(axis=0)
    newton = np.linalg.solve(information + 1e-9 * np.eye(52), sums.scores.sum(axis=0))
    assert np.abs(newton).max() < 1e-3
    rng = np.random.default_rng(3)
    for _ in range(5):
        near = moved(fit.model, 0.01 * rng.standard_normal(52))
        assert polytope_sums(near, rows, Estimator.GAUSS_NEWTON, LOSS).losses.sum() > fit.loss


def test_the_score_is_half_the_losses_slope_in_the_coordinates_of_a_move(rows: Transitions) -> None:
    model = start(2, rows)
    score = polytope_sums(model, rows, Estimator.GAUSS_NEWTON, LOSS).scores.sum(axis=0)
    for parameter in (4, 30, 48, 49, 50, 51):
        step = 1e-6 * np.eye(52)[parameter]
        up, down = (polytope_sums(moved(model, s), rows, Estimator.EMPIRICAL, LOSS).losses.sum() for s in (step, -step))
        assert score[parameter] == pytest.approx(-0.5 * (up - down) / 2e-6, rel=1e-4, abs=1e-5)


def test_a_move_leaves_its_model_alone_and_by_nothing_it_is_the_same_geometry(rows: Transitions) -> None:
    model = start(3, rows)
    before = model.geometry()
    assert np.abs(moved(model, np.full(52, 0.1)).geometry().vertices_normal - before.vertices_normal).min() > 0.09
    for name in ("vertices_normal", "normal", "vertices_tangent", "tangents", "pivot"):
        np.testing.assert_array_equal(getattr(model.geometry(), name), getattr(before, name))
        np.testing.assert_allclose(getattr(moved(model, np.zeros(52)).geometry(), name), getattr(before, name), atol=1e-15)


def test_sums_are_those_of_the_model_s_own_loss(rows: Transitions) -> None:
    model = start(4, rows)
    with torch.no_grad():
        losses = model.batch_loss(Rows(rows.before, rows.after, rows.dt), LOSS).losses.numpy()
    sums = polytope_sums(model, rows, Estimator.EMPIRICAL, LOSS)
    np.testing.assert_allclose(sums.losses, np.add.reduceat(losses, rows.starts[:-1]))


def test_a_weight_is_a_repetition_and_no_weight_is_an_absence() -> None:
    tosses = simulated_tosses(8, 4, RIG_NOISE, geometry=a_body())
    rows = transitions_of(tosses, CONTACTNETS_CUBE.length_scale)
    repeated = transitions_of([*tosses[:7], tosses[2], tosses[2]], CONTACTNETS_CUBE.length_scale)
    begin, few = PolytopeModel(a_body(), CONTACTNETS_CUBE, Form.PHYSICAL), replace(CONFIG, max_steps=4)
    one = fit_polytope(begin, rows, few, [1, 1, 3, 1, 1, 1, 1, 0])
    other = fit_polytope(begin, repeated, few)
    assert one.loss == pytest.approx(other.loss, rel=1e-9)
    np.testing.assert_allclose(one.model.geometry().vertices_normal, other.model.geometry().vertices_normal, atol=1e-9)


def test_a_fit_that_runs_out_of_steps_says_so(rows: Transitions) -> None:
    fit = fit_polytope(start(5, rows), rows, replace(CONFIG, max_steps=2))
    assert (fit.converged, fit.steps) == (False, 2)


@pytest.mark.parametrize("weights", [[1.0], [0.0] * 24, [-1.0] + [1.0] * 23, [np.nan] * 24])
def test_weights_that_do_not_fit_are_refused(rows: Transitions, weights: list[float]) -> None:
    with pytest.raises(InvalidValueError, match="weights"):
        fit_polytope(start(6, rows), rows, CONFIG, weights)


def test_a_geometry_without_a_physical_form_is_refused(rows: Transitions) -> None:
    long = replace(a_body(), normal=1.1 * UPWARD)
    with pytest.raises(InvalidValueError, match="physical"):
        fit_polytope(PolytopeModel(long, CONTACTNETS_CUBE, Form.CONTACTNETS), rows, CONFIG)
