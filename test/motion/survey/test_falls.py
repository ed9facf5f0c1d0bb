"""The acceleration that bodies fall with is not that of a hand, which holds them in the frames before."""

import numpy as np
import pytest

from contact_curation.geometry.quaternions import Array
from contact_curation.motion.survey.falls import survey
from contact_curation.motion.survey.series import PoseSeries

GRAVITY = 9.81


def released(rate: float, noise: float, rng: np.random.Generator) -> PoseSeries:
    """A body that is carried at an even velocity, let go between two frames, and lies after 0.2 s where it lands."""
    times = np.arange(round(rate)) / rate - 0.35 + rng.uniform(0.0, 1.0 / rate)
    moved = np.minimum(times, 0.2)
    fallen = 0.5 * GRAVITY * np.maximum(moved, 0.0) ** 2
    places: Array = np.outer(moved, rng.uniform(-0.5, 0.5, 3)) - np.outer(fallen, [0.0, 0.0, 1.0])
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (len(times), 1))
    return PoseSeries(np.rint((times + 1.0) * 1e9).astype(np.int64), places + noise * rng.standard_normal(places.shape), turns)


@pytest.mark.parametrize(("rate", "noise"), [(60.0, 5e-4), (60.0, 2e-5), (148.0, 2e-4), (148.0, 2e-5), (500.0, 1e-4)])
def test_bodies_that_a_hand_lets_go_fall_with_gravity(rate: float, noise: float) -> None:
    rng = np.random.default_rng(0)
    found = survey([released(rate, noise, rng) for _ in range(150)])
    assert len(found.throws) == 150
    assert found.gravity is not None
    sizes = [float(np.linalg.norm(throw.acceleration)) for throw in found.throws]
    assert np.linalg.norm(found.gravity) == pytest.approx(GRAVITY, rel=0.005)
    assert np.median(sizes) == pytest.approx(GRAVITY, rel=0.005)
