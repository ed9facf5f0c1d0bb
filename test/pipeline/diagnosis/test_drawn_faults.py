"""Kinds of faults that recordings drawn by chance had, and `check` took for others."""

import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from benchmarks.data import check_faults as fixed
from benchmarks.data.check_faults import Fault, Session, diagnosed, simulated_session, spoilt_bag
from benchmarks.data.check_faults_drawn import KINDS, Drawing
from benchmarks.data.thrown_bodies import bodies
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.design.releases import published_releases
from contact_curation.design.throw import throw_of_state
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.segmenter_config import SegmenterConfig
from contact_curation.motion.survey.falls import survey
from contact_curation.motion.survey.series import series_of
from contact_curation.pipeline.diagnosis import diagnose
from contact_curation.pipeline.diagnosis.evidence import Evidence
from contact_curation.pipeline.diagnosis.findings.body import other_shape
from contact_curation.pipeline.diagnosis.findings.smoothing import _colour, _sharpness, smoothed
from contact_curation.pipeline.diagnosis.recording import Recording
from contact_curation.pipeline.reading import ReadingConfig
from contact_curation.simulation.thrown_toss import ThrownTossConfig, thrown_toss
from contact_curation.storage.inputs.inputs import InputsConfig
from test.motion.survey.rigs import Rig, Throws, recorded
from test.simulated import simulated_tosses


@pytest.fixture(scope="module")
def session() -> Session:
    return simulated_session(tosses=6)


def test_lost_frames_are_named_before_the_falls_that_they_hide(session: Session, tmp_path: Path) -> None:
    fault = Fault("22 % dropped", fixed.dropped(0.22), "")
    found = diagnosed(spoilt_bag(tmp_path / "a.mcap", fault, session), fault)
    assert not found.ok
    assert "frames are missing between others" in found.verdict


def test_stamps_that_were_closed_up_over_lost_frames_are_named(session: Session, tmp_path: Path) -> None:
    fault = Fault("closed up", fixed.closed_up(6), "")
    found = diagnosed(spoilt_bag(tmp_path / "a.mcap", fault, session), fault)
    assert "stamps were closed up" in found.verdict
    assert "segmenter.closed_up=true" in found.settings


def test_closing_up_is_no_advice_where_the_tracker_wrote_the_stamps(session: Session, tmp_path: Path) -> None:
    def change(made: Session, rng: np.random.Generator) -> Session:
        closed = fixed.closed_up(6)(made, rng)
        return replace(closed, stamps_ns=closed.stamps_ns + np.rint(3e4 * rng.standard_normal(len(closed.poses))).astype(int))

    fault = Fault("closed up, with jitter", change, "")
    found = diagnosed(spoilt_bag(tmp_path / "a.mcap", fault, session), fault)
    assert "stamps were closed up" in found.verdict
    assert "segmenter.closed_up=true" not in found.settings


def first_impacts(made: Session) -> list[int]:
    """Where bodies that fall meet the board."""
    low = made.poses[:, 2] < 0.09
    falling = np.gradient(made.poses[:, 2]) * 148.0 < -0.3
    met = np.flatnonzero(low[1:] & ~low[:-1] & falling[1:])
    return [int(one) for one in met]


@pytest.mark.slow
@pytest.mark.parametrize("frames", [1, 4])
@pytest.mark.parametrize(("share", "how"), [(0.0, "repeat the one before"), (1.0, "lie on a straight line between others")])
def test_poses_that_are_made_up_while_the_object_is_hidden_are_named(
    share: float, how: str, frames: int, session: Session, tmp_path: Path
) -> None:
    """Those before, or on the way to those after."""

    def change(made: Session, rng: np.random.Generator) -> Session:
        poses, ways = made.poses.copy(), share * np.arange(1, frames + 1)[:, np.newaxis] / (frames + 1)
        for hit in first_impacts(made):
            poses[hit + 1 : hit + 1 + frames] = (1.0 - ways) * poses[hit] + ways * poses[hit + 1 + frames]
        poses[:, 3:] /= np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
        return replace(made, poses=poses)

    fault = Fault("hidden", change, "")
    found = diagnosed(spoilt_bag(tmp_path / "a.mcap", fault, session), fault)
    named = [line for line in (found.verdict, *found.reasons) if f"poses {how} for" in line]
    assert named, found
    assert ("one frame" if frames == 1 else f"up to {frames} frames") in named[0]
    assert "publish nothing where the object is not seen" in named[0]


@pytest.mark.parametrize(("millimetres", "degrees"), [(3.0, 0.0), (0.3, 0.0), (0.0, 0.5)])
def test_two_cameras_that_disagree_are_named(millimetres: float, degrees: float, session: Session, tmp_path: Path) -> None:
    def change(made: Session, rng: np.random.Generator) -> Session:
        poses, turn = made.poses.copy(), quaternions.exp([0.0, 0.0, np.radians(degrees)])
        poses[1::2, 0] += 1e-3 * millimetres
        poses[1::2, 3:] = quaternions.multiply(np.broadcast_to(turn, poses[1::2, 3:].shape), poses[1::2, 3:])
        return replace(made, poses=poses)

    fault = Fault("two cameras", change, "")
    found = diagnosed(spoilt_bag(tmp_path / "a.mcap", fault, session), fault)
    named = [line for line in (found.verdict, *found.reasons) if "two cameras that disagree?" in line]
    assert named, found
    size = f"{degrees:g} degrees" if degrees else f"{millimetres:g} mm"
    assert size in named[0], named


def test_rounded_poses_that_jump_to_and_fro_are_not_of_two_cameras(session: Session, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)

    def published(poses: Array) -> Array:
        rounded = np.round(poses[:, :3], 3)
        lies = np.all(np.diff(rounded, axis=0, prepend=rounded[:1]) == 0.0, axis=1)
        rounded[lies, 0] += 1e-3 * rng.integers(0, 2, np.count_nonzero(lies))  # between two steps of the rounding
        return np.concatenate([rounded, poses[:, 3:]], axis=1)

    fault = Fault("rounded", fixed.published(published), "")
    found = diagnosed(spoilt_bag(tmp_path / "a.mcap", fault, session), fault)
    assert not any("two cameras" in line for line in (found.verdict, *found.reasons)), found


@pytest.mark.parametrize(
    ("earlier_ns", "steps", "setting"),
    [(1_756_757, "5 and 8.51", "segmenter.largest_gap=1.9"), (1_000_000, "5.76 and 7.76", "")],
)
def test_two_cameras_that_see_by_turns_are_named_and_falls_are_seen(
    earlier_ns: int, steps: str, setting: str, session: Session, tmp_path: Path
) -> None:
    """Without their true times nothing falls on a parabola."""

    def change(made: Session, rng: np.random.Generator) -> Session:
        stamps = made.stamps_ns.copy()
        stamps[1::2] -= earlier_ns
        moved = np.stack([np.interp(stamps, made.stamps_ns, column) for column in made.poses.T], axis=1)
        moved[:, 3:] /= np.linalg.norm(moved[:, 3:], axis=1, keepdims=True)
        return replace(made, stamps_ns=stamps, poses=moved)

    fault = Fault("two cameras", change, "")
    bag = spoilt_bag(tmp_path / "a.mcap", fault, session)
    found = diagnosed(bag, fault)
    assert any(f"by turns {steps} ms after the last" in line for line in (found.verdict, *found.reasons)), found
    assert setting in found.settings
    assert ("largest_gap" in found.settings) == bool(setting)
    assert re.search(r"[56] throws at 9\.[5-9]", str(found))


@pytest.mark.slow
@pytest.mark.parametrize(("flipped", "said"), [(1, False), (2, True)])
def test_a_third_of_the_motions_that_flip_have_a_hint(flipped: int, said: bool, session: Session, tmp_path: Path) -> None:
    def change(made: Session, rng: np.random.Generator) -> Session:
        poses = made.poses.copy()
        for hit in first_impacts(made)[:flipped]:
            w, x, y, z = poses[hit - 3, 3:]
            poses[hit - 3 : hit - 1, 3:] = -x, w, z, -y  # half a turn about the body's x
        return replace(made, poses=poses)

    fault = Fault("flipped", change, "")
    found = diagnosed(spoilt_bag(tmp_path / "a.mcap", fault, session), fault)
    assert f"{1 + flipped} of 6 motions rejected" in str(found)  # one for another reason
    assert ("orientations jump: flipped tags, or a symmetric body?" in str(found)) == said


def test_bodies_that_are_caught_and_held_are_not_called_another_shape(session: Session, tmp_path: Path) -> None:
    def change(made: Session, rng: np.random.Generator) -> Session:
        poses = made.poses.copy()
        for first, stop in pairwise([*first_impacts(made), len(poses)]):
            held = slice(first, min(first + 150, stop))
            poses[held] = poses[first]
            poses[held, 2] += np.minimum(np.arange(held.stop - first) / 200.0, 0.15)  # lifted
        poses[:, :3] += 1e-5 * rng.standard_normal((len(poses), 3))
        return replace(made, poses=poses)

    fault = Fault("caught", change, "")
    found = diagnosed(spoilt_bag(tmp_path / "a.mcap", fault, session), fault)
    assert not found.ok
    assert "off every face" not in str(found)


def test_noise_that_grows_with_speed_is_called_blur(session: Session, tmp_path: Path) -> None:
    def change(made: Session, rng: np.random.Generator) -> Session:
        speeds = np.linalg.norm(np.gradient(made.poses[:, :3], axis=0), axis=1) * 148.0
        return made.moved(lambda p: p + (2e-5 + 2e-4 * speeds)[:, np.newaxis] * rng.standard_normal((len(p), 3)))

    fault = Fault("blur", change, "")
    verdict = diagnosed(spoilt_bag(tmp_path / "a.mcap", fault, session), fault).verdict
    assert "while bodies fly: noise grows with speed" in verdict
    assert "a shorter exposure, since images are blurred" in verdict


def test_means_of_each_pose_and_the_last_are_warned_of(session: Session, tmp_path: Path) -> None:
    """Tosses pass, but impacts are spread, and models learn too little friction."""

    def change(made: Session, rng: np.random.Generator) -> Session:
        poses = made.poses.copy()
        for row in range(1, len(poses)):
            sign = np.sign(poses[row, 3:] @ poses[row - 1, 3:])
            poses[row] = 0.5 * poses[row] * [1.0, 1.0, 1.0, *[sign] * 4] + 0.5 * poses[row - 1]
        poses[:, 3:] /= np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
        return replace(made, poses=poses)

    fault = Fault("exponential", change, "")
    found = diagnosed(spoilt_bag(tmp_path / "a.mcap", fault, session), fault)
    assert any("smoothed" in line and "record raw poses" in line for line in (found.verdict, *found.reasons)), found


def test_outliers_are_named_before_the_impacts_that_they_spread(session: Session, tmp_path: Path) -> None:
    def change(made: Session, rng: np.random.Generator) -> Session:
        hit = rng.random(len(made.poses)) < 0.06
        return made.moved(lambda p: p + np.where(hit[:, np.newaxis], 0.02 * rng.standard_normal((len(p), 3)), 0.0))

    fault = Fault("outliers", change, "")
    assert "outliers" in diagnosed(spoilt_bag(tmp_path / "a.mcap", fault, session), fault).verdict


@pytest.mark.parametrize("millimetres", [1.0, 2.0])
def test_noise_in_which_no_fall_can_be_seen_is_named_and_nothing_that_it_looks_like(
    session: Session, tmp_path: Path, millimetres: float
) -> None:
    def change(made: Session, rng: np.random.Generator) -> Session:
        return made.moved(lambda p: p + 1e-3 * millimetres * rng.standard_normal((len(p), 3)))

    fault = Fault("noise", change, "")
    found = diagnosed(spoilt_bag(tmp_path / "a.mcap", fault, session), fault)
    scatter = re.search(r"positions scatter by ([\d.]+) mm", found.verdict)
    assert scatter is not None
    assert float(scatter[1]) == pytest.approx(millimetres, rel=0.1)
    assert not any("feet" in line or "smoothed" in line or "z-down" in line for line in found.reasons)
    assert f"or try {found.settings}" in found.verdict
    assert float(found.settings.removeprefix("--set segmenter.tracker_noise=")) == pytest.approx(millimetres / 0.022, rel=0.1)


def test_noise_that_the_segmenter_was_told_of_is_a_warning_where_tosses_are_found(session: Session, tmp_path: Path) -> None:
    def change(made: Session, rng: np.random.Generator) -> Session:
        return fixed.every(2)(made, rng).moved(lambda p: p + 1e-3 * rng.standard_normal(p.shape))

    bag = spoilt_bag(tmp_path / "a.mcap", Fault("noise", change, ""), session)
    found = diagnose([bag], ReadingConfig(CONTACTNETS_CUBE, InputsConfig(segmenter=SegmenterConfig(tracker_noise=45.0))))
    assert found.ok
    assert "expected 0.62 mm at most: rig and body cannot be checked" in found.verdict
    assert found.settings == ""


@pytest.mark.parametrize(
    ("metres", "said"),
    [
        (0.01, "bodies at rest lie on the board, so impacts press them into it"),
        (0.02, "poses jump, or are made up where the body is not seen"),
    ],
)
def test_impacts_that_go_deep_though_rests_lie_on_the_board_are_not_called_a_wrong_height(
    metres: float, said: str, session: Session, tmp_path: Path
) -> None:
    def change(made: Session, rng: np.random.Generator) -> Session:
        positions = made.poses[:, :3]
        speeds = np.linalg.norm(np.gradient(positions, axis=0), axis=1) * 148.0
        deep = (speeds > 0.3) & (positions[:, 2] < 0.08)
        return made.moved(lambda p: p - np.outer(metres * deep, [0.0, 0.0, 1.0]))

    fault = Fault("soft", change, "")
    verdict = diagnosed(spoilt_bag(tmp_path / "a.mcap", fault, session), fault).verdict
    assert said in verdict


def test_a_wedge_described_in_millimetres_is_named_as_that(tmp_path: Path) -> None:
    """Its faces are at several distances, so that no height of the board corrects it."""
    uneven = np.diag([1.0, 0.8, 0.6])
    made = simulated_session(tosses=8)
    body = replace(CONTACTNETS_CUBE, vertices=1000.0 * CONTACTNETS_CUBE.vertices @ uneven)
    fault = Fault("in mm", fixed.same, "", body=body)
    assert "vertices in mm" in diagnosed(spoilt_bag(tmp_path / "a.mcap", fault, made), fault).verdict


def test_a_body_of_more_corners_than_the_solver_takes_is_diagnosed_all_the_same(session: Session, tmp_path: Path) -> None:
    many = next(one.body for one in bodies() if len(one.body.vertices) > 32)
    fault = Fault("of 40 corners", fixed.same, "", body=replace(many, name="cube"))
    assert diagnosed(spoilt_bag(tmp_path / "a.mcap", fault, session), fault).verdict


def test_poses_without_noise_are_simulated_not_smoothed() -> None:
    """Perfect parabolas between a hand and a touch: a kink at an end is no noise, and what has no noise has no colour."""
    series = recorded(CONTACTNETS_CUBE.polytope, Rig(noise=0.0), Throws(8))
    for one in series:
        one.positions[:4, 0] += 1e-4 * np.array([4.0, 2.0, 1.0, 0.5])
    assert _colour(survey(series)) is None
    noisy = recorded(CONTACTNETS_CUBE.polytope, Rig(noise=2e-5), Throws(8))
    assert _colour(survey(noisy)) == pytest.approx(-0.75, abs=0.1)


def test_a_single_pose_that_is_off_beside_an_impact_does_not_spread_it() -> None:
    """It pushes up on either side and pulls down between, as no contact does, and no filter of an impact."""
    series = recorded(CONTACTNETS_CUBE.polytope, Rig(noise=2e-5), Throws(12))
    found = survey(series)
    sharp = _sharpness(found)
    for throw in found.throws[: len(sharp) // 2]:
        found.series[throw.flights[0].series].positions[throw.flights[0].stop + 4, 2] += 0.05
    left = _sharpness(found)
    assert 0 < len(left) < len(sharp)
    assert set(left.tolist()) < set(sharp.tolist())


def test_noise_is_that_of_flights_where_a_hand_moves_the_body() -> None:
    series = recorded(CONTACTNETS_CUBE.polytope, Rig(noise=2e-5), Throws(8))
    for one in series:
        at = np.arange(len(one))
        swung = np.where(at > 45, 2e-3 * np.sin(0.9 * at), 0.0)
        one.positions[:, 1] += swung
    assert survey(series).noise == pytest.approx(2e-5, rel=0.3)


def test_a_recording_that_ends_in_the_air_falls_all_the_same() -> None:
    series = recorded(CONTACTNETS_CUBE.polytope, Rig(), Throws(8))
    cut = [
        replace(one, stamps_ns=one.stamps_ns[:36], positions=one.positions[:36], orientations_wxyz=one.orientations_wxyz[:36])
        for one in series
    ]
    found = survey(cut)
    assert found.gravity is not None
    assert found.gravity[2] == pytest.approx(-9.81, rel=0.01)


def test_every_kind_of_fault_can_be_drawn() -> None:
    def drawn(seed: int) -> list[str]:
        rng = np.random.default_rng(seed)
        return [kind(Drawing(rng, CONTACTNETS_CUBE, (bodies()[3].body,), 120)).name for kind in KINDS]

    assert drawn(0) == drawn(0) != drawn(1)
    assert len(KINDS) >= 35


def test_poses_that_are_there_twice_are_a_warning_and_count_once(session: Session, tmp_path: Path) -> None:
    fault = Fault("twice", lambda made, _: made.only(np.repeat(np.arange(len(made.poses)), 2)), "")
    found = diagnosed(spoilt_bag(tmp_path / "a.mcap", fault, session), fault)
    assert found.ok
    assert "poses are there twice, and count once" in found.verdict


@pytest.mark.parametrize(("rate", "noise"), [(60.0, 0.0), (500.0, 0.0), (1000.0, 0.0), (500.0, 6e-5), (1000.0, 6e-5)])
def test_recordings_of_other_rates_are_as_sound_as_those_of_148_hz(rate: float, noise: float) -> None:
    config = ThrownTossConfig(frame_period=1.0 / rate)
    throws = [throw_of_state(f"{n}", "cube", one) for n, one in enumerate(published_releases(8, np.random.default_rng(5)))]
    tosses, rng = tuple(thrown_toss(CONTACTNETS_CUBE, throw, config) for throw in throws), np.random.default_rng(0)
    series = tuple(
        replace(one, positions=one.positions + noise * rng.standard_normal(one.positions.shape))
        for one in map(series_of, tosses)
    )
    evidence = Evidence(ReadingConfig(CONTACTNETS_CUBE), (Recording("a", series=series, outcomes=tosses),))
    assert evidence.fall is not None
    assert evidence.fall.sound
    assert len(evidence.survey.throws) >= 7
    assert len(_sharpness(evidence.survey)) >= (2 if rate < 100.0 else 7)  # frames around an impact
    assert np.percentile(_sharpness(evidence.survey), 90) > 0.9
    assert smoothed(evidence) is None


def test_bodies_that_are_still_off_every_face_are_no_other_shape_where_tosses_end_flat() -> None:
    series = tuple(recorded(CONTACTNETS_CUBE.polytope, Rig(uneven=(0.3, 1e-4)), Throws(8)))
    config, tosses = ReadingConfig(CONTACTNETS_CUBE), simulated_tosses(8, 0)
    assert other_shape(Evidence(config, (Recording("a", series=series),))) is not None
    assert other_shape(Evidence(config, (Recording("a", series=series, outcomes=tosses),))) is None
