"""Positions in another frame than orientations are found by impacts, where falls and rests look sound."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.contact.body import Body
from contact_curation.geometry import quaternions
from contact_curation.geometry.polytopes import box
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.survey.one_frame import OtherFrame, other_frame
from contact_curation.motion.survey.series import series_of
from contact_curation.motion.toss import Toss
from contact_curation.pipeline.diagnosis.diagnosis import concluded
from contact_curation.pipeline.diagnosis.evidence import Evidence
from contact_curation.pipeline.diagnosis.recording import Recording
from contact_curation.pipeline.reading import ReadingConfig
from test.simulated import RIG_NOISE, simulated_tosses

SLAB = Body("slab", box([0.07, 0.05, 0.035]).vertices, 0.4, 0.4 / 3.0 * np.diag([0.0037, 0.0061, 0.0074]), 0.2, 0.05)
TRUE = simulated_tosses(16, 5, RIG_NOISE, SLAB)
MIRROR = np.diag([1.0, -1.0, 1.0])


def moved(change: Array) -> tuple[Toss, ...]:
    """The tosses with positions alone in another frame."""
    pairs = [(toss, (toss.positions @ change.T, toss.linear_velocities @ change.T)) for toss in TRUE]
    return tuple(replace(toss, positions=places, linear_velocities=rates) for toss, (places, rates) in pairs)


def verdict_of(tosses: tuple[Toss, ...]) -> str:
    recording = Recording("a", outcomes=tosses, series=tuple(series_of(toss) for toss in tosses))
    found = concluded(Evidence(ReadingConfig(SLAB), (recording,)))
    assert not found.ok
    return found.verdict


def found_in(tosses: tuple[Toss, ...]) -> OtherFrame | None:
    return other_frame(tosses, SLAB.vertices, SLAB.inertia / SLAB.mass, SLAB.gravity)


def test_poses_in_one_frame_are_sound() -> None:
    assert found_in(TRUE) is None
    assert found_in(TRUE[:1]) is None
    assert found_in(()) is None


def test_poses_that_are_mirrored_altogether_are_a_body_in_a_mirror() -> None:
    back = np.array([1.0, -1.0, 1.0, -1.0])
    both = zip(moved(MIRROR), TRUE, strict=True)
    mirrored = [
        replace(
            one,
            orientations_wxyz=back * toss.orientations_wxyz,
            angular_velocities=back[1:] * toss.angular_velocities,
        )
        for one, toss in both
    ]
    assert found_in(tuple(mirrored)) is None


def test_positions_that_are_mirrored_alone_are_found() -> None:
    found = found_in(moved(MIRROR))
    assert found is not None
    assert found.mirrored
    assert min(found.angle, 360.0 - found.angle) <= 20.0


@pytest.mark.parametrize("degrees", [90.0, 180.0])
def test_positions_that_are_turned_alone_are_found(degrees: float) -> None:
    found = found_in(moved(quaternions.to_matrix(quaternions.exp(np.radians([0.0, 0.0, degrees])))))
    assert found is not None
    assert not found.mirrored
    assert found.angle == pytest.approx(360.0 - degrees, abs=20.0)


@pytest.mark.parametrize("degrees", [90, -90, 45])
def test_it_is_said_how_positions_are_turned(degrees: int) -> None:
    tosses = moved(quaternions.to_matrix(quaternions.exp(np.radians([0.0, 0.0, degrees]))))
    assert verdict_of(tosses).startswith(
        f"positions are turned by {degrees:+d} degrees about the vertical against orientations"
    )


def test_it_is_the_verdict_where_falls_and_rests_are_sound() -> None:
    assert verdict_of(moved(MIRROR)).startswith("positions are mirrored against orientations: read so, ")
