"""The noise of impacts is learned from losses, and fits in the rigid form use it."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.impulse_noise import ImpulseNoise
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.polytope import PolytopeModel, initial_geometry
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import InvalidValueError
from contact_curation.learning.fits.exact_fit import optimum, theta_0
from contact_curation.learning.fits.held_fit import HeldFitConfig, fit_held
from contact_curation.learning.fits.learned_noise import learned_noise
from contact_curation.motion.transitions import Transitions, transitions_of
from test.simulated import RIG_NOISE, simulated_tosses

LOSS = LossConfig(threads=1)


@pytest.mark.parametrize("true", [ImpulseNoise(1.0, 2.0), ImpulseNoise(8.0, 1.2)])
def test_the_noise_that_made_the_losses_is_found(true: ImpulseNoise) -> None:
    rng = np.random.default_rng(0)
    impulses = np.concatenate([np.ones(8000), rng.uniform(1.0, 20.0, 2000)])
    losses = 0.002 * true.exact_variances(impulses) * rng.chisquare(6, len(impulses)) / 6.0
    found = learned_noise(losses, impulses)
    at = np.array([2.0, 5.0, 10.0, 20.0])
    np.testing.assert_allclose(found.exact_variances(at), true.exact_variances(at), rtol=0.15)


def test_losses_that_do_not_grow_with_impacts_have_one_variance() -> None:
    rng = np.random.default_rng(1)
    impulses = rng.uniform(0.0, 20.0, 4000)
    found = learned_noise(0.01 * rng.chisquare(6, 4000), impulses)
    assert found.exact_variances(np.array([10.0]))[0] < 1.2
    assert learned_noise(np.ones(5), np.ones(5)) == ImpulseNoise(0.0)  # no impact among them
    assert learned_noise(np.zeros(5), np.full(5, 9.0)) == ImpulseNoise(0.0)


def test_losses_that_do_not_fit_the_impulses_are_refused() -> None:
    for losses in (np.ones(3), np.ones(0)):
        with pytest.raises(InvalidValueError, match="losses and impulses"):
            learned_noise(losses, np.ones(4) if losses.size else losses)


@pytest.fixture(scope="module")
def data() -> Transitions:
    return transitions_of(simulated_tosses(6, 2, RIG_NOISE), CONTACTNETS_CUBE.length_scale)


def start(form: Form) -> PolytopeModel:
    geometry = initial_geometry(CONTACTNETS_CUBE, form, np.zeros(3), np.random.default_rng(4), noise=0.1)
    return theta_0(PolytopeModel(geometry, CONTACTNETS_CUBE, form))


def test_an_exact_fit_in_the_rigid_form_learns_one_set_of_vertices_and_its_noise(data: Transitions) -> None:
    rigid, begin = optimum(start(Form.RIGID), data, LOSS, 0.0).model, start(Form.RIGID)
    geometry = rigid.geometry()
    assert rigid.form is Form.RIGID
    assert not rigid.has_own_friction_vertices
    np.testing.assert_array_equal(geometry.vertices_normal, geometry.vertices_tangent)
    assert geometry.noise is not None
    assert geometry.noise != begin.geometry().noise
    assert geometry.noise.growth > 0.0  # a tracker's filter spreads impacts over frames
    off = [
        np.linalg.norm(each.geometry().vertices_normal - CONTACTNETS_CUBE.scaled_vertices, axis=1) for each in (begin, rigid)
    ]
    nearest = [np.sort(each)[:3].mean() for each in off]  # not all of them touched the board
    assert nearest[1] < 0.5 * nearest[0]
    assert abs(np.linalg.norm(geometry.tangents[0]) - CONTACTNETS_CUBE.friction) < 0.01


def test_a_fit_is_made_again_with_the_same_digits_and_without_renewals_counts_all_alike(data: Transitions) -> None:
    config = HeldFitConfig(loss=LOSS, steps=8)
    again = [fit_held(start(Form.RIGID), data, config).model.geometry() for _ in range(2)]
    assert again[0].vertices_normal.tobytes() == again[1].vertices_normal.tobytes()
    assert again[0].noise == again[1].noise
    uniform = fit_held(start(Form.RIGID), data, replace(config, renewals=0)).model.geometry()
    assert uniform.noise == start(Form.RIGID).geometry().noise
    assert np.abs(uniform.vertices_normal - again[0].vertices_normal).max() > 1e-4
