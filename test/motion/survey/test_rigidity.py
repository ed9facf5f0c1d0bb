"""A rigid body has a point that falls on a parabola, wherever the tracker follows it; a body with moving parts has none."""

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.geometry import quaternions
from contact_curation.motion.survey.falls import survey
from contact_curation.motion.survey.rigidity import departure
from contact_curation.motion.survey.series import PoseSeries
from test.motion.survey.rigs import FLYING, Rig, Throws, recorded

CUBE, LEAST = CONTACTNETS_CUBE.polytope, 1e-6
OFF = (0.004, -0.006, 0.008)


def times_of(series: list[PoseSeries]) -> float:
    found = departure(survey(series), LEAST)
    assert found is not None
    assert found.flights >= 12
    assert found.size / found.scatter == pytest.approx(found.times, rel=0.3)
    return found.times


@pytest.mark.parametrize("noise", [2e-5, 2e-4])
@pytest.mark.parametrize("off", [(0.0, 0.0, 0.0), OFF])
def test_of_rigid_bodies_the_nearest_point_departs_by_its_scatter(noise: float, off: tuple[float, float, float]) -> None:
    assert times_of(recorded(CUBE, Rig(marker_offset=off, noise=noise), Throws(count=16))) == pytest.approx(1.0, abs=0.15)


def test_a_load_that_swings_moves_the_point_off_its_parabola() -> None:
    series = recorded(CUBE, Rig(), Throws(count=16))
    for one in series:
        swing = 0.002 * np.sin(2.0 * np.pi * 5.0 * one.times[:FLYING])[:, np.newaxis] * np.array([1.0, 0.0, 0.0])
        one.positions[:FLYING] += quaternions.rotate(one.orientations_wxyz[:FLYING], swing)
    assert times_of(series) > 5.0


def test_the_drag_of_the_air_is_no_moving_part() -> None:
    series = recorded(CUBE, Rig(), Throws(count=16))
    for one in series:
        times = one.times[:FLYING, np.newaxis]
        speeds = np.gradient(one.positions[:FLYING], axis=0) / one.period
        slower = -0.1 * np.linalg.norm(speeds, axis=1, keepdims=True) * speeds
        one.positions[:FLYING] += np.cumsum(np.cumsum(slower, axis=0), axis=0) * np.gradient(times, axis=0) ** 2
    assert times_of(series) < 1.5


def test_a_few_flights_say_nothing() -> None:
    assert departure(survey(recorded(CUBE, Rig(), Throws(count=5))), LEAST) is None
