"""Of rigs whose errors are known, throws tell which are the board's and which the marker's, and intervals hold the truth."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.geometry import quaternions
from contact_curation.geometry.polytopes import Polytope, box
from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.scalars import vector
from contact_curation.motion.calibration import calibrated_poses
from contact_curation.motion.survey.falls import survey
from contact_curation.motion.survey.mass_centre import mass_centre
from contact_curation.motion.survey.rig import RigEstimate, estimate_rig, worth_correcting
from test.motion.survey.rigs import MANY, Rig, Throws, recorded

CUBE, SLAB = CONTACTNETS_CUBE.polytope, box([0.06, 0.04, 0.025])
WEDGE = Polytope(np.array([[-5, -4, -3], [5, -4, -3], [-5, 4, -3], [5, 4, -3], [-5, -4, 5], [5, -4, 5]]) / 100.0)
RIGS = {
    "nothing": Rig(),
    "tilt": Rig(tilt=(0.02, -0.01)),
    "marker askew": Rig(marker_turn=(0.02, -0.03, 0.01)),
    "tilt, and marker askew": Rig(tilt=(0.015, 0.02), marker_turn=(-0.03, 0.02, 0.02)),
    "scale": Rig(scale=1.03),
    "height": Rig(height=0.006),
    "marker aside": Rig(marker_offset=(0.004, -0.006, 0.008)),
    "all": Rig((0.01, -0.02), -0.004, 0.97, (0.02, 0.03, -0.01), (0.005, 0.003, -0.006)),
}
ASKEW = Rig(tilt=(0.003, 0.0), height=0.001, marker_turn=(0.0, 0.03, 0.0), uneven=(3e-3, 4e-4))


def estimated(polytope: Polytope, rig: Rig, throws: Throws = MANY, seed: int = 0) -> RigEstimate:
    return estimate_rig(survey(recorded(polytope, rig, throws, seed)), polytope)


def truth(rig: Rig, found: RigEstimate) -> Array:
    """(10,) tilt, height at the centre of the calibration, scale, turn, place."""
    at_centre = rig.height - rig.scale * np.array(found.rig.centre) @ rig.up
    return np.array([*np.sin(rig.tilt), at_centre, rig.scale - 1.0, *rig.marker_turn, *rig.marker_offset])


@pytest.mark.slow
@pytest.mark.parametrize("name", RIGS)
@pytest.mark.parametrize("polytope", [CUBE, SLAB, WEDGE], ids=["cube", "slab", "wedge"])
def test_every_error_is_found_where_it_is_and_its_interval_holds_it(polytope: Polytope, name: str) -> None:
    rig = RIGS[name]
    found = estimated(polytope, rig)
    intervals = [*found.tilt, found.height, found.scale, *found.marker_turn, *found.marker_place]
    for interval, true in zip(intervals, truth(rig, found), strict=True):
        assert interval.low <= true <= interval.high
        assert interval.high - interval.low < 0.01
    assert found.needs_none == (name == "nothing")
    assert found.doubts == ()


def test_what_is_corrected_lies_flat_on_the_board() -> None:
    series = recorded(WEDGE, RIGS["all"])
    rig = worth_correcting(estimate_rig(survey(series), WEDGE))
    for one in series:
        positions, orientations = calibrated_poses(one.positions[-1:], one.orientations_wxyz[-1:], rig)
        corners = np.sort(WEDGE.corner_heights(positions, orientations)[0])
        assert np.abs(corners[:3]).max() < 5e-4


def test_heights_over_place_tell_a_marker_from_a_board_where_all_headings_are_one() -> None:
    rig = Rig(tilt=(0.003, 0.0), marker_turn=(0.0, 0.03, 0.0), uneven=(3e-3, 4e-4))
    found = estimated(CUBE, rig, Throws(80, faces=1, one_heading=True))
    assert not found.tilt_or_turn
    for interval, true in zip((*found.tilt, *found.marker_turn), (0.003, 0.0, 0.0, 0.03, 0.0), strict=True):
        assert interval.value == pytest.approx(true, abs=3e-3)


def test_one_face_under_one_heading_at_one_place_cannot_tell_them_apart_and_says_so() -> None:
    found = estimated(CUBE, ASKEW, Throws(40, faces=1, one_heading=True, spread=1e-3))
    assert found.tilt_or_turn
    assert "cannot tell a tilted board from a turned marker" in found.doubts[0]
    assert not any(found.rig.marker_turn)
    assert np.degrees(found.rig.tilt) == pytest.approx(np.degrees(0.033), abs=0.2)


def test_one_face_under_many_headings_can() -> None:
    found = estimated(CUBE, ASKEW, Throws(40, faces=1, spread=1e-3))
    assert not found.tilt_or_turn
    assert found.rig.tilt < 0.006


def test_one_face_cannot_tell_the_board_s_height_from_a_marker_aside() -> None:
    found = estimated(CUBE, Rig(height=0.004), Throws(40, faces=1))
    assert found.height_or_place
    assert "cannot tell a height of the board" in found.doubts[-1]
    assert found.height.value == pytest.approx(truth(Rig(height=0.004), found)[2], abs=3e-4)


def test_a_few_rests_cannot_tell_them_apart() -> None:
    found = estimated(CUBE, Rig(tilt=(0.02, 0.0)), Throws(6))
    assert found.tilt_or_turn
    assert len(found.doubts) >= 1
    assert estimated(CUBE, Rig(), Throws(6)).doubts == ()


def test_rests_that_are_none_move_nothing() -> None:
    rig = RIGS["tilt, and marker askew"]
    series = recorded(CUBE, rig, Throws(40))
    for one in series[::6]:  # it leans against something
        one.orientations_wxyz[45:] = recorded(CUBE, Rig(tilt=(0.1, -0.12)), Throws(1), seed=3)[0].orientations_wxyz[45]
    found = estimate_rig(survey(series), CUBE)
    np.testing.assert_allclose(found.rig.marker_turn, rig.marker_turn, atol=1.5e-3)


def test_a_centre_of_mass_that_was_described_in_true_metres_moves_no_marker() -> None:
    """Poses were moved by all of it, where lengths are 5 % too short: 3 mm too far."""
    rig, place = Rig(scale=1.05), np.array([0.05, -0.02, 0.03])
    series = recorded(SLAB, replace(rig, marker_offset=vector(place)), Throws(40, spin=6.0))
    for one in series:
        one.positions[:] += quaternions.rotate(one.orientations_wxyz, place)
    found = estimate_rig(survey(series), SLAB, described=place)
    assert not found.rig.has_marker
    assert found.scale.low <= 0.05 <= found.scale.high
    assert found.height.holds_none
    centre = mass_centre(survey(series))
    assert centre is not None
    assert centre.seen_from_described(found.rig, place).place == pytest.approx([0.0, 0.0, 0.0], abs=5e-4)
    assert estimate_rig(survey(series), SLAB).rig.has_marker


def test_a_marker_beside_the_centre_circles_and_does_not_change_the_scale() -> None:
    """Its own acceleration in the air is not gravity's: by 8 mm and 10 rad/s, 0.8 m/s^2 beside 9.81."""
    rig = Rig(marker_offset=(0.005, -0.004, 0.005))
    found = estimated(SLAB, rig, Throws(40, spin=6.0))
    assert found.length_scale.low <= 1.0 <= found.length_scale.high
    assert found.scale.high - found.scale.low < 0.01
    np.testing.assert_allclose(found.rig.marker_offset, rig.marker_offset, atol=5e-4)
