"""Theta is trusted once enough tosses fit it and thetas agree, and not before."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.design.predicted_information import Particle
from contact_curation.design.readiness import CUBE_LOSS, NOISE_LOSS, ReadinessConfig, spearman, unready_reason
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.record import TossInformation
from test.simulated import RIG_NOISE, TrackerNoise, simulated_tosses

CONFIG = ReadinessConfig(least_tosses=3, recent=3, largest_loss=0.1, least_agreement=0.5)
SCORES = np.array([1.0, 2.0, 3.0, 4.0])
ALIKE = [SCORES, SCORES**2]
FINE = [0.02, 0.03, 5.0]
"""The median counts: one bad toss does no harm."""


def test_theta_is_trusted_when_everything_is_there() -> None:
    assert unready_reason(CONFIG, FINE, ALIKE) is None


@pytest.mark.parametrize(
    ("losses", "scores", "reason"),
    [
        (FINE[:2], ALIKE, "tosses: found 2, expected at least 3"),
        ([0.2, 0.11, 0.01], ALIKE, "loss: found a median of 0.11, expected at most 0.1"),
        ([np.nan] * 3, ALIKE, "loss: found a median of nan"),
        (FINE, ALIKE[:1], "thetas: found 1, expected two that agree"),
        (FINE, [SCORES, SCORES[::-1]], "agreement: found a rank correlation of -1.00, expected at least 0.5"),
        (FINE, [*ALIKE, SCORES[[0, 2, 3, 1]]], "agreement: found a rank correlation of 0.40"),
    ],
)
def test_each_doubt_is_named(losses: list[float], scores: list[Array], reason: str) -> None:
    found = unready_reason(CONFIG, losses, scores)
    assert found is not None
    assert found.startswith(reason)


def test_only_the_newest_losses_count() -> None:
    assert unready_reason(CONFIG, [9.0, 9.0, 9.0, 9.0, *FINE], ALIKE) is None
    assert unready_reason(replace(CONFIG, recent=7), [9.0, 9.0, 9.0, 9.0, *FINE], ALIKE) is not None


def test_agreement_counts_from_its_limit_on() -> None:
    almost = [SCORES, SCORES[[0, 2, 3, 1]]]
    assert unready_reason(replace(CONFIG, least_agreement=0.4 - 1e-9), FINE, almost) is None
    assert unready_reason(replace(CONFIG, least_agreement=0.4 + 1e-9), FINE, almost) is not None


def test_agreement_is_not_asked_for_from_so_many_tosses_on_and_the_loss_still_is() -> None:
    strangers = [SCORES, SCORES[::-1]]
    config = replace(CONFIG, most_tosses=5)
    assert unready_reason(config, [0.02] * 4, strangers) is not None
    assert unready_reason(config, [0.02] * 5, strangers) is None
    assert unready_reason(replace(config, most_tosses=0), [0.02] * 5, strangers) is not None
    assert unready_reason(config, [0.02, 0.02, 0.2, 0.2, 0.2], ALIKE) is not None


def test_rank_correlation_asks_for_order_only() -> None:
    assert spearman(SCORES, np.exp(SCORES)) == pytest.approx(1.0)
    assert spearman(SCORES, -SCORES) == pytest.approx(-1.0)
    assert np.isnan(spearman(SCORES[:1], SCORES[:1]))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("tracker_noise", 0.5),
        ("least_tosses", -1),
        ("recent", 0),
        ("largest_loss", 0.0),
        ("least_agreement", 1.5),
        ("most_tosses", -1),
    ],
)
def test_settings_that_make_no_sense_are_refused(name: str, value: float) -> None:
    with pytest.raises(InvalidValueError, match=f"readiness.{name}"):
        replace(CONFIG, **{name: value})  # type: ignore[arg-type]


@pytest.mark.parametrize(("rate", "noise", "growth"), [(60, 1.0, 1.0), (250, 1.0, 250 / 150), (250, 4.0, 1000 / 150)])
def test_the_largest_loss_has_what_noise_adds_at_a_trackers_rate(rate: int, noise: float, growth: float) -> None:
    cube, told = CONTACTNETS_CUBE, ReadinessConfig(tracker_noise=noise)
    assert told.of_body(cube, 1.0 / rate).largest_loss == pytest.approx(CUBE_LOSS + NOISE_LOSS * (growth**2 - 1.0))
    assert replace(CONFIG, tracker_noise=noise).of_body(cube, 1.0 / rate).largest_loss == CONFIG.largest_loss


def test_the_true_parameters_are_ready_with_a_noisy_tracker_once_its_noise_is_told() -> None:
    noise = TrackerNoise(16.0 * RIG_NOISE.position, 16.0 * RIG_NOISE.orientation)
    scorer = Particle(ContactGeometry.of_body(CONTACTNETS_CUBE), CONTACTNETS_CUBE).scorer
    infos = scorer.score(simulated_tosses(4, 0, noise))
    losses = [one.mean_loss for one in infos if isinstance(one, TossInformation)]
    as_the_rig, told = (
        ReadinessConfig(tracker_noise=multiple).of_body(CONTACTNETS_CUBE, 1.0 / 148.0) for multiple in (1.0, 16.0)
    )
    assert (unready_reason(as_the_rig, losses, ALIKE) or "").startswith("loss: found")
    assert unready_reason(told, losses, ALIKE) is None
    assert np.median(losses) > 0.1 * (told.largest_loss or 0.0)  # nor is it too wide


def test_the_largest_loss_is_that_of_the_same_velocity_for_any_body() -> None:
    heavy = replace(CONTACTNETS_CUBE, mass=2.0 * CONTACTNETS_CUBE.mass, length_scale=0.5 * CONTACTNETS_CUBE.length_scale)
    assert ReadinessConfig().of_body(CONTACTNETS_CUBE).largest_loss == 0.15
    assert ReadinessConfig().of_body(heavy).largest_loss == pytest.approx(0.15 * 4.0)
    assert CONFIG.of_body(heavy) == CONFIG
