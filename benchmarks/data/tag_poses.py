"""How good are poses from rendered tags, and do tosses ingested from them rank like those of true poses?

Tosses of the cube are simulated by MuJoCo, rendered frame by frame at 148 Hz, and their tags detected; that is kept in a
folder, a file per toss, so that a run goes on where the last one stopped. Then the detections go the way that `pose_ingest` and
`rank` take them: joint pose of all visible tags, flip and jump gates, tosses, gates, and a ranking at a theta that was fitted
to other tosses with true poses. Wanted are under 1 mm and 0.5 degrees (median), no flip past the gates, and a Spearman
correlation of log-det over 0.9.

    python -m benchmarks.data.tag_poses [--tosses N] [--seed N] [--folder DIR] [--json]
"""

import argparse
import json
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from contact_curation.contact.body import CONTACTNETS_CUBE as CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form
from contact_curation.geometry import quaternions
from contact_curation.geometry.poses import Pose
from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.scalars import ScalarPose
from contact_curation.geometry.tag_rig import TagRig, rig_of
from contact_curation.information.ranker import RankingConfig, rank
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import Scorer, ScoringConfig
from contact_curation.learning.fits.polytope_fit import fit_polytope
from contact_curation.motion.body_tracker import BodyPose, BodyTracker, TrackerConfig
from contact_curation.motion.ingest import IngestConfig, TossIngest
from contact_curation.motion.pose_stream import BadPose, FramePose
from contact_curation.motion.segmenter_config import SegmenterConfig
from contact_curation.motion.tags.pose import TagPoseConfig
from contact_curation.motion.toss import NANOSECONDS, Rejected, Toss
from contact_curation.motion.transitions import transitions_of
from contact_curation.simulation.camera.camera import CameraConfig, CameraView
from contact_curation.simulation.camera.tag_detection import TagDetector
from contact_curation.simulation.world import free_motion
from contact_curation.storage.inputs.pose_messages import Measured
from contact_curation.storage.inputs.pose_source import PoseTopicConfig
from contact_curation.storage.inputs.tag_detections import TagDetections
from test.simulated import FRAME_PERIOD, release_states, stamps_ns

LONGEST = 400
AT_REST = 16
"""Frames that are rendered after the body has come to rest."""

STANDING = np.array([1e-3] * 3 + [1e-2] * 3)
TRAINING_TOSSES = 30
FLIP = np.radians(10.0)
"""A pose that is turned by more than this is a flip."""

Recorded = dict[str, Any]


def main() -> int:
    """Prints what was measured."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--tosses", type=int, default=50, help="how many (default 50)")
    parser.add_argument("--seed", type=int, default=0, help="of releases and noise (default 0)")
    parser.add_argument("--folder", type=Path, help="keeps what was rendered; default: a temporary one")
    parser.add_argument("--json", action="store_true", help="print JSON")
    arguments = parser.parse_args()
    with TemporaryDirectory() as temporary:
        folder = arguments.folder or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        recorded = list(_recorded(arguments.tosses, arguments.seed, folder))
    report = {**_speeds(recorded), **_pose_errors(recorded), **_rankings(recorded, arguments.seed)}
    print(json.dumps(report, indent=1) if arguments.json else "\n".join(f"{key:42} {value}" for key, value in report.items()))
    return 0


def the_rig() -> TagRig:
    """The cube's tags and the board's."""
    return rig_of(CUBE.polytope, "body_cube", "body_surface")


def _motion(release: Array) -> Array:
    """States (T, 13) until a while after the body has come to rest."""
    states = free_motion(CUBE, release, LONGEST, FRAME_PERIOD)
    moving = np.flatnonzero((np.abs(states[:, 7:]) > STANDING).any(axis=1))
    return states[: int(moving[-1]) + 1 + AT_REST]


def _recorded(tosses: int, seed: int, folder: Path) -> Iterator[Recorded]:
    """What was rendered and detected of each toss, from the folder or anew."""
    releases = release_states(tosses, np.random.default_rng(seed))
    view, detector = None, TagDetector()
    for number, release in enumerate(releases):
        path = folder / f"toss_{seed}_{number}.npz"
        if not path.exists():
            view = view or CameraView(CUBE, the_rig(), CameraConfig())
            _record(view, detector, _motion(release), seed, number, path)
            print(f"rendered {path.name}", file=sys.stderr, flush=True)
        with np.load(path) as stored:
            yield {name: stored[name] for name in stored.files}
    if view is not None:
        view.close()


def _record(view: CameraView, detector: TagDetector, states: Array, seed: int, number: int, path: Path) -> None:
    seconds = np.zeros((len(states), 2))
    frames, ids, hammings, corners = [], [], [], []
    for frame, state in enumerate(states):
        start = time.perf_counter()
        image = view.image(Pose(state[:3], state[3:7]), np.random.default_rng([seed, number, frame]))
        rendered = time.perf_counter()
        found = detector.detect(image)
        seconds[frame] = rendered - start, time.perf_counter() - rendered
        frames += [frame] * len(found)
        ids += [one.tag_id for one in found]
        hammings += [one.hamming for one in found]
        corners += [one.corners for one in found]
    partial = path.with_suffix(".partial.npz")
    np.savez(partial, states=states, seconds=seconds, frames=frames, ids=ids, hammings=hammings, corners=np.array(corners))
    partial.rename(path)


def _messages(toss: Recorded, first_ns: int) -> Iterator[tuple[int, SimpleNamespace]]:
    """Stamps and messages as a detector publishes them, an empty one where it found nothing."""
    for frame, stamp_ns in enumerate(stamps_ns(len(toss["states"]), first_ns).tolist()):
        stamp = SimpleNamespace(sec=stamp_ns // NANOSECONDS, nanosec=stamp_ns % NANOSECONDS)
        detections = [
            SimpleNamespace(
                family="36h11",
                id=int(toss["ids"][at]),
                hamming=int(toss["hammings"][at]),
                corners=[SimpleNamespace(x=x, y=y) for x, y in toss["corners"][at].tolist()],
            )
            for at in np.flatnonzero(toss["frames"] == frame)
        ]
        yield stamp_ns, SimpleNamespace(header=SimpleNamespace(stamp=stamp, frame_id="camera"), detections=detections)


def _reader() -> TagDetections:
    reader = TagDetections(the_rig(), TagPoseConfig(), rectified=True)
    camera = CameraConfig().pinhole
    projection = np.column_stack([camera.matrix, np.zeros(3)]).ravel()
    reader.calibrated(SimpleNamespace(width=camera.width, height=camera.height, p=projection))
    return reader


def _speeds(recorded: Sequence[Recorded]) -> dict[str, Any]:
    """Frames a second."""
    render, detect = np.concatenate([toss["seconds"] for toss in recorded]).T
    reader = _reader()
    messages = [message for toss in recorded[:2] for _, message in _messages(toss, 0)]
    start, start_busy = time.perf_counter(), time.process_time()
    for message in messages:
        reader.detected(message)
    pnp, busy = (time.perf_counter() - start) / len(messages), (time.process_time() - start_busy) / len(messages)
    return {
        "tosses": len(recorded),
        "frames": len(render),
        "rendering [frames/s]": round(1.0 / float(np.median(render)), 1),
        "detection [frames/s]": round(1.0 / float(np.median(detect)), 1),
        "both [frames/s]": round(1.0 / float(np.median(render + detect)), 1),
        "poses of body and board [frames/s]": round(1.0 / pnp, 1),
        "of them, processor time [ms/frame]": round(1e3 * busy, 2),
    }


def _pose_errors(recorded: Sequence[Recorded]) -> dict[str, Any]:
    """Errors of what comes out of all gates for single poses."""
    tracker_config = PoseTopicConfig(tag_map="given").tracker(CUBE, "body_surface")
    errors: list[Array] = []
    changes: list[Array] = []
    left_out: Counter[str] = Counter()
    for toss in recorded:
        reader, tracker = _reader(), BodyTracker(tracker_config)
        by_stamp = dict(zip(stamps_ns(len(toss["states"])).tolist(), toss["states"]))
        events = [event for _, message in _messages(toss, 0) for one in reader.detected(message) for event in tracker.push(one)]
        found = [event for event in (*events, *tracker.flush()) if isinstance(event, BodyPose)]
        left_out.update(event.kind for event in events if isinstance(event, BadPose))
        own = np.array([_error(event.pose, by_stamp[event.stamp_ns]) for event in found])
        errors += list(own)
        changes += list(np.diff(own, axis=0) / np.sqrt(2.0))
    off = np.linalg.norm(np.reshape(errors, (-1, 2, 3)), axis=2)  # (N, 2) [m, rad]
    to_camera = quaternions.conjugate(CameraConfig().pose.orientation_wxyz)
    mean = 1e3 * quaternions.rotate(to_camera, np.mean(errors, axis=0)[:3])
    noise = np.sqrt(np.mean(np.square(np.reshape(changes, (-1, 2, 3))), axis=(0, 2)))
    return {
        "median position error [mm]": round(1e3 * float(np.median(off[:, 0])), 3),
        "95th percentile [mm]": round(1e3 * float(np.percentile(off[:, 0], 95)), 3),
        "largest [mm]": round(1e3 * float(off[:, 0].max()), 3),
        "median turn error [deg]": round(float(np.degrees(np.median(off[:, 1]))), 4),
        "95th percentile [deg]": round(float(np.degrees(np.percentile(off[:, 1], 95))), 4),
        "largest [deg]": round(float(np.degrees(off[:, 1].max())), 3),
        "mean displacement [mm], camera's axes": np.round(mean, 3).tolist(),
        "noise from frame to frame, per axis": f"{1e3 * noise[0]:.3f} mm, {np.degrees(noise[1]):.4f} deg",
        "flips past the gates": int((off[:, 1] > FLIP).sum()),
        "frames left out": dict(left_out),
    }


def _error(pose: ScalarPose, state: Array) -> Array:
    """Displacement [m] and turn [rad] about the body's axes (6,)."""
    turn = quaternions.log(quaternions.multiply(quaternions.conjugate(state[3:7]), np.array(pose.orientation_wxyz)))
    return np.concatenate([np.array(pose.position) - state[:3], turn])


def _rankings(recorded: Sequence[Recorded], seed: int) -> dict[str, Any]:
    """Tosses of both kinds, ranked."""
    geometry = _trained_geometry(seed + 1)
    true = _tosses(
        [_true_poses(toss, number) for number, toss in enumerate(recorded)], TrackerConfig("body_cube", "body_surface")
    )
    config = PoseTopicConfig(tag_map="given").tracker(CUBE, "body_surface")
    seen = _tosses([_seen_poses(toss, number) for number, toss in enumerate(recorded)], config)
    whole = [{number: one for number, one in cut.items() if isinstance(one, Toss)} for cut in (true, seen)]
    both = sorted(set(whole[0]) & set(whole[1]))
    pairs = [(whole[0][number], whole[1][number]) for number in both]
    scores = [_log_dets(tosses, geometry) for tosses in zip(*pairs)]
    reasons = {f"toss {number}": one.reasons for number, one in seen.items() if isinstance(one, Rejected)}
    starts = [abs(int(one.stamps_ns[0]) - int(other.stamps_ns[0])) / NANOSECONDS / FRAME_PERIOD for one, other in pairs]
    return {
        "tosses from true poses": len(whole[0]),
        "tosses from rendered tags": len(whole[1]),
        "of both": len(both),
        "starts differ by [frames], mean": round(float(np.mean(starts)), 2),
        "Spearman of log-det": round(float(spearmanr(*scores).statistic), 4),
        "rejected": reasons,
    }


def _trained_geometry(seed: int) -> ContactGeometry:
    """Theta fitted to other tosses with true poses, from the body as described."""
    rng = np.random.default_rng(seed)
    recorded = [{"states": _motion(release)} for release in release_states(TRAINING_TOSSES, rng)]
    found = _tosses(
        [_true_poses(toss, number) for number, toss in enumerate(recorded)], TrackerConfig("body_cube", "body_surface")
    )
    tosses = [one for one in found.values() if isinstance(one, Toss)]
    model = PolytopeModel(ContactGeometry.of_body(CUBE), CUBE, Form.PHYSICAL)
    return fit_polytope(model, transitions_of(tosses, CUBE.length_scale)).model.geometry()


def _true_poses(toss: Recorded, number: int) -> list[Measured]:
    poses = zip(_stamps(toss, number), toss["states"][:, :3].tolist(), toss["states"][:, 3:7].tolist())
    return [FramePose(stamp, "body_surface", "body_cube", ScalarPose(tuple(at), tuple(turn))) for stamp, at, turn in poses]


def _seen_poses(toss: Recorded, number: int) -> list[Measured]:
    reader = _reader()
    return [one for _, message in _messages(toss, _stamps(toss, number)[0]) for one in reader.detected(message)]


def _stamps(toss: Recorded, number: int) -> list[int]:
    return [int(stamp) for stamp in stamps_ns(len(toss["states"]), (1 + 10 * number) * NANOSECONDS)]


def _tosses(streams: Sequence[Sequence[Measured]], config: TrackerConfig) -> dict[int, Toss | Rejected]:
    """What each stream is cut to; a stream of which nothing comes has no entry."""
    found: dict[int, Toss | Rejected] = {}
    for number, stream in enumerate(streams):
        ingest = TossIngest(IngestConfig(config, SegmenterConfig(frame_period=FRAME_PERIOD)), CUBE, source="b")
        events = [event for one in stream for event in ingest.push(one)] + list(ingest.flush())
        cut = [event for event in events if isinstance(event, Toss | Rejected)]
        if cut:
            found[number] = max(cut, key=lambda one: one.frames if isinstance(one, Toss) else one.toss.frames)
    return found


def _log_dets(tosses: Sequence[Toss], geometry: ContactGeometry) -> list[float]:
    """What log-det says of each toss alone, within its pool."""
    infos = [one for one in Scorer(geometry, CUBE, ScoringConfig()).score(tosses) if isinstance(one, TossInformation)]
    alone = {entry.toss_id: entry.score for entry in rank(infos, RankingConfig("log-det", top=min(8, len(infos)))).entries}
    return [alone[toss.toss_id] for toss in tosses]


if __name__ == "__main__":
    sys.exit(main())
