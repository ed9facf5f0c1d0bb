"""The noise of impacts: its variances, the weighted sums against plain ones, the rigid form, and how a theta carries both."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.evaluation import (
    Estimator,
    evaluate,
    fisher_sums,
    predicted_impulses,
    transition_weights,
)
from contact_curation.contact.geometry_parameters import UPWARD, ContactGeometry
from contact_curation.contact.impulse_noise import STEPS_PER_OCTAVE, ImpulseNoise
from contact_curation.contact.loss_config import GAPS, PENETRATION, SLIP, LossConfig
from contact_curation.contact.parameter_form import Form, form_of_geometry, parameter_form
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.scoring import Scorer, ScoringConfig, parameters_version
from contact_curation.learning.checkpoints.theta_bytes import bytes_of_geometry, geometry_of_bytes
from contact_curation.motion.transitions import Transitions, transitions_of
from test.simulated import simulated_tosses

LOSS = LossConfig(threads=1)
BODY = CONTACTNETS_CUBE


def a_theta(noise: ImpulseNoise | None) -> ContactGeometry:
    corners = BODY.scaled_vertices + 0.02 * np.random.default_rng(3).standard_normal((8, 3))
    return ContactGeometry(corners, UPWARD, corners, 0.2 * np.eye(2, 3), noise=noise)


@pytest.fixture(scope="module")
def data() -> Transitions:
    return transitions_of(simulated_tosses(3, seed=5), BODY.length_scale)


@pytest.mark.parametrize("mass", [0.004, 0.05, 20.0])
def test_a_declared_mass_changes_no_loss_and_no_score_of_a_balanced_loss(data: Transitions, mass: float) -> None:
    def of(value: float, geometry: ContactGeometry, balanced: bool = True) -> tuple[Any, ...]:
        body = replace(BODY, mass=value, inertia=BODY.inertia * value / BODY.mass)
        found = evaluate(geometry, body, data.before, data.after, data.dt, replace(LOSS, balanced=balanced))
        assert found.solved.all()
        return found.terms, found.scores, found.impulses / value

    rigid = a_theta(ImpulseNoise())
    for found, expected in zip(of(mass, rigid), of(BODY.mass, rigid)):
        np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-7 * np.abs(expected).max())
    assert not np.allclose(of(mass, rigid, balanced=False)[0], of(BODY.mass, rigid, balanced=False)[0])
    assert not np.allclose(of(mass, a_theta(None))[0], of(BODY.mass, a_theta(None))[0])


def test_the_balanced_loss_of_the_cube_has_the_published_weights_times_those_that_it_says(data: Transitions) -> None:
    loss = LossConfig(threads=1)
    said = replace(
        loss, balanced=False, complementarity_normal=GAPS * loss.complementarity_normal,
        complementarity_tangent=GAPS * loss.complementarity_tangent, dissipation=SLIP * loss.dissipation,
        penetration=PENETRATION * loss.penetration, regularization=GAPS * loss.regularization,
    )  # fmt: skip
    for geometry, expected in ((a_theta(ImpulseNoise()), said), (a_theta(None), replace(loss, balanced=False))):
        found = evaluate(geometry, BODY, data.before, data.after, data.dt, loss)
        np.testing.assert_allclose(found.terms, evaluate(geometry, BODY, data.before, data.after, data.dt, expected).terms)


@pytest.mark.parametrize(("friction", "share"), [(0.0, 1.0), (0.3, 1.0), (0.6, 0.5), (1.2, 0.25)])
def test_slip_counts_less_for_a_body_that_is_described_with_much_friction(friction: float, share: float) -> None:
    loss, body = LossConfig(), replace(BODY, friction=friction)
    assert loss.for_theta(body, rigid=True).dissipation == pytest.approx(share * loss.for_theta(BODY, rigid=True).dissipation)
    assert loss.for_theta(body, rigid=False) is loss


def sums(geometry: ContactGeometry, data: Transitions, estimator: Estimator, weights: Array | None = None) -> tuple[Any, ...]:
    found = fisher_sums(geometry, BODY, data.before, data.after, data.dt, data.starts, estimator, config=LOSS, weights=weights)
    return found.fishers, found.score_sums, found.losses, found.residuals, found.status


def test_the_variance_is_one_up_to_rest_and_grows_with_a_power_of_what_is_above() -> None:
    noise = ImpulseNoise(growth=2.0, power=1.5)
    assert noise.variances([-1.0, 0.0, 1.0]).tolist() == [1.0, 1.0, 1.0]
    found = noise.variances([3.0, 9.0, 20.0])
    exact = 1.0 + 2.0 * np.array([2.0, 8.0, 19.0]) ** 1.5
    assert np.abs(np.log2(found / exact)).max() <= 0.5 / STEPS_PER_OCTAVE
    assert noise.variances([np.nan, np.inf]).tolist() == [1.0, 1.0]


@pytest.mark.parametrize(
    ("growth", "power", "message"),
    [
        (-0.1, 1.0, "impulse noise growth: found -0.1, expected a number from 0 to 10000"),
        (1.01e4, 1.0, "impulse noise growth: found 10100.0, expected a number from 0 to 10000"),
        (np.nan, 1.0, "impulse noise growth: found nan, expected a number from 0 to 10000"),
        (1.0, 0.1, "impulse noise power: found 0.1, expected a number from 0.5 to 4"),
        (1.0, np.inf, "impulse noise power: found inf, expected a number from 0.5 to 4"),
    ],
)
def test_a_noise_that_cannot_be_is_refused(growth: float, power: float, message: str) -> None:
    with pytest.raises(InvalidValueError) as refused:
        ImpulseNoise(growth, power)
    assert str(refused.value) == message


def test_the_largest_and_the_least_noise_are_accepted_and_variances_are_halves_of_octaves() -> None:
    assert ImpulseNoise(0.0, 0.5).variances([7.0]).tolist() == [1.0]
    assert ImpulseNoise(1e4, 4.0).exact_variances(np.array([2.0])).tolist() == [10001.0]
    assert ImpulseNoise(1.0, 2.0).exact_variances(np.array([0.5, 1.0, 3.0])).tolist() == [1.0, 1.0, 5.0]
    rounded = ImpulseNoise(1.0, 2.0).variances([3.0, 4.0])  # 5 and 10: between 4, 4 sqrt(2) and 8, 8 sqrt(2)
    np.testing.assert_allclose(rounded, [2.0**2.5, 2.0**3.5], rtol=1e-12)


def test_the_predicted_impulse_is_one_at_rest_none_in_the_air_and_many_at_an_impact() -> None:
    states = np.zeros((3, 13))
    states[:, 3] = 1.0
    states[:, 2] = [1.0, 3.0, 1.0]
    states[2, 9] = -20.0
    rest, air, impact = predicted_impulses(ContactGeometry.of_body(BODY), BODY, states, 1 / 148)
    assert rest == pytest.approx(1.0, abs=1e-6)
    assert air == 0.0
    assert impact == pytest.approx(1.0 + 20.0 * 148 / BODY.scaled_gravity, rel=1e-6)


@pytest.mark.parametrize("estimator", list(Estimator))
def test_weighted_sums_are_those_of_a_plain_loop_over_transitions(data: Transitions, estimator: Estimator) -> None:
    geometry = a_theta(None)
    weights = np.exp2(-0.5 * np.random.default_rng(1).integers(0, 9, len(data.dt)))
    fishers, score_sums, losses, residuals, status = sums(geometry, data, estimator, weights)
    plain = sums(geometry, data, estimator)
    np.testing.assert_array_equal(losses, plain[2])
    np.testing.assert_array_equal(residuals, plain[3])
    np.testing.assert_array_equal(status, plain[4])
    power = 1 if estimator is Estimator.GAUSS_NEWTON else 2
    single = np.arange(len(data.dt) + 1)
    each = fisher_sums(geometry, BODY, data.before, data.after, data.dt, single, estimator, config=LOSS)
    for toss, (first, last) in enumerate(zip(data.starts[:-1], data.starts[1:], strict=True)):
        own = weights[first:last]
        expected = (own[:, None, None] ** power * each.fishers[first:last]).sum(axis=0)
        np.testing.assert_allclose(fishers[toss], expected, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(score_sums[toss], own @ each.score_sums[first:last], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("estimator", list(Estimator))
def test_transitions_of_one_weight_are_summed_before_they_are_weighted_bit_for_bit(
    data: Transitions, estimator: Estimator
) -> None:
    weights = np.exp2(-0.5 * np.random.default_rng(2).integers(0, 5, len(data.dt)))
    fishers, score_sums, *_ = sums(a_theta(None), data, estimator, weights)
    for toss, (first, last) in enumerate(zip(data.starts[:-1], data.starts[1:], strict=True)):
        order = first + np.argsort(weights[first:last], kind="stable")
        by_weight, edges = np.unique(weights[order], return_index=True)
        rows = data.before[order], data.after[order], data.dt[order]
        runs = fisher_sums(a_theta(None), BODY, *rows, [*edges, last - first], estimator, config=LOSS)
        in_fishers = by_weight if estimator is Estimator.GAUSS_NEWTON else by_weight**2
        fisher, score_sum = np.zeros_like(fishers[toss]), np.zeros_like(score_sums[toss])
        for run, weight in enumerate(by_weight):
            fisher += in_fishers[run] * runs.fishers[run]
            score_sum += weight * runs.score_sums[run]
        assert (fishers[toss].tobytes(), score_sums[toss].tobytes()) == (fisher.tobytes(), score_sum.tobytes())


def test_weights_of_one_give_the_same_bytes_as_none_and_bad_ones_are_refused(data: Transitions) -> None:
    with_ones, without = (sums(a_theta(None), data, Estimator.GAUSS_NEWTON, w) for w in (np.ones(len(data.dt)), None))
    for one, other in zip(with_ones, without, strict=True):
        assert one.tobytes() == other.tobytes()
    for wrong in (np.ones(3), np.zeros(len(data.dt)), np.full(len(data.dt), np.nan)):
        with pytest.raises(InvalidValueError) as refused:
            sums(a_theta(None), data, Estimator.GAUSS_NEWTON, wrong)
        expected = f"({len(data.dt)},) finite positive numbers"
        assert str(refused.value) == f"weights of transitions: found shape {wrong.shape}, expected {expected}"


def test_a_theta_with_noise_weighs_by_itself_and_impacts_count_less(data: Transitions) -> None:
    noisy = a_theta(ImpulseNoise(1.0, 2.0))
    weights = transition_weights(noisy, BODY, data.before, data.dt)
    assert weights is not None
    impulses = predicted_impulses(noisy, BODY, data.before, data.dt)
    assert (weights[impulses < 1.0] == 1.0).all()
    assert weights[impulses > 8.0].max() < 0.05
    own, given = (
        sums(noisy, data, Estimator.GAUSS_NEWTON),
        sums(a_theta(ImpulseNoise(0.0)), data, Estimator.GAUSS_NEWTON, weights),
    )
    for one, other in zip(own, given, strict=True):
        np.testing.assert_array_equal(one, other)
    assert transition_weights(a_theta(ImpulseNoise(0.0)), BODY, data.before, data.dt) is None


def test_the_rigid_form_moves_both_sets_of_vertices_alike(data: Transitions) -> None:
    """Its scores are slopes of the loss by central differences, vertices moved together."""
    geometry = a_theta(None)
    rigid, physical = (parameter_form(geometry, form) for form in (Form.RIGID, Form.PHYSICAL))
    assert [tuple(block) for block in rigid.blocks] == [("vertices_normal", 24), ("friction", 1), ("tilt", 2), ("height", 1)]
    assert (rigid.size, physical.size) == (28, 52)
    found = evaluate(geometry, BODY, data.before, data.after, data.dt, LOSS)
    slope = -2.0 * (found.scores @ rigid.chart).sum(axis=0)
    for place in (0, 7, 20):
        step = np.zeros((8, 3))
        step.flat[place] = 1e-6
        both = [
            evaluate(replace(geometry, vertices_normal=moved, vertices_tangent=moved), BODY, data.before, data.after, data.dt)
            for moved in (geometry.vertices_normal + step, geometry.vertices_normal - step)
        ]
        assert slope[place] == pytest.approx((both[0].losses.sum() - both[1].losses.sum()) / 2e-6, rel=1e-3, abs=1e-4)


def test_two_sets_of_vertices_have_no_rigid_form() -> None:
    apart = replace(a_theta(None), vertices_tangent=a_theta(None).vertices_normal + 0.1)
    with pytest.raises(
        InvalidValueError,
        match=r"^vertices_tangent: found up to \S+ from vertices_normal, expected the same, as the rigid form has; or",
    ):
        parameter_form(apart, Form.RIGID)
    assert form_of_geometry(apart) is Form.PHYSICAL
    assert form_of_geometry(a_theta(ImpulseNoise())) is Form.RIGID
    assert form_of_geometry(replace(apart, normal=2.0 * UPWARD)) is Form.CONTACTNETS


def test_a_theta_carries_its_noise_in_bytes_and_in_its_version_and_older_bytes_have_none() -> None:
    noisy, plain = a_theta(ImpulseNoise(1.25, 1.5)), a_theta(None)
    assert geometry_of_bytes(bytes_of_geometry(noisy)).noise == ImpulseNoise(1.25, 1.5)
    assert geometry_of_bytes(bytes_of_geometry(plain)).noise is None
    versions = {parameters_version(a_theta(noise), BODY) for noise in (None, ImpulseNoise(), ImpulseNoise(1.25, 1.5))}
    assert len(versions) == 3


def test_a_scorer_keeps_the_form_of_a_rigid_theta_and_its_information_is_weighted() -> None:
    tosses = simulated_tosses(2, seed=5)
    loss = replace(LOSS, balanced=False)
    rigid, physical = (Scorer(a_theta(noise), BODY, ScoringConfig(loss=loss)) for noise in (ImpulseNoise(), None))
    assert [block.name for block in rigid.blocks] == ["vertices_normal", "friction", "tilt", "height"]
    weighted, plain = rigid.score(tosses), physical.score(tosses)
    for one, other in zip(weighted, plain, strict=True):
        assert one.block_traces[1] < other.block_traces[2]  # type: ignore[union-attr]  # of friction
        assert one.mean_loss == other.mean_loss  # type: ignore[union-attr]
    usual = Scorer(a_theta(None), BODY, ScoringConfig(form=Form.RIGID, loss=LOSS))
    assert usual.version == rigid.version
