"""Damped Gauss-Newton steps: where they arrive, what they refuse, and that the two fits made of them end where they did."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.polytope import PolytopeModel, initial_geometry
from contact_curation.contact.parameter_form import Form
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.fits.damped_descent import DescentLimits, Iterate, descend
from contact_curation.learning.fits.held_fit import HeldFitConfig, fit_held
from contact_curation.learning.fits.polytope_fit import FitConfig, fit_polytope
from contact_curation.learning.fits.polytope_sums import physical_difference
from contact_curation.motion.transitions import transitions_of
from test.simulated import simulated_tosses

LIMITS = DescentLimits(tolerance=1e-6, steps=50, damping=1.0, largest_damping=1e6)
STIFFNESS = np.geomspace(1.0, 100.0, 52)


def initial(seed: int) -> PolytopeModel:
    geometry = initial_geometry(CONTACTNETS_CUBE, Form.PHYSICAL, np.zeros(3), np.random.default_rng(seed), 0.4)
    level = replace(geometry, normal=np.array([0.0, 0.0, 1.0]), tangents=0.2 * np.eye(2, 3), height=0.05)
    return PolytopeModel(level, CONTACTNETS_CUBE, Form.PHYSICAL)


START, WANTED = initial(1), initial(2)


def from_wanted(model: PolytopeModel) -> Array:
    return physical_difference(model.geometry(), WANTED.geometry())


def bowl(model: PolytopeModel) -> Iterate:
    """Squares of what is missing to WANTED, and one that no parameter lowers."""
    away = from_wanted(model)
    return Iterate(model, 1.0 + float(STIFFNESS @ away**2), -STIFFNESS * away, np.diag(STIFFNESS))


def test_steps_arrive_at_the_bottom_and_leave_their_start_alone() -> None:
    before = START.geometry().vertices_normal.copy()
    found = descend(START, bowl, LIMITS)
    assert found.arrived
    assert found.iterate.objective == pytest.approx(1.0, abs=1e-5)
    assert np.abs(from_wanted(found.iterate.model)).max() < 3e-3
    np.testing.assert_array_equal(START.geometry().vertices_normal, before)


def test_the_first_step_is_as_short_as_the_damping_makes_it() -> None:
    once = descend(START, bowl, replace(LIMITS, steps=1, damping=3.0))
    assert (once.steps, once.arrived) == (1, False)
    np.testing.assert_allclose(from_wanted(once.iterate.model), 0.75 * from_wanted(START), atol=1e-12)


def test_a_step_that_raises_the_sum_is_not_taken_and_the_next_ones_are_shorter() -> None:
    tried: list[float] = []

    def a_slope_that_lies(model: PolytopeModel) -> Iterate:
        iterate = bowl(model)
        tried.append(float(np.linalg.norm(physical_difference(model.geometry(), START.geometry()))))
        return iterate._replace(score=-iterate.score)

    found = descend(START, a_slope_that_lies, replace(LIMITS, largest_damping=100.0))
    assert found.arrived  # no step leads down, however short
    assert found.iterate.objective == bowl(START).objective
    whole = np.linalg.norm(from_wanted(START))
    np.testing.assert_allclose(tried[1:], [whole / (1.0 + 4.0**k) for k in range(5)], rtol=1e-3)


def test_a_lower_sum_that_leaves_out_more_is_none() -> None:
    found = descend(START, lambda model: bowl(model)._replace(not_solved=int(model is not START)), LIMITS)
    assert (found.iterate.model, found.arrived) == (START, False)


def test_a_parameter_that_nothing_measures_stays_where_the_floor_holds_it() -> None:
    measured = np.where(np.arange(52) < 40, STIFFNESS, 0.0)

    def blind(model: PolytopeModel) -> Iterate:
        away = from_wanted(model)
        return Iterate(model, 1.0 + float(measured @ away**2), -measured * away, np.diag(measured))

    with pytest.raises(np.linalg.LinAlgError):
        descend(START, blind, LIMITS)
    found = descend(START, blind, replace(LIMITS, floor=1e-12))
    np.testing.assert_allclose(from_wanted(found.iterate.model)[40:], from_wanted(START)[40:], atol=1e-12)
    assert np.abs(from_wanted(found.iterate.model)[:40]).max() < 3e-3


def test_both_fits_end_where_they_did_when_each_had_steps_of_its_own() -> None:
    """Found before there was one loop for both; a change in the last digits is another CPU's, one in the sixth is a change."""
    data = transitions_of(simulated_tosses(3, seed=2), CONTACTNETS_CUBE.length_scale)
    held = fit_held(initial(4), data, HeldFitConfig(loss=LossConfig(threads=1)))
    assert held.steps == 10
    assert held.objective == pytest.approx(0.6392521910512255, rel=1e-6)
    np.testing.assert_allclose(
        held.model.geometry().vertices_normal[0], [-1.0011608327247759, -1.0475373293135593, 1.4525035203023984], rtol=1e-6
    )
    exact = fit_polytope(initial(6), data, FitConfig(LossConfig(threads=1), largest_damping=1e-2), [1.0, 2.0, 0.0])
    assert exact.steps == 7
    assert exact.loss == pytest.approx(1.2212068035760044, rel=1e-6)
    np.testing.assert_allclose(
        exact.model.geometry().vertices_normal[0], [-1.0265342772848758, 0.22403863910934296, -1.9774894856187677], rtol=1e-6
    )
