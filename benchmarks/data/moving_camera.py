"""How far are scores off where an arm moves the camera, by how often it says where that is?

Tosses of a box are simulated by MuJoCo and seen, with the noise of ContactNets' rig, by a camera that swings about its place in
all directions. Poses of the box come at 150 Hz in the camera's frame, the camera's own on /tf at other times. Printed is the
ratio of a toss's trace to that by a camera that stands still, as the median and the largest over tosses, and what `check` says.

    python -m benchmarks.data.moving_camera [--tosses 12] [--rates 10 30 50 100] [--swings 0.03 0.1 0.2]
"""

import argparse
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import contact_curation as cc
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.scalars import ScalarPose, compose, inverse, vector
from contact_curation.motion.pose_stream import FramePose
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.storage.inputs.pose_messages import POSE, TF
from test.first_hour.recordings import FRAME_NS, SLED, session
from test.storage.pose_recordings import recorded, transforms
from test.storage.written_bags import Sent, write_mcap

START_NS, FREQUENCY = 1_700_000_000 * NANOSECONDS, 0.4
"""[ns] Of the first pose; [1/s] of the swing."""

ON_TABLE = {"poses.board_frame": "table", "poses.body_frame": SLED.body.name}
BOARD = FramePose(0, "map", "table", ScalarPose((0.3, -0.2, 0.75), (float(np.cos(0.3)), 0.0, 0.0, float(np.sin(0.3)))), True)


def camera(seconds: float, swing: float) -> ScalarPose:
    """Where the camera is in the map: it swings by so many metres, and by as much at 0.8 m."""
    phase = 2.0 * np.pi * FREQUENCY * seconds
    place = swing * np.sin([phase, 1.3 * phase + 1.0, 0.7 * phase + 2.0]) + [0.0, -0.6, 1.4]
    turn = swing / 0.8 * np.sin([phase + 0.5, 0.9 * phase, 1.1 * phase + 1.5]) + [-2.2, 0.0, 0.0]
    w, x, y, z = quaternions.exp(turn).tolist()
    return ScalarPose(vector(place), (w, x, y, z))


def write(path: Path, poses: Array, swing: float, rate: float) -> Path:
    """A bag of poses (T, 7) on the board, in the frame of a camera whose place is told at a rate."""
    seen, told = [], []
    for number, (px, py, pz, w, x, y, z) in enumerate(poses.tolist()):
        at_ns = number * FRAME_NS
        on_board = compose(BOARD.pose, ScalarPose((px, py, pz), (w, x, y, z)))
        pose = compose(inverse(camera(at_ns / NANOSECONDS, swing)), on_board)
        seen.append(FramePose(START_NS + at_ns, "camera", SLED.body.name, pose))
    for number in range(-2, int((len(poses) * FRAME_NS / NANOSECONDS + 0.3) * rate)):
        seconds = number / rate + 0.0013  # never at the time of a pose
        told.append(FramePose(START_NS + round(seconds * NANOSECONDS), "map", "camera", camera(seconds, swing)))
    sent = [*recorded(f"/{SLED.body.name}/pose", POSE, seen), *recorded("/tf", TF, told)]
    first = Sent("/tf_static", min(one.log_time_ns for one in sent) - 1, transforms([BOARD]))
    return write_mcap(path, [first, *sorted(sent, key=lambda one: one.log_time_ns)])


def traces(path: Path) -> dict[int, float]:
    """Of each toss, by the half second in which it begins."""
    tosses = cc.read(path, SLED.body, config=ON_TABLE)
    scores = cc.score(tosses)
    found = dict(zip(scores.toss_ids, scores.traces.tolist(), strict=True))
    return {round(2.0 * toss.stamps_ns[0] / NANOSECONDS): found[toss.toss_id] for toss in tosses.accepted}


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description="Scores by a camera that an arm moves.")
    parser.add_argument("--tosses", type=int, default=12)
    parser.add_argument("--rates", type=float, nargs="+", default=[10.0, 30.0, 50.0, 100.0])
    parser.add_argument("--swings", type=float, nargs="+", default=[0.03, 0.1, 0.2])
    arguments = parser.parse_args()
    poses = session(SLED, arguments.tosses, seed=1)
    with TemporaryDirectory() as folder:
        still = traces(write(Path(folder) / "still.mcap", poses, 0.0, 10.0))
        print("swing [m]  transforms [Hz]  tosses  trace: median and largest ratio  check")
        for swing in arguments.swings:
            for rate in arguments.rates:
                bag = write(Path(folder) / f"{swing:g}_{rate:g}.mcap", poses, swing, rate)
                found = traces(bag)
                ratios = np.exp(np.abs([np.log(found[at] / still[at]) for at in still if at in found] or [np.nan]))
                said = cc.check(bag, SLED.body, config=ON_TABLE).verdict
                print(f"{swing:9g}  {rate:15g}  {len(found):6}  {np.median(ratios):24.3f} {ratios.max():8.3f}  {said}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
