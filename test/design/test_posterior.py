"""Thetas that tosses leave open: about theta, as far as the tosses' fits scatter, the same for the same tosses and seed."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.contact.geometry_parameters import INITIAL_NOISE
from contact_curation.design.execution_noise import balanced_draws
from contact_curation.design.planner import STATED, Planner
from contact_curation.design.posterior import posterior_draws
from contact_curation.design.predicted_information import Particle, predicted_information, predicted_motions
from contact_curation.design.releases import Releases
from contact_curation.geometry.quaternions import Array
from contact_curation.information.record import TossInformation
from contact_curation.learning.fits.polytope_sums import physical_difference
from test.design.cases import CUBE, PARTICLE, SMALL, TRUE, releases
from test.simulated import simulated_tosses

FORM = PARTICLE.scorer.form


@pytest.fixture(scope="module")
def infos() -> list[TossInformation]:
    found = PARTICLE.scorer.score(simulated_tosses(24, seed=2))
    return [info for info in found if isinstance(info, TossInformation)]


def steps(known: list[TossInformation], count: int = 200) -> Array:
    """(count, P) from theta to the draws."""
    drawn = posterior_draws(PARTICLE, known, count, 0)
    return np.array([physical_difference(geometry, PARTICLE.geometry) for geometry in drawn])


def test_draws_are_mirrored_and_the_same_for_the_same_seed(infos: list[TossInformation]) -> None:
    found = steps(infos, 8)
    np.testing.assert_allclose(found[0::2], -found[1::2], rtol=0.05, atol=1e-6)  # the tilt to first order
    np.testing.assert_array_equal(found, steps(infos, 8))
    other = posterior_draws(PARTICLE, infos, 8, 1)
    assert np.abs(other[0].vertices_normal - (PARTICLE.geometry.vertices_normal + found[0, :24].reshape(8, 3))).max() > 1e-4


def test_four_times_the_tosses_leave_half_open(infos: list[TossInformation]) -> None:
    few, many = (np.sqrt((steps(known) ** 2).mean(axis=0)) for known in (infos, 4 * infos))
    measured = few < 0.2 * INITIAL_NOISE
    assert measured.sum() > 0.6 * FORM.size
    np.testing.assert_allclose(few[measured] / many[measured], 2.0, rtol=0.15)


def test_louder_scores_leave_more_open(infos: list[TossInformation]) -> None:
    loud = [replace(info, score_sum=3.0 * info.score_sum) for info in infos]
    measured = np.sqrt((steps(infos) ** 2).mean(axis=0)) < 0.05 * INITIAL_NOISE
    ratio = np.sqrt((steps(loud) ** 2).mean(axis=0))[measured] / np.sqrt((steps(infos) ** 2).mean(axis=0))[measured]
    assert np.median(ratio) == pytest.approx(3.0, rel=0.01)
    assert ratio.min() > 2.5


def test_what_no_toss_tells_of_is_as_open_as_before(infos: list[TossInformation]) -> None:
    blind = []
    for info in infos:
        factor, score = np.array(info.factor), np.array(info.score_sum)
        factor[:, 0], score[0] = 0.0, 0.0
        blind.append(replace(info, factor=factor, score_sum=score))
    assert steps(blind, 2000)[:, 0].std() == pytest.approx(INITIAL_NOISE, rel=0.06)


def test_few_tosses_and_thetas_without_a_physical_form_are_taken_as_they_are(infos: list[TossInformation]) -> None:
    assert posterior_draws(PARTICLE, infos[:3], 8, 0) == ()
    assert len(posterior_draws(PARTICLE, infos[:4], 8, 0)) == 8
    published = replace(TRUE, normal=1.01 * TRUE.normal)
    assert posterior_draws(Particle(published, CUBE), infos, 8, 0) == ()


def test_a_gain_is_stated_at_theta_for_motions_of_thetas_that_are_left_open(infos: list[TossInformation]) -> None:
    planner, config = Planner([PARTICLE], config=SMALL), SMALL.candidates
    few = Releases.of_states(releases(3))
    found = planner.with_known([infos]).forecast(few)
    drawn = posterior_draws(PARTICLE, infos, STATED, config.seed + 1)
    draws = balanced_draws(STATED, np.random.default_rng(config.seed + 1))
    states = planner.evaluator.noise.executions(found.states, draws)
    for execution in (0, 1, STATED - 1):
        moving = Particle(drawn[execution], CUBE, PARTICLE.loss)
        motions = predicted_motions(moving, states[:, execution], config.forecast)
        expected = predicted_information(PARTICLE, motions, config.forecast).fishers
        np.testing.assert_array_equal(found.fishers[0][:, execution], expected)
    assert not np.array_equal(found.fishers[0], planner.forecast(few).fishers[0])
    np.testing.assert_array_equal(planner.with_known([infos[:3]]).forecast(few).fishers[0], planner.forecast(few).fishers[0])


def test_what_is_left_open_changes_what_is_said_of_throws_and_not_which_are_chosen(infos: list[TossInformation]) -> None:
    planner = Planner([PARTICLE], config=SMALL)
    known = planner.known([infos])
    bare, informed = (one.plan(["a", "b"], known, 1).throws for one in (planner, planner.with_known([infos])))
    assert {throw.release.tobytes() for throw in bare} == {throw.release.tobytes() for throw in informed}
    assert {throw.expected_information for throw in bare} != {throw.expected_information for throw in informed}


def test_copies_of_a_toss_and_tosses_without_information_leave_thetas_that_are_finite(infos: list[TossInformation]) -> None:
    blind = replace(infos[0], factor=np.zeros_like(infos[0].factor), score_sum=np.zeros(FORM.size))
    assert np.isfinite(steps([infos[0]] * 5)).all()
    assert steps([blind] * 5, 2000).std() == pytest.approx(INITIAL_NOISE, rel=0.02)
