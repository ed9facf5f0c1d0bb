"""A board that is not level is named; caught bodies and simulated poses without noise are not taken for faults."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.data.thrown_bodies import ellipsoid
from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.geometry import quaternions
from contact_curation.geometry.polytopes import Polytope, box
from contact_curation.geometry.solids.shapes import cylinder
from contact_curation.motion.survey.series import PoseSeries
from contact_curation.pipeline.diagnosis import diagnose
from contact_curation.pipeline.diagnosis.evidence import Evidence
from contact_curation.pipeline.diagnosis.finding import Severity
from contact_curation.pipeline.diagnosis.findings.body import other_shape, round_side
from contact_curation.pipeline.diagnosis.findings.poses import outliers
from contact_curation.pipeline.diagnosis.findings.rig import height, incline
from contact_curation.pipeline.diagnosis.findings.smoothing import smoothed
from contact_curation.pipeline.diagnosis.findings.tosses import never_at_rest
from contact_curation.pipeline.diagnosis.recording import Recording
from contact_curation.pipeline.reading import ReadingConfig
from contact_curation.pipeline.recordings.poses import write_poses
from contact_curation.simulation.world import WorldConfig, free_motion
from test.motion.survey.rigs import FLYING, GRAVITY, RATE, Rig, Throws, recorded
from test.simulated import RIG_NOISE, release_states, simulated_tosses, with_noise

SLAB = box([0.06, 0.04, 0.025])
BODY = Body("slab", SLAB.vertices, 0.3, CONTACTNETS_CUBE.inertia, 0.3, 0.05)


def evidence(series: list[PoseSeries]) -> Evidence:
    return evidence_of(BODY, series)


def evidence_of(body: Body, series: list[PoseSeries]) -> Evidence:
    return Evidence(ReadingConfig(body), (Recording("a", series=tuple(series)),))


def askew(one: PoseSeries, degrees: float) -> PoseSeries:
    """A throw over a board that is inclined by so much, in its frame."""
    pulled = np.zeros_like(one.positions)
    pulled[:FLYING, 0] = 0.5 * GRAVITY * np.tan(np.radians(degrees)) * (np.arange(FLYING) / RATE) ** 2
    return PoseSeries(one.stamps_ns, one.positions + pulled, one.orientations_wxyz)


@pytest.mark.parametrize(("degrees", "severity"), [(0.3, None), (1.0, Severity.WARNING), (3.0, Severity.FAULT)])
def test_a_board_that_is_not_level_is_named(degrees: float, severity: Severity | None) -> None:
    found = incline(evidence([askew(one, degrees) for one in recorded(SLAB, Rig(), Throws(20))]))
    assert (None if found is None else found.severity) == severity
    assert found is None or f"{degrees:.1f} degrees askew to the board" in found.what


@pytest.mark.parametrize("rig", [Rig(), Rig(tilt=(0.05, -0.02)), Rig(noise=3e-4), Rig(marker_offset=(0.02, 0.0, 0.01))])
def test_a_frame_that_is_tilted_on_a_level_board_is_no_incline(rig: Rig) -> None:
    assert incline(evidence(recorded(SLAB, rig, Throws(20)))) is None


@pytest.mark.parametrize("kept", [2, 3])
def test_bodies_that_are_held_in_the_air_do_not_rest(kept: int) -> None:
    rng = np.random.default_rng(2)
    series = recorded(SLAB, Rig(), Throws(24))
    for number, one in enumerate(series):
        if number % kept:
            held = one.positions.copy(), one.orientations_wxyz.copy()
            held[0][FLYING:, 2] = 0.5
            held[1][FLYING:] = quaternions.normalized(rng.standard_normal(4))
            series[number] = PoseSeries(one.stamps_ns, *held)
    seen = evidence(series)
    assert sum(throw.rest is not None for throw in seen.survey.throws) == 24 // kept
    assert other_shape(seen) is None
    found = never_at_rest(seen)
    assert (found is not None) == (kept == 3)


def test_simulated_poses_without_noise_are_not_smoothed_where_a_corner_touches() -> None:
    series = recorded(SLAB, Rig(noise=0.0), Throws(8))
    for number in (0, 1):
        touched = series[number].positions.copy()
        pushed = 3e-6 * np.random.default_rng(number).standard_normal((FLYING, 3))
        touched[:FLYING] += pushed.cumsum(axis=0).cumsum(axis=0).cumsum(axis=0)
        series[number] = PoseSeries(series[number].stamps_ns, touched, series[number].orientations_wxyz)
    assert smoothed(evidence(series)) is None


@pytest.mark.parametrize(("hop", "said"), [((0.9, 1.5, 0.9), False), ((0.0, 1.5, 0.0), True)])
def test_a_body_that_hops_before_it_lies_still_is_no_outlier(hop: tuple[float, float, float], said: bool) -> None:
    series = recorded(SLAB, Rig(), Throws(20))
    for one in series:
        for first in range(len(one) - 60, len(one) - 12, 12):
            one.positions[first : first + 3, 2] += 0.001 * np.array(hop)
    assert (outliers(evidence(series)) is not None) is said


def test_a_body_of_many_corners_rests_on_its_own_faces(tmp_path: Path) -> None:
    corners = ellipsoid(60, [0.07, 0.05, 0.04])
    file = tmp_path / "rock.yaml"
    file.write_text(f"name: rock\nmass: 0.3\ninertia: [2.2e-4, 3.5e-4, 4.0e-4]\nvertices: {corners.tolist()}\n")
    series = recorded(Polytope(corners), Rig(), Throws(20))
    seen = evidence_of(Body.from_file(file), series)
    assert other_shape(seen) is None
    assert seen.rig is not None
    assert seen.rig.tilt_degrees < 0.3


def test_a_round_body_that_rests_between_the_faces_of_its_corners_is_named_with_settings() -> None:
    can = cylinder(0.033, 0.12)
    prism = Polytope(can.points)
    body = Body("can", can.points, 0.35, CONTACTNETS_CUBE.inertia, 0.3, 0.037)
    rolled = quaternions.exp(np.array([0.0, 0.0, np.pi / 16.0]))  # half way from face to face
    series = [
        PoseSeries(one.stamps_ns, one.positions, quaternions.multiply(one.orientations_wxyz, rolled))
        for one in recorded(prism, Rig(), Throws(20))
    ]
    seen = evidence_of(body, series)
    found = round_side(seen)
    assert found is not None
    assert "22.5 degrees apart and stand for a round side" in found.what
    assert found.settings[1] == "gates.rest_tilt=0.24"
    assert other_shape(seen) is None
    assert round_side(evidence(recorded(SLAB, Rig(), Throws(20)))) is None


def test_bodies_that_fall_off_a_board_on_which_others_rest_set_no_height_of_it() -> None:
    series = recorded(SLAB, Rig(), Throws(20))
    for number, one in enumerate(series[:14]):
        fallen = one.positions - np.array([0.0, 0.0, 0.7])
        series[number] = PoseSeries(one.stamps_ns, fallen, one.orientations_wxyz)
    others = Evidence(ReadingConfig(BODY), (Recording("a", series=tuple(series)),))
    assert (found := height(others)) is not None
    assert found.rig is not None
    outcomes = tuple(replace(one, body="slab") for one in simulated_tosses(2, 1))
    beside = Evidence(ReadingConfig(BODY), (Recording("a", series=tuple(series), outcomes=outcomes),))
    assert (found := height(beside)) is not None
    assert found.rig is None
    assert "and 2 tosses on it: do bodies fall off the board? record throws that stay on it" in found.line


def test_a_die_that_falls_from_a_centimetre_is_not_smoothed(tmp_path: Path) -> None:
    """Impacts so slow are soft, and falls so short show no gravity; all the same they are tosses."""
    small = 0.004 / CONTACTNETS_CUBE.length_scale
    die = Body("die", box([0.004] * 3).vertices, 0.001, np.full(3, 1.07e-8), 0.2, 0.004)
    rng = np.random.default_rng(0)
    units = np.repeat([small, 1.0, small**0.5, small**-0.5], [3, 4, 3, 3])
    motions = [
        with_noise(free_motion(die, release, 90, 1.0 / 148.0, WorldConfig.of_body(die)), RIG_NOISE, rng)
        for release in release_states(10, rng) * units
    ]
    times = np.concatenate([number * 3.0 + np.arange(90) / 148.0 for number in range(10)])
    states = np.concatenate(motions)
    write_poses(tmp_path / "a.mcap", times, states[:, :3], states[:, 3:7], die)
    found = diagnose([tmp_path / "a.mcap"], ReadingConfig(die))
    assert found.ok, found
    assert not any("smoothed" in line for line in found.reasons), found
    assert "falls are too short to measure gravity by" in found.verdict
