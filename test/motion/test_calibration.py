"""A rig's tilt and length scale are estimated from tosses, and corrected."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.scalars import vector
from contact_curation.motion.calibration import (
    NO_CORRECTION,
    CornerHeights,
    RigCalibration,
    apply_calibration,
    calibrated_poses,
    calibration_of,
    measurements_of,
)
from contact_curation.motion.smoothing import kinematics
from contact_curation.motion.toss import Toss
from test.simulated import simulated_tosses

CUBE = CONTACTNETS_CUBE.polytope
LEAN = np.radians([0.5, -0.8, 0.0])
METRE = 0.98


@pytest.fixture(scope="module")
def tosses() -> tuple[Toss, ...]:
    return tuple(simulated_tosses(12, 3))


def mistracked(toss: Toss) -> Toss:
    """By a rig whose frame leans and whose metre is short."""
    turn = quaternions.exp(LEAN)
    return replace(
        toss,
        positions=METRE * quaternions.rotate(turn, toss.positions),
        orientations_wxyz=quaternions.multiply(turn, toss.orientations_wxyz),
        linear_velocities=METRE * quaternions.rotate(turn, toss.linear_velocities),
    )


def test_of_a_true_rig_there_is_nothing_to_corrected(tosses: tuple[Toss, ...]) -> None:
    evidence = measurements_of(tosses, CUBE)
    rig = evidence.calibration()
    assert np.degrees(rig.tilt) < 0.05
    assert rig.scale == pytest.approx(1.0, abs=0.005)
    assert evidence.rests.sum() == 12
    assert evidence.falls.sum() >= 8
    assert apply_calibration(tosses[0], NO_CORRECTION) is tosses[0]


def test_a_lean_and_a_short_metre_are_found_and_corrected(tosses: tuple[Toss, ...]) -> None:
    tracked = [mistracked(toss) for toss in tosses]
    true, rig = calibration_of(tosses, CUBE), calibration_of(tracked, CUBE)
    np.testing.assert_allclose(rig.normal, quaternions.rotate(quaternions.exp(LEAN), true.normal), atol=5e-4)
    assert rig.scale / true.scale == pytest.approx(1.0 / METRE, rel=2e-3)
    mended = calibration_of([apply_calibration(toss, rig) for toss in tracked], CUBE)
    assert np.degrees(mended.tilt) < 0.02
    assert mended.scale == pytest.approx(1.0, abs=2e-3)


def test_what_is_corrected_is_still_one_motion(tosses: tuple[Toss, ...]) -> None:
    tracked = mistracked(tosses[0])
    mended = apply_calibration(tracked, calibration_of([mistracked(toss) for toss in tosses], CUBE))
    dt = np.diff(tosses[0].stamps_ns)[:, np.newaxis] / 1e9
    for toss in (tosses[0], mended):
        np.testing.assert_allclose(np.diff(toss.positions, axis=0), dt * toss.linear_velocities[1:], atol=2e-3)
    rates = [kinematics(toss.stamps_ns, toss.positions, toss.orientations_wxyz) for toss in (tosses[0], mended)]
    apart = [one.angular_velocities - toss.angular_velocities for one, toss in zip(rates, (tosses[0], mended), strict=True)]
    np.testing.assert_allclose(apart[1], apart[0], atol=1e-9)
    heights = CUBE.corner_heights(mended.positions, mended.orientations_wxyz)
    assert np.ptp(np.sort(heights[-1])[:4]) < 1e-3
    assert mended.toss_id == tosses[0].toss_id


@pytest.mark.parametrize(
    "rig",
    [
        NO_CORRECTION,
        RigCalibration(scale=1.02, height=0.01, centre=(0.3, -0.2, 0.1)),
        RigCalibration((0.05, -0.03, 2.0), (0.3, -0.2, 0.1), 0.97, -0.02, (0.03, -0.05, 0.02), (0.004, 0.002, -0.003)),
    ],
)
def test_corners_of_one_pose_are_as_high_as_those_of_the_calibrated_toss(tosses: tuple[Toss, ...], rig: RigCalibration) -> None:
    expected = CUBE.corner_heights(*calibrated_poses(tosses[0].positions, tosses[0].orientations_wxyz, rig))
    heights = CornerHeights(CUBE.vertices, rig)
    orientations = [(w, x, y, z) for w, x, y, z in tosses[0].orientations_wxyz.tolist()]
    found = [heights(vector(place), turn) for place, turn in zip(tosses[0].positions, orientations, strict=True)]
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_a_normal_may_have_any_length(tosses: tuple[Toss, ...]) -> None:
    known = calibration_of([mistracked(toss) for toss in tosses], CUBE)
    x, y, z = known.normal
    rounded = RigCalibration((round(x / z, 5), round(y / z, 5), 1.0), known.centre, known.scale)
    assert rounded.tilt == pytest.approx(known.tilt, abs=1e-5)
    mended, other = apply_calibration(tosses[0], known), apply_calibration(tosses[0], rounded)
    np.testing.assert_allclose(other.positions, mended.positions, atol=2e-5)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"normal": (0.0, 0.0, -1.0)}, "normal: found .*, expected three numbers that point up"),
        ({"normal": (1.0, 0.0, 0.5)}, "normal: found"),
        ({"normal": (0.0, 1.0)}, "normal: found"),
        ({"normal": (0.0, 0.0, np.nan)}, "normal: found"),
        ({"centre": (0.0, np.inf, 0.0)}, "centre: found .*, expected three numbers"),
        ({"scale": 0.0}, "scale: found 0.0, expected a number from 0.5 to 2"),
        ({"scale": np.nan}, "scale: found nan"),
    ],
)
def test_what_can_be_no_rig_is_one_line(wrong: dict[str, Any], said: str) -> None:
    with pytest.raises(InvalidValueError, match=said):
        RigCalibration(**wrong)


def test_too_few_tosses_tell_no_rig(tosses: tuple[Toss, ...]) -> None:
    with pytest.raises(InvalidValueError, match="tosses that come to rest: found 3, expected at least 8"):
        calibration_of(tosses[:3], CUBE)
