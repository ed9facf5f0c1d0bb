"""Predicted information of throws: what the scorer says of the same motions, and never by the empirical matrix."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contact_curation.contact.body import Body
from contact_curation.contact.evaluation import Estimator
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.design.execution_noise import ExecutionNoise, balanced_draws
from contact_curation.design.predicted_information import (
    DEFAULT_PREDICTION,
    Particle,
    information_of_executions,
    predicted_information,
    predicted_motions,
)
from contact_curation.design.readiness import spearman
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.polytopes import box
from contact_curation.geometry.quaternions import Array
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import Scorer, ScoringConfig
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import states_of
from contact_curation.storage.datasets.contactnets import read_contactnets
from test.design.cases import CUBE, LOSS, PARTICLE, TRUE, other_theta, releases
from test.design.test_releases import turned
from test.simulated import RIG_NOISE, length_scales, simulated_tosses, toss_of

EXACT = replace(DEFAULT_PREDICTION, thinning=1, airborne=1e9)


def rolled_out(states: Array) -> list[Toss]:
    """The predicted motions as tosses."""
    motions = predicted_motions(PARTICLE, states)
    cut = [motion[:frames] * length_scales(CUBE) for motion, frames in zip(motions.states, motions.frames)]
    return [toss_of(motion, 1_000_000_000 * (k + 1), CUBE.name) for k, motion in enumerate(cut)]


def traces(infos: object) -> Array:
    assert isinstance(infos, tuple)
    return np.array([info.trace for info in infos if isinstance(info, TossInformation)])


def test_motions_of_a_light_body_are_known() -> None:
    """A die of 4 g: gradients by its impulses are far larger than those of the cube, and so is what rounding leaves of them."""
    half = 0.0075
    inertia = 0.004 * (2.0 * half) ** 2 / 6.0
    die = Body(
        name="die", vertices=box([half] * 3).vertices, mass=0.004, inertia=np.full(3, inertia), length_scale=half, friction=0.3
    )
    particle = Particle(ContactGeometry.of_body(die).rigid(), die, LOSS)
    assert predicted_information(particle, predicted_motions(particle, releases(8))).known.all()


def test_a_forecast_is_what_the_scorer_says_of_the_same_motion() -> None:
    states = releases(3)
    predicted = predicted_information(PARTICLE, predicted_motions(PARTICLE, states, EXACT), EXACT)
    scored = PARTICLE.scorer.score(rolled_out(states))
    assert predicted.known.all()
    for fisher, info in zip(predicted.fishers, scored, strict=True):
        assert isinstance(info, TossInformation)
        assert np.trace(fisher) == pytest.approx(info.trace, rel=1e-6)
        # The record keeps 24 rows of single precision; the strong directions are all there.
        np.testing.assert_allclose(info.fisher(), fisher, atol=2e-3 * np.abs(fisher).max())


def test_leaving_out_the_air_and_thinning_hardly_change_what_throws_would_add() -> None:
    motions = predicted_motions(PARTICLE, releases(24))
    whole = predicted_information(PARTICLE, motions, EXACT).fishers
    short = predicted_information(PARTICLE, motions).fishers
    known = whole[:6].sum(axis=0) + 1e-3 * whole.mean(axis=0) + 1e-6 * np.trace(whole.mean(axis=0)) * np.eye(whole.shape[1])

    def gains(fishers: Array) -> Array:
        return np.asarray(np.linalg.slogdet(known + fishers)[1] - np.linalg.slogdet(known)[1])

    assert spearman(gains(whole), gains(short)) > 0.97
    np.testing.assert_allclose(np.trace(short, axis1=1, axis2=2), np.trace(whole, axis1=1, axis2=2), rtol=0.25)


def test_neither_place_nor_heading_of_a_throw_changes_its_information() -> None:
    states = releases(4)
    here, there = (
        predicted_information(PARTICLE, predicted_motions(PARTICLE, one, EXACT), EXACT).fishers
        for one in (states, turned(states, 1.2, (0.5, -0.4)))
    )
    form = PARTICLE.scorer.form
    tilt = next(block for block in PARTICLE.scorer.blocks if block.name == "tilt")
    rotation = np.eye(form.size)
    rotation[tilt.start : tilt.stop, tilt.start : tilt.stop] = [[np.cos(1.2), -np.sin(1.2)], [np.sin(1.2), np.cos(1.2)]]
    size = np.abs(here).max()
    np.testing.assert_allclose(np.trace(there, axis1=1, axis2=2), np.trace(here, axis1=1, axis2=2), rtol=1e-3)
    both = np.minimum(
        np.abs(rotation @ here @ rotation.T - there).max(axis=(1, 2)),
        np.abs(rotation.T @ here @ rotation - there).max(axis=(1, 2)),
    )
    assert (both < 1e-3 * size).all()


def test_an_execution_that_cannot_be_followed_has_the_mean_of_the_throws_others() -> None:
    executed = ExecutionNoise.expected().executions(releases(3), balanced_draws(4, np.random.default_rng(0)))
    executed[1, 2, 7], executed[2, :3, 7] = 1e200, 1e200
    motions = predicted_motions(PARTICLE, executed.reshape(-1, 13))
    found = information_of_executions(PARTICLE, motions, 4)
    apart = predicted_information(PARTICLE, motions).fishers.reshape(found.fishers.shape)
    assert found.known.tolist() == [True, True, False]
    np.testing.assert_array_equal(found.fishers[0], apart[0])
    np.testing.assert_allclose(found.fishers[1, 2], apart[1, [0, 1, 3]].mean(axis=0), rtol=1e-12)


def test_a_release_that_the_model_cannot_follow_is_not_known_and_leaves_the_others_alone() -> None:
    states = releases(3)
    alone = predicted_information(PARTICLE, predicted_motions(PARTICLE, states[[0, 2]]))
    states[1, 7] = 1e200
    among = predicted_information(PARTICLE, predicted_motions(PARTICLE, states))
    assert among.known.tolist() == [True, False, True]
    assert not among.fishers[1].any()
    np.testing.assert_allclose(among.fishers[[0, 2]], alone.fishers, rtol=1e-12)


def test_a_theta_of_the_published_form_has_a_forecast_too() -> None:
    particle = Particle(replace(TRUE, normal=np.array([0.0, 0.0, 1.1])), CUBE, LOSS)
    predicted = predicted_information(particle, predicted_motions(particle, releases(2)))
    assert predicted.known.all()
    assert predicted.fishers.shape == (2, 57, 57)


def test_of_its_own_motions_the_empirical_matrix_knows_nothing_while_gauss_newtons_ranks_them_as_measured_ones() -> None:
    """method.md check 8, on tosses of another cube that a tracker saw."""
    tosses = simulated_tosses(24, seed=4, noise=RIG_NOISE, geometry=other_theta(1.08, 0.25).geometry)
    own = rolled_out(np.array([states_of(toss, 1.0)[0] for toss in tosses]))
    scorers = {kind: Scorer(TRUE, CUBE, ScoringConfig(estimator=kind, loss=LOSS)) for kind in Estimator}
    measured = {kind: traces(scorer.score(tosses)) for kind, scorer in scorers.items()}
    predicted = {kind: traces(scorer.score(own)) for kind, scorer in scorers.items()}
    assert predicted[Estimator.EMPIRICAL].sum() < 0.01 * measured[Estimator.EMPIRICAL].sum()
    assert spearman(predicted[Estimator.GAUSS_NEWTON], measured[Estimator.GAUSS_NEWTON]) > 0.35


def test_check_8_on_real_tosses(contactnets_folder: Path) -> None:
    files = [contactnets_folder / f"{number}.pt" for number in range(0, 400, 5)]
    tosses = [toss for file in files for toss in read_contactnets(file, CUBE) if isinstance(toss, Toss)]
    own = rolled_out(np.array([states_of(toss, 1.0)[0] for toss in tosses]))
    correlation = {}
    for kind in Estimator:
        scorer = Scorer(TRUE, CUBE, ScoringConfig(estimator=kind, loss=LOSS))
        measured, predicted = traces(scorer.score(tosses)), traces(scorer.score(own))
        correlation[kind] = spearman(predicted, measured)
        if kind is Estimator.EMPIRICAL:
            assert predicted.sum() < 0.01 * measured.sum()
    assert abs(correlation[Estimator.EMPIRICAL]) < 0.25
    assert correlation[Estimator.GAUSS_NEWTON] > 0.35


@pytest.mark.parametrize(("name", "value"), [("executions", 3), ("thinning", 0), ("longest", 0.001), ("touching", 0.0)])
def test_settings_that_make_no_sense_are_refused(name: str, value: float) -> None:
    with pytest.raises(InvalidValueError, match=f"forecast.{name}"):
        replace(DEFAULT_PREDICTION, **{name: value})  # type: ignore[arg-type]
