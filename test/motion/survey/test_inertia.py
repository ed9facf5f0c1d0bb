"""How bodies tumble in the air says how their moments of inertia are in relation, and intervals hold the truth."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from benchmarks.data.thrown_bodies import release
from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.design.throw import throw_of_state
from contact_curation.geometry import quaternions
from contact_curation.geometry.polytopes import box
from contact_curation.motion.survey.falls import Flight, Survey, Throw, survey
from contact_curation.motion.survey.inertia import inertia_shape, shape_of
from contact_curation.motion.survey.series import PoseSeries, series_of
from contact_curation.motion.toss import Toss
from contact_curation.pipeline.diagnosis.evidence import Evidence
from contact_curation.pipeline.diagnosis.findings.rig import inertia
from contact_curation.pipeline.diagnosis.recording import Recording
from contact_curation.pipeline.reading import ReadingConfig
from contact_curation.simulation.thrown_toss import ThrownTossConfig, thrown_toss

TURNED = np.array([[3.0e-4, 5e-5, 0.0], [5e-5, 5.0e-4, -4e-5], [0.0, -4e-5, 6.0e-4]])
BODIES = {
    "cube": CONTACTNETS_CUBE,
    "slab": Body("slab", box([0.06, 0.04, 0.025]).vertices, 0.37, np.diag([2.7e-4, 5.2e-4, 6.4e-4]), 0.2, 0.04),
    "turned": Body("turned", box([0.06, 0.04, 0.025]).vertices, 0.37, TURNED, 0.2, 0.04),
}
NOISE = 2.2e-5


@cache
def thrown(name: str) -> tuple[Toss, ...]:
    """30 tosses by MuJoCo."""
    body, rng = BODIES[name], np.random.default_rng(2)
    states = [release(body, rng) for _ in range(30)]
    return tuple(thrown_toss(body, throw_of_state(f"{n}", body.name, one), ThrownTossConfig()) for n, one in enumerate(states))


def noisy(tosses: tuple[Toss, ...], multiple: float) -> list[PoseSeries]:
    rng = np.random.default_rng(0)
    found = []
    for one in map(series_of, tosses):
        scattered = quaternions.exp(20.0 * multiple * NOISE * rng.standard_normal((len(one), 3)))
        places = one.positions + multiple * NOISE * rng.standard_normal(one.positions.shape)
        found.append(PoseSeries(one.stamps_ns, places, quaternions.multiply(one.orientations_wxyz, scattered)))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("multiple", [1.0, 10.0])
@pytest.mark.parametrize("name", BODIES)
def test_the_shape_of_the_inertia_is_found(name: str, multiple: float) -> None:
    found = inertia_shape(survey(noisy(thrown(name), multiple)))
    assert found is not None
    assert found.values == pytest.approx(shape_of(BODIES[name].inertia), abs=0.01)
    assert found.values[:3].sum() == pytest.approx(3.0)
    other = np.diag([1.0, 1.2, 1.4])
    assert found.differs_from(other)
    turn = quaternions.to_matrix(quaternions.exp([0.3, -0.2, 0.5]))
    np.testing.assert_allclose(found.turned(turn).matrix, turn @ found.matrix @ turn.T, atol=1e-12)


def test_a_few_flights_tell_nothing() -> None:
    assert inertia_shape(survey(noisy(thrown("slab")[:6], 1.0))) is None


def test_flights_that_do_not_turn_at_all_tell_nothing() -> None:
    seen = survey(noisy(thrown("slab"), 1.0))
    still = [PoseSeries(one.stamps_ns, one.positions, np.tile([1.0, 0.0, 0.0, 0.0], (len(one), 1))) for one in seen.series]
    assert inertia_shape(replace(seen, series=tuple(still))) is None


def test_of_few_flights_in_noise_the_right_moments_are_seldom_taken_for_others() -> None:
    rng, times = np.random.default_rng(0), np.arange(20) / 148.0
    alarms = 0
    for _ in range(60):
        throws, series = [], []
        for number in range(12):
            turns = quaternions.exp(np.outer(times, 3.0 * rng.standard_normal(3)))
            turns = quaternions.multiply(turns, quaternions.exp(0.005 * rng.standard_normal((20, 3))))
            series.append(PoseSeries((1e9 * times).astype(np.int64), np.zeros((20, 3)), turns))
            flight = Flight(number, 0, 20)
            throws.append(Throw((flight,), None, flight, np.array([0.0, 0.0, -9.81])))
        found = inertia_shape(Survey(tuple(series), 0.0, None, tuple(throws), 0.0))
        alarms += found is not None and found.differs_from(np.eye(3))
    assert alarms <= 1


def test_check_says_where_the_described_moments_are_others() -> None:
    tosses = thrown("slab")
    recording = Recording("a", series=tuple(noisy(tosses, 1.0)), outcomes=tosses)
    right, wrong = BODIES["slab"], replace(BODIES["slab"], inertia=np.diag([4e-4, 4e-4, 4e-4]))
    assert inertia(Evidence(ReadingConfig(right), (recording,))) is None
    found = inertia(Evidence(ReadingConfig(wrong), (recording,)))
    assert found is not None
    assert "of 0.57 : 1.09 : 1.34, described 1.00 : 1.00 : 1.00" in found.what
    assert found.remedy.startswith("correct the --body file, inertia: [0.000227, 0.00043")
    assert "(xx : yy : zz) of" in found.what
    skew = replace(right, inertia=right.inertia + 5e-5 * np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]))
    found = inertia(Evidence(ReadingConfig(skew), (recording,)))
    assert found is not None  # products that are wrong are among the numbers, moments alone would look alike
    assert "(xx : yy : zz : xy : xz : yz) of" in found.what
