"""Priors of releases: what was seen is found again, in the heading frame."""

import numpy as np
import pytest

from contact_curation.design.releases import (
    PUBLISHED_PRIOR,
    Placement,
    PriorConfig,
    Releases,
    ThrowPrior,
    fitted_prior,
    published_prior,
    published_releases,
    raw_prior,
)
from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from test.design.cases import releases
from test.simulated import RELEASE_DEVIATION, RELEASE_MEAN


def test_a_fit_finds_the_prior_that_releases_were_drawn_from_whatever_their_headings() -> None:
    fitted = fitted_prior(published_releases(4000, np.random.default_rng(1)))
    deviations = np.sqrt(np.diag(PUBLISHED_PRIOR.covariance))
    np.testing.assert_allclose(fitted.mean, PUBLISHED_PRIOR.mean, atol=4.0 * (deviations / np.sqrt(4000)).max())
    np.testing.assert_allclose(np.sqrt(np.diag(fitted.covariance)), deviations, rtol=0.05)
    correlation = fitted.covariance / np.outer(deviations, deviations)
    np.testing.assert_allclose(correlation - np.diag(np.diag(correlation)), 0.0, atol=0.06)


def test_a_correlation_between_speed_and_tumble_is_kept() -> None:
    covariance = PUBLISHED_PRIOR.covariance.copy()
    covariance[1, 4] = covariance[4, 1] = 0.8 * np.sqrt(covariance[1, 1] * covariance[4, 4])
    source = ThrowPrior(PUBLISHED_PRIOR.mean, covariance, PUBLISHED_PRIOR.orientations_wxyz)
    states = source.draw(3000, np.random.default_rng(2)).states(Placement(heading=1.0))
    fitted = fitted_prior(states)
    found = fitted.covariance[1, 4] / np.sqrt(fitted.covariance[1, 1] * fitted.covariance[4, 4])
    assert found == pytest.approx(0.8, abs=0.05)


def test_drawn_orientations_lie_about_those_that_were_seen() -> None:
    seen = releases(8)
    prior = fitted_prior(seen)
    drawn = prior.draw(500, np.random.default_rng(0)).orientations_wxyz
    base = Releases.of_states(seen).orientations_wxyz
    angles = np.min([quaternions.angle_between(drawn, one) for one in base], axis=0)
    assert np.degrees(np.sqrt((angles**2).mean() / 3.0)) == pytest.approx(9.0, abs=1.5)


def test_the_papers_prior_throws_faster_and_slower_than_anything_it_was_fitted_to() -> None:
    seen = published_releases(400, np.random.default_rng(3))
    drawn = raw_prior(seen).states(2000, np.random.default_rng(4))
    speeds = [np.linalg.norm(states[:, 7:10], axis=1) for states in (seen, drawn)]
    outside = (speeds[1] < speeds[0].min()) | (speeds[1] > speeds[0].max())
    assert outside.mean() > 0.4  # headings lie on a ring, and the normal fills it
    np.testing.assert_allclose(np.linalg.norm(drawn[:, 3:7], axis=1), 1.0)


def test_the_published_prior_is_that_of_the_tests_own_tosses() -> None:
    np.testing.assert_array_equal(PUBLISHED_PRIOR.mean, RELEASE_MEAN[2:])
    np.testing.assert_allclose(np.sqrt(np.diag(PUBLISHED_PRIOR.covariance)), RELEASE_DEVIATION[2:])


def test_the_same_seed_draws_the_same() -> None:
    one, other = (PUBLISHED_PRIOR.draw(5, np.random.default_rng(9)).states(Placement()) for _ in range(2))
    assert one.tobytes() == other.tobytes()


def test_too_few_releases_make_no_prior() -> None:
    with pytest.raises(InvalidValueError, match=r"releases to fit a prior to: found shape \(7, 13\)"):
        fitted_prior(releases(7))


def test_a_slower_prior_draws_the_same_throws_at_a_share_of_their_speeds_and_spins() -> None:
    slower = published_prior(PriorConfig(speed=0.6, spin=0.3))
    published, drawn = (prior.draw(50, np.random.default_rng(0)).motion for prior in (PUBLISHED_PRIOR, slower))
    np.testing.assert_allclose(drawn, published * [1.0, 0.6, 0.6, 0.3, 0.3, 0.3], rtol=1e-9, atol=1e-12)
    assert published_prior(PriorConfig()).covariance.tobytes() == PUBLISHED_PRIOR.covariance.tobytes()


@pytest.mark.parametrize("share", [0.0, -1.0, float("nan")])
def test_a_share_of_speeds_that_is_none_is_refused(share: float) -> None:
    with pytest.raises(InvalidValueError, match=r"prior\.speed"):
        PriorConfig(speed=share)
