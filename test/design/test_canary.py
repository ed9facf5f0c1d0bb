"""Theta is trusted once enough tosses fit it and thetas agree, and not before."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.design.canary import CanaryConfig, distrust, spearman
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array

CONFIG = CanaryConfig(least_tosses=3, largest_loss=0.1, least_agreement=0.5)
GAINS = np.array([1.0, 2.0, 3.0, 4.0])
ALIKE = [GAINS, GAINS**2]
FINE = [0.02, 0.03, 5.0]
"""The median counts: one bad toss does no harm."""


def test_theta_is_trusted_when_everything_is_there() -> None:
    assert distrust(CONFIG, FINE, ALIKE) is None


@pytest.mark.parametrize(
    ("losses", "gains", "reason"),
    [
        (FINE[:2], ALIKE, "tosses: found 2, expected at least 3"),
        ([0.2, 0.11, 0.01], ALIKE, "loss: found a median of 0.11, expected at most 0.1"),
        ([np.nan] * 3, ALIKE, "loss: found a median of nan"),
        (FINE, ALIKE[:1], "thetas: found 1, expected two that agree"),
        (FINE, [GAINS, GAINS[::-1]], "agreement: found a rank correlation of -1.00, expected at least 0.5"),
        (FINE, [*ALIKE, GAINS[[0, 2, 3, 1]]], "agreement: found a rank correlation of 0.40"),
    ],
)
def test_each_doubt_is_named(losses: list[float], gains: list[Array], reason: str) -> None:
    found = distrust(CONFIG, losses, gains)
    assert found is not None
    assert found.startswith(reason)


def test_agreement_counts_from_its_limit_on() -> None:
    almost = [GAINS, GAINS[[0, 2, 3, 1]]]
    assert distrust(replace(CONFIG, least_agreement=0.4 - 1e-9), FINE, almost) is None
    assert distrust(replace(CONFIG, least_agreement=0.4 + 1e-9), FINE, almost) is not None


def test_rank_correlation_asks_for_order_only() -> None:
    assert spearman(GAINS, np.exp(GAINS)) == pytest.approx(1.0)
    assert spearman(GAINS, -GAINS) == pytest.approx(-1.0)
    assert np.isnan(spearman(GAINS[:1], GAINS[:1]))


@pytest.mark.parametrize(("name", "value"), [("least_tosses", -1), ("largest_loss", 0.0), ("least_agreement", 1.5)])
def test_settings_that_make_no_sense_are_refused(name: str, value: float) -> None:
    with pytest.raises(InvalidValueError, match=f"canary.{name}"):
        replace(CONFIG, **{name: value})  # type: ignore[arg-type]
