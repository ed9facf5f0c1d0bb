"""The fit that holds what is not measured: its slope, its optimum, and vertices that no toss touched."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.models.polytope import PolytopeModel, initial_geometry
from contact_curation.contact.parameter_form import Form, parameter_form
from contact_curation.errors import InvalidValueError
from contact_curation.information.impacts import merged_impacts
from contact_curation.learning.fits.held_fit import HeldFitConfig, HeldSum, fit_held
from contact_curation.learning.fits.polytope_sums import fixed_restitution, moved, physical_difference
from contact_curation.motion.transitions import Transitions, transitions_of
from test.simulated import simulated_tosses

CONFIG = HeldFitConfig()


@pytest.fixture(scope="module")
def data() -> Transitions:
    return transitions_of(simulated_tosses(3, seed=2), CONTACTNETS_CUBE.length_scale)


def initial(seed: int, noise: float = 0.4) -> PolytopeModel:
    geometry = initial_geometry(CONTACTNETS_CUBE, Form.PHYSICAL, np.zeros(3), np.random.default_rng(seed), noise)
    level = replace(geometry, normal=np.array([0.0, 0.0, 1.0]), tangents=0.2 * np.eye(2, 3), height=0.05)
    return PolytopeModel(level, CONTACTNETS_CUBE, Form.PHYSICAL)


def test_the_step_goes_down_the_sum_that_is_said(data: Transitions) -> None:
    """The score is minus half the sum's slope, by central differences; A0 and the ground are in both."""
    model, origin = initial(1, noise=0.05), initial(2, noise=0.05).geometry()
    held = HeldSum(data, np.ones(3), CONFIG, origin, 0.06)
    iterate = held.iterate(model)
    rng = np.random.default_rng(0)
    for _ in range(4):
        step = 1e-6 * rng.standard_normal(iterate.score.size)
        step[-3:-1] *= 1e-3  # the tilt is held so stiffly that it would be all there is
        ahead, behind = (held.iterate(moved(model, sign * step)).objective for sign in (1.0, -1.0))
        assert ahead - behind == pytest.approx(-4.0 * float(iterate.score @ step), rel=1e-3)


def test_the_way_from_one_geometry_to_another_is_the_step_between_them() -> None:
    model = initial(3)
    step = 0.01 * np.random.default_rng(1).standard_normal(52)
    found = physical_difference(moved(model, step).geometry(), model.geometry())
    np.testing.assert_allclose(found[:49], step[:49], atol=1e-12)
    np.testing.assert_allclose(found[49:], step[49:], rtol=2e-3)


def test_what_no_toss_touched_stays_and_what_they_touched_is_found(data: Transitions) -> None:
    start = initial(4)
    found = fit_held(start, data, CONFIG)
    away = np.linalg.norm(physical_difference(found.model.geometry(), start.geometry())[:24].reshape(8, 3), axis=1)
    assert away.max() < 2.0
    corners = CONTACTNETS_CUBE.scaled_vertices
    errors = [np.linalg.norm(each.geometry().vertices_normal - corners, axis=1) for each in (start, found.model)]
    assert np.sort(errors[1])[:2].max() < 0.1
    assert errors[1].mean() < 0.7 * errors[0].mean()
    assert abs(found.model.geometry().height) < 0.02
    np.testing.assert_allclose(found.model.geometry().normal, [0.0, 0.0, 1.0], atol=2e-3)


def test_a_fit_that_goes_on_from_another_ends_where_one_from_the_start_does(data: Transitions) -> None:
    start = initial(5)
    config = replace(CONFIG, tolerance=1e-9, steps=200)
    first = fit_held(start, data, config)
    again = fit_held(first.model, data, config, origin=start)
    assert again.objective == pytest.approx(first.objective, rel=1e-6)
    assert again.steps < first.steps


def test_a_weight_is_a_repetition_and_no_weight_is_an_absence() -> None:
    tosses = simulated_tosses(3, seed=2)
    repeated = transitions_of([tosses[0], tosses[2], tosses[2]], CONTACTNETS_CUBE.length_scale)
    all_of_them, few = transitions_of(tosses, CONTACTNETS_CUBE.length_scale), replace(CONFIG, steps=6)
    one = fit_held(initial(6), all_of_them, few, weights=[1, 0, 2])
    other = fit_held(initial(6), repeated, few)
    assert one.objective == pytest.approx(other.objective, rel=1e-9)
    np.testing.assert_allclose(one.model.geometry().vertices_normal, other.model.geometry().vertices_normal, atol=1e-9)
    with pytest.raises(InvalidValueError, match="weights: found"):
        fit_held(initial(6), all_of_them, few, weights=[1.0, -1.0, 1.0])


def test_a_restitution_is_learned_before_impacts_are_discounted() -> None:
    """With weights it would follow what the model does not explain."""
    tosses = simulated_tosses(8, seed=1, geometry=replace(ContactGeometry.of_body(CONTACTNETS_CUBE).rigid(), restitution=0.3))
    data = merged_impacts(transitions_of(tosses, CONTACTNETS_CUBE.length_scale), CONTACTNETS_CUBE)
    drawn = initial_geometry(CONTACTNETS_CUBE, Form.RIGID, np.zeros(3), np.random.default_rng(5), 0.02)
    start = PolytopeModel(drawn, CONTACTNETS_CUBE, Form.RIGID).bouncing()
    first, last = (fit_held(start, data, replace(CONFIG, renewals=renewals)).model.geometry() for renewals in (0, 2))
    assert first.restitution == last.restitution == pytest.approx(0.3, abs=0.07)
    assert not np.array_equal(first.vertices_normal, last.vertices_normal)


def test_no_step_moves_a_restitution_that_is_held_or_beyond_its_bounds(data: Transitions) -> None:
    drawn = initial_geometry(CONTACTNETS_CUBE, Form.RIGID, np.zeros(3), np.random.default_rng(5), 0.02)
    bounds = {e: PolytopeModel(replace(drawn, restitution=e), CONTACTNETS_CUBE, Form.RIGID) for e in (0.0, 0.5, 1.0)}
    down, up = -np.ones(29), np.ones(29)
    assert [fixed_restitution(model, down, False) for model in bounds.values()] == [24, None, None]
    assert [fixed_restitution(model, up, False) for model in bounds.values()] == [None, None, 24]
    assert fixed_restitution(bounds[0.5], up, True) == 24
    assert fixed_restitution(initial(1), np.ones(52), True) is None
    iterate = HeldSum(data, np.ones(3), CONFIG, bounds[0.5].geometry(), 0.06, restitution_held=True).iterate(bounds[0.5])
    step = np.linalg.solve(iterate.information, iterate.score)
    assert np.flatnonzero(step == 0.0).tolist() == [24]


@pytest.mark.parametrize(("form", "restitution"), [(Form.PHYSICAL, None), (Form.RIGID, None), (Form.RIGID, 0.3)])
def test_a_shape_that_is_known_holds_the_vertices_and_nothing_else(
    data: Transitions, form: Form, restitution: float | None
) -> None:
    geometry = replace(ContactGeometry.of_body(CONTACTNETS_CUBE).rigid(), restitution=restitution)
    parameters = parameter_form(geometry, form).size
    first, last = 24 if form is Form.RIGID else 48, parameters
    wide, known = (
        HeldSum(data, np.ones(3), replace(CONFIG, shape=shape), geometry, 0.06).curvature(parameters) for shape in (None, 0.02)
    )
    assert known[:first] == pytest.approx((CONFIG.spread / 0.02) ** 2 * wide[:first])
    assert known[first:last] == pytest.approx(wide[first:last])


def test_vertices_stay_near_a_shape_that_is_known_while_friction_is_learned(data: Transitions) -> None:
    """Of a shape that is described 0.03 off, and a friction that is twice the true one."""
    off = 0.03 * np.random.default_rng(5).standard_normal((8, 3))
    vertices = CONTACTNETS_CUBE.scaled_vertices + off
    described = replace(
        ContactGeometry.of_body(CONTACTNETS_CUBE), vertices_normal=vertices, vertices_tangent=vertices,
        tangents=2.0 * CONTACTNETS_CUBE.friction * np.eye(2, 3),
    )  # fmt: skip
    start = PolytopeModel(described.rigid(), CONTACTNETS_CUBE, Form.RIGID)
    found = {shape: fit_held(start, data, replace(CONFIG, shape=shape)).model.geometry() for shape in (None, 0.001, 0.03)}
    moves = {shape: np.abs(one.vertices_normal - vertices).max() for shape, one in found.items()}
    assert moves[0.001] < 0.01
    assert moves[0.001] < moves[0.03] < moves[None]
    errors = {shape: np.linalg.norm(one.vertices_normal - CONTACTNETS_CUBE.scaled_vertices) for shape, one in found.items()}
    assert errors[0.03] < np.linalg.norm(off)
    for one in found.values():
        assert np.linalg.norm(one.tangents[0]) == pytest.approx(CONTACTNETS_CUBE.friction, rel=0.1)
