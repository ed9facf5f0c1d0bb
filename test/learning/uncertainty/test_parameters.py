"""What is known: units, scaling, prior, coverage in simulation; and the bootstrap over real tosses (method.md 2.8, 6.16)."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import UPWARD, ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.evaluation.rebounds import rebound_of
from contact_curation.learning.fits.polytope_fit import FitConfig, fit_polytope
from contact_curation.learning.uncertainty.coverage import bootstrap_deviations, calibration, whole_hessian_deviations
from contact_curation.learning.uncertainty.parameters import Known, KnownConfig, known, unit_sizes
from contact_curation.motion.survey.sliding import Sliding
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import Transitions, transitions_of
from contact_curation.storage.datasets.contactnets import read_contactnets
from test.simulated import RIG_NOISE, simulated_tosses

LOSS = LossConfig(threads=1)
CONFIG = KnownConfig(loss=LOSS)
CUBE = ContactGeometry.of_body(CONTACTNETS_CUBE)


def rows_of(count: int, seed: int) -> Transitions:
    return transitions_of(simulated_tosses(count, seed), CONTACTNETS_CUBE.length_scale)


def fitted(rows: Transitions) -> PolytopeModel:
    return fit_polytope(PolytopeModel(CUBE, CONTACTNETS_CUBE, Form.PHYSICAL), rows, FitConfig(loss=LOSS)).model


@pytest.fixture(scope="module")
def rows() -> Transitions:
    return rows_of(12, seed=1)


@pytest.fixture(scope="module")
def others() -> Transitions:
    return rows_of(8, seed=2)


@pytest.fixture(scope="module")
def model(rows: Transitions) -> PolytopeModel:
    return fitted(rows)


@pytest.fixture(scope="module")
def found(model: PolytopeModel, rows: Transitions, others: Transitions) -> Known:
    return known(model, rows, others, CONFIG)


def column(found: Known, name: str) -> Array:
    return np.array([getattr(parameter, name) for parameter in found.parameters])


def test_values_and_units_are_millimetres_friction_and_degrees(found: Known, model: PolytopeModel, rows: Transitions) -> None:
    geometry = model.geometry()
    by_name = {parameter.name: parameter for parameter in found.parameters}
    assert [parameter.unit for parameter in found.parameters] == ["mm"] * 48 + ["", "deg", "deg", "mm"]
    assert by_name["vertices_normal[2][1]"].value == pytest.approx(52.4 * geometry.vertices_normal[2, 1])
    assert by_name["vertices_tangent[7][2]"].value == pytest.approx(52.4 * geometry.vertices_tangent[7, 2])
    assert by_name["friction"].value == pytest.approx(np.linalg.norm(geometry.tangents[0]))
    middle = np.array([*rows.before[:, :2].mean(axis=0), 0.0])
    assert by_name["height"].value == pytest.approx(52.4 * (geometry.height - geometry.normal @ (middle - geometry.pivot)))
    assert found.tosses == 12
    assert found.directions == 52
    assert found.to_optimum < 0.05


def test_before_the_first_toss_the_deviations_are_the_priors_in_its_units(rows: Transitions, others: Transitions) -> None:
    sharp = KnownConfig(LOSS, vertices=1e-9, friction=2e-9, tilt=3e-9, height=4e-9)  # so sure that tosses tell nothing more
    found = known(PolytopeModel(CUBE, CONTACTNETS_CUBE, Form.PHYSICAL), rows, others, sharp)
    expected = [52.4e-9] * 48 + [0.18 * 2e-9, np.degrees(3e-9), np.degrees(3e-9), 52.4 * 4e-9]
    np.testing.assert_allclose(column(found, "cramer_rao"), expected, rtol=1e-6)
    np.testing.assert_allclose(column(found, "sandwich"), expected, rtol=1e-6)


def test_what_is_known_does_not_depend_on_the_point_about_which_the_ground_tilts(
    found: Known, model: PolytopeModel, rows: Transitions, others: Transitions
) -> None:
    geometry, pivot = model.geometry(), np.array([5.0, -3.0, 0.0])
    height = geometry.height + float(geometry.normal @ (geometry.pivot - pivot))
    elsewhere = PolytopeModel(replace(geometry, pivot=pivot, height=height), CONTACTNETS_CUBE, Form.PHYSICAL)
    other = known(elsewhere, rows, others, CONFIG)
    for name in ("value", "sandwich", "cramer_rao"):
        np.testing.assert_allclose(column(other, name), column(found, name), rtol=1e-4, atol=1e-6)


def test_a_toss_in_the_air_tells_nothing(model: PolytopeModel, rows: Transitions, others: Transitions, found: Known) -> None:
    flying = Transitions(rows.toss_ids[:1], rows.before[:3], rows.after[:3], rows.dt[:3], np.array([0, 3]))
    nothing = known(model, flying, others, CONFIG)
    for name in ("sandwich", "cramer_rao"):
        np.testing.assert_allclose(column(nothing, name)[:24], 0.4 * 52.4, rtol=0.02)
        assert column(found, name)[:24].max() < 0.2 * 0.4 * 52.4
    assert np.isinf(column(nothing, "naive")).all()


def test_ellipsoids_hold_the_variances_of_their_vertex_and_their_axes_are_orthonormal(found: Known) -> None:
    deviations = column(found, "deviation")[:24].reshape(8, 3)
    for vertex, own in zip(found.vertices, deviations, strict=True):
        covariance = vertex.directions.T @ np.diag(vertex.axes_mm**2) @ vertex.directions
        np.testing.assert_allclose(np.sqrt(np.diagonal(covariance)), own, rtol=1e-9)
        np.testing.assert_allclose(vertex.directions @ vertex.directions.T, np.eye(3), atol=1e-12)
        assert np.all(np.diff(vertex.axes_mm) <= 0.0)
    np.testing.assert_allclose(
        [vertex.position_mm for vertex in found.vertices], column(found, "value")[:24].reshape(8, 3), rtol=1e-12
    )


def test_four_times_the_tosses_halve_the_deviations(model: PolytopeModel, rows: Transitions, others: Transitions) -> None:
    tosses = simulated_tosses(12, 1)
    four = transitions_of(tosses * 4, CONTACTNETS_CUBE.length_scale)
    wide = replace(CONFIG, vertices=1e3, friction=1e3, tilt=1e3, height=1e3)
    once, often = known(model, rows, others, wide), known(model, four, others, wide)
    for name in ("cramer_rao", "sandwich", "naive"):
        np.testing.assert_allclose(column(often, name), 0.5 * column(once, name), rtol=2e-3)


def test_the_losss_unit_changes_neither_bound_nor_sandwich_but_the_naive_one(
    model: PolytopeModel, rows: Transitions, others: Transitions
) -> None:
    loud = LossConfig(0.4, 4.0, 4.0, 4.0, 4.0, regularization=4e-6, threads=1)
    one, other = known(model, rows, others, CONFIG), known(model, rows, others, replace(CONFIG, loss=loud))
    assert other.noise_variance == pytest.approx(4.0 * one.noise_variance, rel=1e-3)
    np.testing.assert_allclose(column(other, "cramer_rao"), column(one, "cramer_rao"), rtol=1e-3)
    np.testing.assert_allclose(column(other, "sandwich"), column(one, "sandwich"), rtol=1e-3)
    np.testing.assert_allclose(column(other, "naive"), column(one, "naive") / 4.0, rtol=1e-3)


def test_the_deviation_to_quote_is_never_below_cramer_rao_and_the_interval_is_a_multiple_of_it(found: Known) -> None:
    assert (column(found, "deviation") >= column(found, "cramer_rao") * (1.0 - 1e-12)).all()
    factors = column(found, "interval") / column(found, "deviation")
    np.testing.assert_allclose(factors, factors[0])
    assert factors[0] > 1.96


def test_the_interval_of_a_friction_holds_that_of_sliding_bodies(
    model: PolytopeModel, rows: Transitions, others: Transitions, found: Known
) -> None:
    sliding = Sliding(np.full(5, 0.25), np.full(5, 0.001))
    for alone, both in zip(found.parameters, known(model, rows, others, CONFIG, sliding).parameters, strict=True):
        if alone.name != "friction":
            assert both == alone
            continue
        assert both.misfit == pytest.approx(abs(0.25 - alone.value) + sliding.median_interval)
        assert both.interval == pytest.approx(np.hypot(alone.interval, both.misfit))
        assert both[:-2] == alone[:-2]


def test_the_interval_of_a_restitution_holds_what_first_impacts_show() -> None:
    bouncing = replace(CUBE.rigid(), restitution=0.4)
    tosses = simulated_tosses(12, 3, RIG_NOISE, geometry=bouncing)
    rows, others = (transitions_of(part, CONTACTNETS_CUBE.length_scale) for part in (tosses[:8], tosses[8:]))
    shown = rebound_of(rows, CONTACTNETS_CUBE)
    assert shown is not None
    off = PolytopeModel(replace(bouncing, restitution=0.05), CONTACTNETS_CUBE, Form.RIGID)
    (found,) = (row for row in known(off, rows, others, CONFIG).parameters if row.name == "restitution")
    assert found.misfit == pytest.approx(shown.restitution - 0.05)
    assert found.interval == pytest.approx(np.hypot(found.misfit, found.interval_of_fit))
    assert found.interval > 0.2


def test_a_theta_that_was_not_fitted_to_the_tosses_is_told(rows: Transitions, others: Transitions) -> None:
    off = PolytopeModel(replace(CUBE, vertices_normal=1.05 * CUBE.vertices_normal), CONTACTNETS_CUBE, Form.PHYSICAL)
    assert known(off, rows, others, CONFIG).to_optimum > 2.0


def test_a_geometry_without_a_physical_form_is_refused(rows: Transitions, others: Transitions) -> None:
    model = PolytopeModel(replace(CUBE, normal=1.1 * UPWARD), CONTACTNETS_CUBE, Form.CONTACTNETS)
    with pytest.raises(InvalidValueError, match="physical"):
        known(model, rows, others, CONFIG)


@pytest.mark.parametrize("name", ["vertices", "friction", "tilt", "height"])
def test_a_prior_out_of_range_is_refused(name: str) -> None:
    with pytest.raises(InvalidValueError, match=name):
        KnownConfig(**{name: 0.0})  # type: ignore[arg-type]


@pytest.mark.slow
def test_resamples_of_one_seed_are_the_same_and_of_another_are_not(model: PolytopeModel, rows: Transitions) -> None:
    few = FitConfig(loss=LOSS, max_steps=4)
    one, again, other = (bootstrap_deviations(model, rows, 2, seed, few).deviations for seed in (5, 5, 6))
    np.testing.assert_array_equal(one, again)
    assert one.min() > 0.0
    assert not np.allclose(one, other, rtol=0.01)


@pytest.mark.slow
def test_the_whole_hessian_gives_the_sandwich_of_a_perfect_fit(model: PolytopeModel, rows: Transitions, found: Known) -> None:
    whole = unit_sizes(model) * whole_hessian_deviations(
        model, rows, LOSS
    )  # residuals that vanish have no curvature to leave out
    heights = np.arange(2, 24, 3)
    ratios = whole[heights] / column(found, "sandwich")[heights]
    assert 0.8 < np.median(ratios) < 1.25


@pytest.mark.slow
@pytest.mark.parametrize("tosses", [64])
def test_the_sandwich_says_how_far_theta_moves_when_real_tosses_are_drawn_anew(contactnets_folder: Path, tosses: int) -> None:
    read = [item for item in read_contactnets(contactnets_folder) if isinstance(item, Toss)]
    chosen = np.random.default_rng(0).choice(400, tosses, replace=False)
    rows, others = (transitions_of(part, 0.0524) for part in ([read[i] for i in chosen], read[400:]))
    found = calibration(fitted(rows), rows, others, resamples=48, seed=0, config=KnownConfig())
    assert found.converged == 48
    named = {
        one.name: (deviation / one.sandwich, deviation / one.naive)
        for one, deviation in zip(found.known.parameters, found.bootstrap)
    }
    sandwich, naive = named["friction"]
    assert 0.7 < sandwich < 1.4
    assert sum(0.7 < named[f"vertices_normal[{vertex}][2]"][0] < 1.4 for vertex in range(8)) >= 6
    assert naive < 0.1  # the naive bound is off by more than a factor of ten
