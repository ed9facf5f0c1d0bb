"""Theta is trusted once enough tosses fit it and thetas agree, and not before."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.design.readiness import ReadinessConfig, spearman, unready_reason
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array

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
    [("least_tosses", -1), ("recent", 0), ("largest_loss", 0.0), ("least_agreement", 1.5), ("most_tosses", -1)],
)
def test_settings_that_make_no_sense_are_refused(name: str, value: float) -> None:
    with pytest.raises(InvalidValueError, match=f"readiness.{name}"):
        replace(CONFIG, **{name: value})  # type: ignore[arg-type]
