"""What bodies turn about in the air is where their centre of mass is, and intervals hold the truth."""

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.geometry import quaternions
from contact_curation.motion.calibration import RigCalibration
from contact_curation.motion.survey.falls import survey
from contact_curation.motion.survey.mass_centre import MassCentre, mass_centre
from contact_curation.motion.survey.series import PoseSeries
from test.motion.survey.rigs import GRAVITY, RATE, Rig, Throws, recorded

CUBE = CONTACTNETS_CUBE.polytope
OFF = (0.004, -0.006, 0.008)


def found_of(rig: Rig, throws: Throws, seed: int = 0) -> MassCentre:
    found = mass_centre(survey(recorded(CUBE, rig, throws, seed)))
    assert found is not None
    return found


def planar(count: int, off: tuple[float, float, float]) -> list[PoseSeries]:
    """Bodies that turn about their y axis alone, and fall far enough to be seen."""
    rng, times, made = np.random.default_rng(0), np.arange(40) / RATE, []
    for number in range(count):
        turns = quaternions.exp(np.outer(times, [0.0, rng.uniform(4.0, 8.0), 0.0]))
        fallen = np.outer(times, [*rng.uniform(-1.0, 1.0, 2), 0.4]) - np.outer(0.5 * GRAVITY * times**2, [0.0, 0.0, 1.0])
        places = (
            fallen + np.array([0.0, 0.0, 0.4]) - quaternions.rotate(turns, np.array(off)) + 2e-5 * rng.standard_normal((40, 3))
        )
        made.append(PoseSeries(np.rint((times + 10.0 * number) * 1e9).astype(np.int64), places, turns))
    return made


@pytest.mark.parametrize("off", [(0.0, 0.0, 0.0), OFF])
def test_it_is_found_and_its_interval_holds_it(off: tuple[float, float, float]) -> None:
    held = []
    for seed in range(10):
        found = found_of(Rig(marker_offset=off, noise=1e-4), Throws(count=16), seed)
        assert found.place == pytest.approx(off, abs=6e-4)
        assert found.acceleration == pytest.approx([0.0, 0.0, -GRAVITY], abs=0.02)
        assert found.is_elsewhere == any(off)
        held += [one.low <= true <= one.high for one, true in zip(found.intervals, off, strict=True)]
    assert np.mean(held) > 0.8


@pytest.mark.slow
def test_few_flights_of_a_body_as_described_do_not_place_it_elsewhere() -> None:
    found = [found_of(Rig(noise=1e-4), Throws(count=9), seed) for seed in range(60)]
    assert sum(one.is_elsewhere for one in found) <= 1


def test_a_marker_whose_place_is_known_leaves_nothing() -> None:
    rig = Rig(scale=1.03, marker_turn=(0.2, -0.3, 0.1), marker_offset=OFF)
    known = RigCalibration(scale=1.03, marker_turn=rig.marker_turn, marker_offset=OFF)
    found = found_of(rig, Throws()).seen_from_described(known)
    assert found.place == pytest.approx([0.0, 0.0, 0.0], abs=2e-4)


def test_along_an_axis_that_all_turn_about_nothing_is_seen() -> None:
    found = mass_centre(survey(planar(12, OFF)))
    assert found is not None
    assert found.place == pytest.approx([OFF[0], 0.0, OFF[2]], abs=2e-4)
    assert [np.isfinite(one.low) for one in found.intervals] == [True, False, True]


def test_a_few_flights_tell_nothing() -> None:
    assert mass_centre(survey(recorded(CUBE, Rig(marker_offset=OFF), Throws(count=5)))) is None


def test_spoilt_flights_are_left_out() -> None:
    series = recorded(CUBE, Rig(marker_offset=OFF), Throws(count=30))
    for one in series[:4]:
        one.positions[10:20] += 0.02 * np.random.default_rng(1).standard_normal((10, 3))
    found = mass_centre(survey(series))
    assert found is not None
    assert found.place == pytest.approx(OFF, abs=2e-4)


def test_intervals_of_few_flights_are_as_wide_as_so_few_make_them() -> None:
    few = MassCentre(8, np.zeros(3), np.eye(3), np.zeros(3))
    assert [one.high for one in few.intervals] == pytest.approx([4.3027] * 3, abs=1e-4)  # Student's t of 8 - 6 degrees
