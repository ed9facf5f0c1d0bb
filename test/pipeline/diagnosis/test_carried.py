"""What `check` says of recordings by a camera that an arm moves, and by several cameras."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.data.check_faults import Session, simulated_session
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.geometry import quaternions
from contact_curation.geometry.scalars import ScalarPose, compose, inverse, vector
from contact_curation.motion.pose_stream import FramePose
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.pipeline.diagnosis import FEWEST_MESSAGES, Diagnosis, diagnose
from contact_curation.pipeline.diagnosis.evidence import Evidence
from contact_curation.pipeline.diagnosis.findings.carried import out_of_step
from contact_curation.pipeline.diagnosis.recording import OTHERS, read_recording
from contact_curation.pipeline.reading import ReadingConfig
from contact_curation.storage.bags.writer import BagWriter
from contact_curation.storage.inputs.inputs import InputsConfig
from contact_curation.storage.inputs.pose_messages import POSE
from contact_curation.storage.inputs.pose_source import PoseTopicConfig
from test.storage.pose_recordings import message, transforms

TRANSFORM_NS = 10_000_000


@pytest.fixture(scope="module")
def session() -> Session:
    return simulated_session(tosses=8)


def camera(seconds: float, size: float = 0.1) -> ScalarPose:
    """Where an arm has the camera, over the board."""
    x, y, z = size * np.sin(np.array([2.0, 2.6, 1.4]) * seconds + np.arange(3.0))
    w, a, b, c = quaternions.exp([z - 2.2, x, y]).tolist()
    return ScalarPose((float(x), float(y) - 0.6, float(z) + 0.6), (w, a, b, c))


def diagnosed(
    path: Path, made: Session, moves: Callable[[float], ScalarPose] = camera, lead: float = 0.0, noise: float = 0.0
) -> Diagnosis:
    return diagnose([written(path, made, moves, lead, noise)], ReadingConfig(CONTACTNETS_CUBE))


def written(
    path: Path,
    made: Session,
    moves: Callable[[float], ScalarPose] = camera,
    lead: float = 0.0,
    noise: float = 0.0,
    before: float = 0.01,
) -> Path:
    """Poses in a camera's frame, and transforms at 100 Hz with that of `lead` later [s] and with noise [m].

    The transforms begin `before` the poses [s].
    """
    rng, first_ns = np.random.default_rng(0), int(made.stamps_ns[0])
    sent: list[tuple[int, FramePose]] = []
    for stamp_ns, row in zip(made.stamps_ns.tolist(), made.poses.tolist(), strict=True):
        seen = compose(inverse(moves(1e-9 * (stamp_ns - first_ns))), ScalarPose(tuple(row[:3]), tuple(row[3:])))
        sent.append((stamp_ns + 3_000_000, FramePose(stamp_ns, "camera", "body_cube", seen)))
    for stamp_ns in range(first_ns - int(before * NANOSECONDS), int(made.stamps_ns[-1]) + 3 * TRANSFORM_NS, TRANSFORM_NS):
        place, turn = moves(1e-9 * (stamp_ns - first_ns) + lead)
        rough = ScalarPose(vector(np.array(place) + noise * rng.standard_normal(3)), turn)
        sent.append((stamp_ns + 1_000_000, FramePose(stamp_ns, "body_surface", "camera", rough)))
    with BagWriter(path) as bag:
        for log_ns, one in sorted(sent, key=lambda each: each[0]):
            if one.child == "camera":
                bag.write("/tf", transforms([one]), log_ns)
            else:
                bag.write("/cube/pose", message(POSE, one), log_ns)
    return path


@pytest.mark.slow
def test_transforms_do_not_count_as_messages_of_the_body(session: Session, tmp_path: Path) -> None:
    """A robot sends more of them than a tracker sends poses, and tosses are what is looked at."""
    bag = written(tmp_path / "a.mcap", session)
    found = read_recording(bag, ReadingConfig(CONTACTNETS_CUBE), 1000)
    assert (len(found.measured), found.whole) == (1000, False)
    assert sum(found.counted.values()) > 1500
    assert read_recording(bag, ReadingConfig(CONTACTNETS_CUBE), len(session.poses) + 1).whole


@pytest.mark.slow
def test_poses_that_come_after_what_is_looked_at_are_no_fault_of_the_frame(session: Session, tmp_path: Path) -> None:
    bag = written(tmp_path / "a.mcap", session, before=1.1 * OTHERS * FEWEST_MESSAGES * TRANSFORM_NS / NANOSECONDS)
    found = diagnose([bag], ReadingConfig(CONTACTNETS_CUBE), most_messages=1)
    looked = OTHERS * FEWEST_MESSAGES
    assert f"no message of /cube/pose among the first {looked} of the recording: look at more of them" in found.verdict
    assert not any("--body-frame" in line for line in (found.verdict, *found.reasons))
    assert diagnose([bag], ReadingConfig(CONTACTNETS_CUBE), most_messages=looked).ok


@pytest.mark.parametrize("lead", [0.01, pytest.param(-0.03, marks=pytest.mark.slow)])
def test_transforms_that_are_out_of_step_are_named_and_no_wrong_body(lead: float, session: Session, tmp_path: Path) -> None:
    found = diagnosed(tmp_path / "a.mcap", session, lead=lead)
    named = [line for line in (found.verdict, *found.reasons) if "as 'camera' does: the transforms that move it are" in line]
    assert named, found
    assert f"are {1e3 * abs(lead):.0f} ms {'ahead of' if lead > 0.0 else 'behind'} the poses" in named[0]
    assert found.ok or found.verdict == named[0]
    assert found.settings.startswith("--set poses.transforms_ahead=")
    poses = PoseTopicConfig(transforms_ahead=float(found.settings.partition("=")[2]))
    assert poses.transforms_ahead == pytest.approx(lead, abs=5e-4)
    mended = diagnose([tmp_path / "a.mcap"], ReadingConfig(CONTACTNETS_CUBE, InputsConfig(poses=poses)))
    assert mended.ok
    assert not any("transforms" in line for line in (mended.verdict, *mended.reasons)), mended


@pytest.mark.slow
def test_of_two_cameras_that_arms_move_the_one_with_late_transforms_is_named(session: Session, tmp_path: Path) -> None:
    config = ReadingConfig(CONTACTNETS_CUBE)
    sound, late = (
        read_recording(written(tmp_path / f"{lead}.mcap", session, lead=lead), config, 10**6) for lead in (0.0, -0.03)
    )
    late = replace(late, carried=tuple(replace(one, frame="wrist") for one in late.carried))
    evidence = Evidence(config, (sound, late))
    (found,) = [one for one in evidence.wanders if one.by_lead]
    assert found.frame == "wrist"
    assert found.lead == pytest.approx(-0.03, abs=5e-4)
    said = out_of_step(evidence)
    assert said is not None
    assert "as 'wrist' does: the transforms that move it are 30 ms behind the poses" in said.line
    assert not said.settings, "it would move those of the sound camera, too"


@pytest.mark.slow
def test_noisy_transforms_are_named_and_no_filter_behind_the_tracker(session: Session, tmp_path: Path) -> None:
    found = diagnosed(tmp_path / "a.mcap", session, noise=4e-4)
    assert "mm in 'camera': the transforms between it and the board are noisy" in found.verdict
    assert not any("smoothed" in line for line in found.reasons), found


@pytest.mark.slow
@pytest.mark.parametrize("size", [0.0, 0.03, 0.1])
def test_of_a_sound_camera_on_an_arm_nothing_is_said(size: float, session: Session, tmp_path: Path) -> None:
    found = diagnosed(tmp_path / "a.mcap", session, lambda seconds: camera(seconds, size), noise=1e-5)
    assert found.ok
    assert not any("'camera' does" in line or "transforms" in line for line in (found.verdict, *found.reasons)), found


def by_two(path: Path, made: Session, sees: Callable[[int], str], apart: float = 0.0) -> Diagnosis:
    """Of the cameras that `sees` names for each frame, the second one in transforms `apart` from where it is [m]."""
    with BagWriter(path) as bag:
        first_ns = int(made.stamps_ns[0])
        cameras = {name: camera(seconds) for name, seconds in (("a", 0.0), ("b", 1.0))}
        x, y, z = cameras["b"].position
        told = {**cameras, "b": ScalarPose((x + apart, y, z), cameras["b"].orientation_wxyz)}
        static = [FramePose(0, "body_surface", name, pose, static=True) for name, pose in told.items()]
        bag.write("/tf_static", transforms(static), first_ns, latched=True)
        for frame, (stamp_ns, row) in enumerate(zip(made.stamps_ns.tolist(), made.poses.tolist(), strict=True)):
            for name in sees(frame):
                seen = compose(inverse(cameras[name]), ScalarPose(tuple(row[:3]), tuple(row[3:])))
                bag.write("/cube/pose", message(POSE, FramePose(stamp_ns, name, "body_cube", seen)), stamp_ns + 3_000_000)
    return diagnose([path], ReadingConfig(CONTACTNETS_CUBE))


def chosen(frame: int) -> str:
    """The one or the other, by chance."""
    return "ab"[int(np.random.default_rng(frame).integers(2))]


@pytest.mark.slow
@pytest.mark.parametrize("sees", [chosen, lambda frame: "ab"[frame // 40 % 2]])
def test_cameras_that_disagree_are_named_and_no_noise(sees: Callable[[int], str], session: Session, tmp_path: Path) -> None:
    found = by_two(tmp_path / "a.mcap", session, sees, apart=3e-3)
    assert "poses jump by 3 mm where they come from another one of 'a' and 'b'" in found.verdict
    assert not found.settings
    sound = by_two(tmp_path / "b.mcap", session, sees)
    assert sound.ok
    assert not any("poses jump" in line for line in (sound.verdict, *sound.reasons))


def test_noise_in_flight_is_no_disagreement_of_cameras_that_take_over_there(session: Session, tmp_path: Path) -> None:
    """As motion blur, or header stamps that jitter by a fraction of a millisecond, make it."""
    steps = np.linalg.norm(np.diff(session.poses[:, :3], axis=0, prepend=session.poses[:1, :3]), axis=1)
    flying = steps > 0.5 / 148.0
    noise = np.where(flying, 5e-4, 0.0)[:, np.newaxis] * np.random.default_rng(0).standard_normal((len(flying), 3))
    blurred = replace(session, poses=session.poses + np.pad(noise, [(0, 0), (0, 4)]))
    turns = np.cumsum(flying) // 7
    found = by_two(tmp_path / "a.mcap", blurred, lambda frame: "ab"[turns[frame] % 2])
    assert not any("poses jump" in line for line in (found.verdict, *found.reasons)), found


def test_a_camera_that_is_noisier_than_the_other_one_does_not_disagree_with_it(session: Session, tmp_path: Path) -> None:
    seldom = np.arange(len(session.poses)) % 20 < 5
    noise = np.where(seldom, 3e-4, 0.0)[:, np.newaxis] * np.random.default_rng(0).standard_normal((len(seldom), 3))
    blurred = replace(session, poses=session.poses + np.pad(noise, [(0, 0), (0, 4)]))
    found = by_two(tmp_path / "a.mcap", blurred, lambda frame: "ab"[int(seldom[frame])])
    assert not any("poses jump" in line for line in (found.verdict, *found.reasons)), found


def test_two_cameras_with_the_same_stamps_are_named_as_two(session: Session, tmp_path: Path) -> None:
    found = by_two(tmp_path / "a.mcap", session, lambda frame: "ab")
    assert "poses in 'a' and 'b' have the same ones: record a topic for each camera" in found.verdict
