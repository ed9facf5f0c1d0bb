"""Tasks for a learned model: to come to rest on a face near a mark."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.design.execution_noise import ExecutionNoise, NoiseConfig
from contact_curation.design.releases import published_releases
from contact_curation.experiments.thrown.landing import Thrower, successes
from contact_curation.simulation.thrown_toss import ThrownTossConfig

TRUE = ContactGeometry.of_body(CONTACTNETS_CUBE)
NOISE = ExecutionNoise.expected(NoiseConfig(0.0005, 0.003, 0.002, 0.002, 0.03))
RELEASES = published_releases(192, np.random.default_rng(3))
THROWER = Thrower(CONTACTNETS_CUBE, RELEASES, NOISE, ThrownTossConfig(longest=1.5))


def test_a_rest_is_told_by_the_face_below_however_the_body_is_turned_about_the_vertical() -> None:
    state = np.array([0.1, 0.2, 0.05, 1.0, 0.0, 0.0, 0.0, *[0.0] * 6])
    turned = state.copy()
    turned[3:7] = np.cos(0.4), 0.0, 0.0, np.sin(0.4)
    over = state.copy()
    over[3:7] = np.cos(0.25 * np.pi), np.sin(0.25 * np.pi), 0.0, 0.0
    faces = [THROWER.rest(one).face for one in (state, turned, over)]
    assert (CONTACTNETS_CUBE.vertices[list(faces[0]), 2] < 0.0).all()
    assert len(faces[0]) == 4
    assert faces[0] == faces[1] != faces[2]
    np.testing.assert_array_equal(THROWER.rest(state).place, [0.1, 0.2])


@pytest.mark.slow
def test_the_true_body_does_more_tasks_than_one_that_slides_farther() -> None:
    slippery = replace(TRUE, tangents=0.2 * TRUE.tangents)
    right, wrong = (successes(geometry, THROWER, 16, 1) for geometry in (TRUE, slippery))
    assert right == successes(TRUE, THROWER, 16, 1)
    assert right > 0.5 > wrong
