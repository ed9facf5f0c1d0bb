"""Tosses of a known body, rolled out by our own time step, give its shape and friction back from a random initialisation."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form
from contact_curation.learning.training.protocols import TrainingConfig, budgeted
from contact_curation.learning.training.training import new_training
from contact_curation.motion.transitions import transitions_of
from test.contact.cases import CUBE
from test.simulated import RIG_NOISE, TrackerNoise, simulated_tosses

MILLIMETRE = 1e-3 / CUBE.length_scale
OURS = budgeted("polytope")
QUICK = replace(OURS, steps=800, batch=64)


def learned(noise: TrackerNoise | None, config: TrainingConfig, seed: int, tosses: int = 24) -> ContactGeometry:
    data = transitions_of(simulated_tosses(tosses, seed=5, noise=noise), CUBE.length_scale)
    training = new_training("polytope", CUBE, data, None, config, seed)
    training.advance(config.steps or 1)
    assert isinstance(training.model, PolytopeModel)
    return training.model.geometry()


def friction(geometry: ContactGeometry) -> float:
    return float(np.linalg.norm(geometry.tangents, axis=1).mean())


def worst_miss(vertices: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> float:
    """Largest distance of a vertex from its true place."""
    return float(np.linalg.norm(vertices - CUBE.scaled_vertices, axis=1).max())


@pytest.mark.parametrize(
    "noise", [pytest.param(None, id="exact", marks=pytest.mark.slow), pytest.param(RIG_NOISE, id="tracked")]
)
@pytest.mark.slow
def test_a_body_is_recovered_within_a_millimetre_and_a_hundredth_of_friction(noise: TrackerNoise | None) -> None:
    found = learned(noise, QUICK, seed=1)
    assert worst_miss(found.vertices_normal) < MILLIMETRE
    assert abs(friction(found) - CUBE.friction) < 0.01


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("noise", [None, RIG_NOISE], ids=["exact", "tracked"])
def test_every_initialisation_leads_there(noise: TrackerNoise | None, seed: int) -> None:
    found = learned(noise, OURS, seed)
    assert worst_miss(found.vertices_normal) < MILLIMETRE
    assert abs(friction(found) - CUBE.friction) < 0.01


@pytest.mark.slow
def test_the_published_parameters_are_recovered_too() -> None:
    found = learned(None, replace(OURS, form=Form.CONTACTNETS), seed=1)
    assert worst_miss(found.vertices_normal) < MILLIMETRE
    assert abs(friction(found) - CUBE.friction) < 0.01
    np.testing.assert_allclose(found.normal, [0.0, 0.0, 1.0], atol=1e-3)


@pytest.mark.slow
def test_exact_motions_give_the_vertices_that_rub_as_well() -> None:
    found = learned(None, replace(OURS, steps=5000), seed=0, tosses=48)
    assert worst_miss(found.vertices_tangent) < MILLIMETRE
