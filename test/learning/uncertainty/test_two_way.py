"""Intervals that allow for few tosses, and for a model that is not quite right."""

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.evaluation import Estimator
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.fits.polytope_sums import PolytopeSums, polytope_sums
from contact_curation.learning.uncertainty.two_way import impact_scores, interval_factor, two_way_covariance
from contact_curation.motion.transitions import transitions_of
from test.simulated import simulated_tosses

NO_PRIOR = np.full((1, 1), 1e-18)


def sums_of_a_mean(residuals: Array) -> PolytopeSums:
    """Of tosses (K, n) whose mean is theta."""
    tosses, each = residuals.shape
    fishers = np.full((tosses, 1, 1), float(each))
    scores = residuals.sum(axis=1, keepdims=True)
    return PolytopeSums(np.square(residuals).sum(axis=1), scores, fishers, np.zeros(tosses, dtype=np.int64))


def test_an_interval_from_few_tosses_is_wider() -> None:
    assert interval_factor(1, 9) == pytest.approx(12.71, abs=0.01)
    assert interval_factor(4, 9) == pytest.approx(3.18, abs=0.01)
    assert interval_factor(400, 9) == pytest.approx(2.31, abs=0.01)


def test_six_tosses_with_an_offset_each_have_intervals_that_hold_the_truth() -> None:
    rng = np.random.default_rng(0)
    held = []
    for _ in range(400):
        measured = rng.normal(0.0, 1.0, (6, 1)) + rng.normal(0.0, 0.3, (6, 20))
        mean = measured.mean()
        covariance = two_way_covariance(sums_of_a_mean(measured - mean), np.zeros((1, 1)), 1.0, NO_PRIOR)
        held.append(abs(mean) < interval_factor(6, 6) * np.sqrt(covariance[0, 0]))
    assert 0.92 < np.mean(held) < 0.98


def test_groups_that_want_different_values_leave_a_deviation_that_more_data_do_not_lower() -> None:
    for each in (10, 1000):
        measured = np.tile(np.repeat([1.0, -1.0], each), (8, 1))  # half of the frames of every toss want 1, the others -1
        groups = np.array([[8.0 * each], [-8.0 * each]])
        covariance = two_way_covariance(sums_of_a_mean(measured), groups, 1.0, NO_PRIOR)
        assert np.sqrt(covariance[0, 0]) == pytest.approx(np.sqrt(0.5))


def test_groups_of_impacts_share_all_scores_and_leave_none_out() -> None:
    data = transitions_of(simulated_tosses(3, 4), CONTACTNETS_CUBE.length_scale)
    model = PolytopeModel(ContactGeometry.of_body(CONTACTNETS_CUBE).rigid(), CONTACTNETS_CUBE, Form.RIGID)
    loss = LossConfig(threads=1)
    groups = impact_scores(model, data, loss)
    whole = polytope_sums(model, data, Estimator.EMPIRICAL, loss).scores.sum(axis=0)
    assert len(groups) > 3
    np.testing.assert_allclose(groups.sum(axis=0), whole, rtol=1e-9, atol=1e-9 * np.abs(whole).max())
