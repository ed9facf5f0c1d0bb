"""Frames that were lost, and whose stamps were closed up: how often they are found, and how often something else is.

The real cube's tosses below 400 lack none; nothing must be found in them. Then 1 to 3 frames at a random place in the first
half of each are taken out, and the stamps closed up: found is the right number in the right step, or nothing, or a wrong one;
and so many tosses of either kind the quality checks reject, with even stamps. The tosses are found through CONTACTNETS_DATA.

With --planar FILE.npz also the motions of a square prism: `poses` (N, T, 3) of x [m], z [m] and the angle from x towards z
[rad], evenly in time; how many the quality checks accept, with and without `segmenter.closed_up`, what rejects the others, and
whether they hit an obstacle: then many of them stop at the farthest place that any corner comes to.

    python -m benchmarks.data.lost_frames [--planar FILE.npz]
"""

import argparse
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks._data import contactnets_folder, training_and_held_out
from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.geometry import quaternions
from contact_curation.geometry.polytopes import box
from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.scalars import ScalarPose
from contact_curation.motion.body_tracker import TrackerConfig
from contact_curation.motion.calibration import RigCalibration
from contact_curation.motion.gate_config import GateConfig
from contact_curation.motion.gates import inspect
from contact_curation.motion.ingest import IngestConfig, TossIngest
from contact_curation.motion.pose_stream import FramePose
from contact_curation.motion.scales import scale_of
from contact_curation.motion.segmenter_config import SegmenterConfig
from contact_curation.motion.smoothing import kinematics
from contact_curation.motion.survey.lost_frames import lost_frames
from contact_curation.motion.toss import NANOSECONDS, Rejected, Toss

SIDE, RATE = 0.06, 250.0
"""Of the square [m], and of its poses [Hz]."""

SQUARE = Body("square", box([SIDE / 2.0] * 3).vertices, 0.1, 0.1 * SIDE**2 / 6.0 * np.eye(3), 0.2, SIDE / 2.0)
"""A planar motion depends on the shape and on mass over inertia alone; the mass is made up."""

AT_OBSTACLE = 0.005
"""So near to the farthest place of any corner a throw has come to what it cannot pass [m]."""

SQUARE_RIG = RigCalibration(height=0.00132, marker_turn=(0.0, 0.02975, 0.0))
"""What `rig` says of the 350 published throws."""


def main() -> int:
    """Prints counts."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--planar", type=Path, help="poses of a square prism")
    arguments = parser.parse_args()
    folder = contactnets_folder()
    if folder is not None:
        print(found_in_the_cube(training_and_held_out(folder).training))
    if arguments.planar:
        for noise in (1.0, 2.0, 4.0):
            for closed_up in (False, True):
                ended = planar_events(arguments.planar, SegmenterConfig(tracker_noise=noise, closed_up=closed_up))
                print(f"tracker_noise={noise:g}, closed_up={closed_up}: {rejections(ended)}")
    return 0


def found_in_the_cube(tosses: Sequence[Toss]) -> str:
    """One line."""
    reach, gravity, rng = scale_of(CONTACTNETS_CUBE).reach, CONTACTNETS_CUBE.gravity, np.random.default_rng(0)
    whole, right, wrong, rejected, falsely = 0, 0, 0, 0, 0
    for toss in tosses:
        positions, orientations = toss.positions, toss.orientations_wxyz
        whole += int(np.count_nonzero(lost_frames(positions, orientations, toss.frame_period, reach, gravity)))
        count, first = int(rng.integers(1, 4)), int(rng.integers(5, max(6, toss.frames // 2)))
        left = np.delete(np.arange(toss.frames), slice(first, first + count))
        lost = lost_frames(positions[left], orientations[left], toss.frame_period, reach, gravity)
        found = {int(step): int(lost[step]) for step in np.flatnonzero(lost)}
        right += found == {first - 1: count}
        wrong += bool(found) and found != {first - 1: count}
        falsely += bool(inspect(with_closed_stamps(toss, np.arange(toss.frames)), CONTACTNETS_CUBE, GateConfig()))
        rejected += bool(inspect(with_closed_stamps(toss, left), CONTACTNETS_CUBE, GateConfig()))
    of_whole = f"in whole ones {whole} steps found, {falsely} rejected"
    return f"{len(tosses)} tosses: {of_whole}; of one loss in each, {right} found right, {wrong} wrong, {rejected} rejected"


def with_closed_stamps(toss: Toss, left: NDArray[np.int64]) -> Toss:
    """The toss of some frames alone, evenly in time, but for the first, whose velocity nothing gives."""
    stamps = np.rint(np.arange(len(left)) * toss.frame_period * NANOSECONDS).astype(np.int64)
    positions, orientations = toss.positions[left], toss.orientations_wxyz[left]
    rates = kinematics(stamps, positions, orientations)
    return replace(
        toss,
        stamps_ns=stamps[1:],
        positions=positions[1:],
        orientations_wxyz=orientations[1:],
        linear_velocities=rates.linear_velocities[1:],
        angular_velocities=rates.angular_velocities[1:],
    )


def rejections(ended: Sequence[Toss | Rejected]) -> str:
    """How many throws are accepted and at an obstacle, and how many each check rejects: as the only one, and elsewhere."""
    tosses = [event if isinstance(event, Toss) else event.toss for event in ended]
    farthest = np.array([corners_of(toss)[..., 0].min() for toss in tosses])
    stopped = farthest < farthest.min() + AT_OBSTACLE
    accepted = np.array([isinstance(event, Toss) for event in ended])
    each, alone, elsewhere = Counter[str](), Counter[str](), Counter[str]()
    for event, at_obstacle in zip(ended, stopped, strict=True):
        reasons = {line.partition(":")[0] for line in event.reasons} if isinstance(event, Rejected) else set[str]()
        each.update(reasons)
        alone.update(reasons if len(reasons) == 1 else ())
        elsewhere.update(() if at_obstacle else reasons)
    lines = [f"{accepted.sum()} of {len(ended)} accepted"]
    lines += [f"{stopped.sum()} stopped at x = {farthest.min():.3f} m, {(stopped & accepted).sum()} of these accepted"]
    return "\n  ".join(
        [*lines, *(f"{count} ({alone[why]} alone, {elsewhere[why]} elsewhere) {why}" for why, count in each.most_common())]
    )


def corners_of(toss: Toss) -> Array:
    """(T, V, 3) of the square [m]."""
    turned = quaternions.to_matrix(toss.orientations_wxyz) @ SQUARE.polytope.vertices.T  # (T, 3, V)
    return np.asarray(toss.positions[:, np.newaxis] + turned.swapaxes(1, 2))


def planar_tosses(path: Path, segmenter: SegmenterConfig) -> tuple[Toss, ...]:
    """The motions of the square that the quality checks accept."""
    return tuple(event for event in planar_events(path, segmenter) if isinstance(event, Toss))


def planar_events(path: Path, segmenter: SegmenterConfig) -> tuple[Toss | Rejected, ...]:
    """The motions of the square, and why the rejected ones are."""
    period_ns, ended = round(1e9 / RATE), list[Toss | Rejected]()
    with np.load(path) as file:
        poses = file["poses"]
    config = IngestConfig(TrackerConfig("square", "board"), segmenter, rig=SQUARE_RIG)
    for number, (x, z, angle) in enumerate(poses.transpose(0, 2, 1)):
        ingest = TossIngest(config, SQUARE, source=f"throw {number}")
        turns = quaternions.exp(np.stack([0.0 * angle, -angle, 0.0 * angle], axis=1)).tolist()
        places = [(across, 0.0, up) for across, up in zip(x.tolist(), z.tolist(), strict=True)]
        for frame, ((w, i, j, k), place) in enumerate(zip(turns, places, strict=True)):
            pose = FramePose(frame * period_ns, "board", "square", ScalarPose(place, (w, i, j, k)))
            ended += [event for event in ingest.push(pose) if isinstance(event, Toss | Rejected)]
        ended += [event for event in ingest.flush() if isinstance(event, Toss | Rejected)]
    return tuple(ended)


if __name__ == "__main__":
    sys.exit(main())
