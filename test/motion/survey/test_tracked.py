"""The tracked frame of bodies that tumble is found where it is not the described one; other errors are not taken for it."""

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.geometry import quaternions
from contact_curation.geometry.polytopes import box
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.calibration import RigCalibration, calibrated_poses
from contact_curation.motion.survey.falls import Survey, survey
from contact_curation.motion.survey.series import PoseSeries, series_of
from contact_curation.motion.survey.tracked import TrackedFrame, tracked_frame
from contact_curation.pipeline.diagnosis.diagnosis import concluded
from contact_curation.pipeline.diagnosis.evidence import Evidence
from contact_curation.pipeline.diagnosis.recording import Recording
from contact_curation.pipeline.reading import ReadingConfig
from test.simulated import simulated_tosses

SLAB = Body("slab", box([0.07, 0.05, 0.035]).vertices, 0.4, 0.4 / 3.0 * np.diag([0.0037, 0.0061, 0.0074]), 0.2, 0.05)
TRUE = tuple(series_of(toss) for toss in simulated_tosses(12, 5, body=SLAB))
HERE = np.zeros(3)
BESIDE = np.array([0.02, -0.015, 0.01])


def tracked(marker_turn: Array = HERE, marker_offset: Array = HERE, height: float = 0.0) -> tuple[PoseSeries, ...]:
    """The true poses as another tracked frame gives them, in which the described body's has this turn and place."""
    turn = quaternions.exp(marker_turn)
    return tuple(
        PoseSeries(
            one.stamps_ns,
            one.positions - quaternions.rotate(one.orientations_wxyz, marker_offset) + [0.0, 0.0, height],
            quaternions.multiply(one.orientations_wxyz, turn),
        )
        for one in TRUE
    )


def corrected(series: tuple[PoseSeries, ...], rig: RigCalibration) -> Survey:
    return survey([PoseSeries(one.stamps_ns, *calibrated_poses(one.positions, one.orientations_wxyz, rig)) for one in series])


def found_in(series: tuple[PoseSeries, ...], seen: Array | None = None, vertices: Array = SLAB.vertices) -> TrackedFrame | None:
    return tracked_frame(survey(series), vertices, HERE, seen)


@pytest.mark.parametrize("order", [(0, 2, 1), (1, 0, 2), (2, 1, 0), (1, 2, 0)])
def test_half_extents_in_another_order_are_a_frame_turned_by_right_angles(order: tuple[int, int, int]) -> None:
    found = found_in(TRUE, vertices=SLAB.vertices[:, order])
    assert found is not None
    assert found.is_turned
    np.testing.assert_allclose(
        np.ptp(quaternions.rotate(found.turn_wxyz, SLAB.vertices[:, order]), axis=0), np.ptp(SLAB.vertices, axis=0)
    )
    assert tracked_frame(corrected(TRUE, found.rig), SLAB.vertices[:, order], HERE, None) is None


@pytest.mark.parametrize("turn", [HERE, np.array([np.pi / 2.0, 0.0, 0.0])])
def test_a_marker_beside_the_body_is_found_by_what_bodies_turn_about(turn: Array) -> None:
    series = tracked(turn, BESIDE)
    seen = quaternions.rotate(quaternions.exp(-turn), BESIDE)
    found = found_in(series, seen)
    assert found is not None
    assert found.is_turned == bool(turn.any())
    assert np.linalg.norm(found.rig.marker_offset) == pytest.approx(np.linalg.norm(BESIDE))
    assert tracked_frame(corrected(series, found.rig), SLAB.vertices, HERE, None) is None


@pytest.mark.parametrize("vertices", [SLAB.vertices, 0.85 * SLAB.vertices, 1.2 * SLAB.vertices, SLAB.vertices + 0.2 * BESIDE])
@pytest.mark.parametrize("height", [0.0, 0.02])
def test_another_size_height_or_centre_of_mass_is_no_other_frame(vertices: Array, height: float) -> None:
    assert found_in(tracked(height=height), vertices=vertices) is None


def test_check_names_the_frame_and_its_settings_correct_it() -> None:
    body = Body("slab", SLAB.vertices[:, [0, 2, 1]], SLAB.mass, SLAB.inertia[:, [0, 2, 1]][[0, 2, 1]], 0.2, 0.05)
    told = concluded(Evidence(ReadingConfig(body), (Recording("a", series=TRUE),)))
    assert told.verdict.startswith("the tracked frame is not that of slab as described: the described x, y, z are its ")
    assert told.settings.startswith("--set rig.marker_turn=")
    assert "rig.height" not in told.settings
    assert not any("size off" in line or "--center-of-mass" in line for line in told.reasons)


def test_the_public_cube_has_its_described_frame() -> None:
    cube = survey([series_of(toss) for toss in simulated_tosses(12, 3)])
    assert tracked_frame(cube, CONTACTNETS_CUBE.vertices, HERE, np.array([0.0, 0.0, 0.0056])) is None
