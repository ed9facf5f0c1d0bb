"""Makes golden.mcap and golden.json: a recording session of our own making, as a TagSLAM rig would have recorded it.

A hand lifts the cube from where it lies, swings it and lets go; it tumbles to rest; and so on. Tosses are rolled out by this
package, the hand's motion is polynomial and never in free fall, and the tracker's noise has the size that the real tosses show.
In some tosses the tracker fails in a known way. The same seed gives the same bytes.

    python -m bags.make_golden [FOLDER]
"""

import json
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore
from scipy.interpolate import BPoly

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.geometry import quaternions
from contact_curation.geometry.poses import Pose
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.storage.bags.writer import BagWriter
from test.simulated import FIRST_STAMP_NS, FRAME_PERIOD, RIG_NOISE, motion_to_rest, release_states, stamps_ns, with_noise

SEED = 20_200_916
TOSSES = 24
TOPIC = "/tagslam/odom/body_cube"
MAP_FRAME, BODY_FRAME, BOARD_FRAME = "map", "body_cube", "body_surface"
BOARD = Pose(np.array([0.42, -0.13, -0.91]), quaternions.exp([0.012, -0.007, 0.35]))
"""The board in the map, which is not level: the map is where the camera was."""

STANDING, LIFTING, SWINGING = 45, 104, 118
"""Frames of each part of the motion between two tosses."""

LIFT = 0.2
"""Height of the lift [m]."""

POSITION_GRID, ORIENTATION_GRID = 2.0**-26, 2.0**-28
"""Poses are rounded to these [m, 1], so that another CPU's last bits hardly ever show and the bag stays small."""

LATENCY, LATENCY_JITTER = 0.012, 0.003
"""From stamp to log [s]."""

SPIKE = np.array([0.004, 0.0, 0.003])
"""A jump of one frame [m]."""

LOST_FRAMES = 6
SINKING, DRIFTING = 0.012, 45
"""The board seems to sink by so much [m] within so many frames; the tracker recovers during the next lift."""

FAULTS = {5: "spike", 12: "gap", 19: "drift"}
"""What goes wrong in which toss."""


@dataclass(frozen=True)
class PlannedToss:
    """One toss in the recording.

    Attributes:
        release_stamp_ns: of the first frame in free flight.
        end_stamp_ns: of the last frame before the hand may come.
        frames: of the tracker from release to end, had it lost none.
        fault: "", or what goes wrong: "spike", "gap" or "drift".
        fault_stamp_ns: of the first frame it goes wrong in, or 0.
    """

    release_stamp_ns: int
    end_stamp_ns: int
    frames: int
    fault: str
    fault_stamp_ns: int


@dataclass(frozen=True, eq=False)
class Session:
    """What the tracker saw.

    Attributes:
        stamps_ns: (T,).
        poses: (T, 7) of the body in the board's frame, position [m] and orientation wxyz.
        tosses: what happened in it.
    """

    stamps_ns: NDArray[np.int64]
    poses: Array
    tosses: tuple[PlannedToss, ...]


def session(seed: int = SEED, count: int = TOSSES) -> Session:
    """The whole recording; the same for the same seed."""
    rng = np.random.default_rng(seed)
    lying = np.array([0.0, 0.0, CONTACTNETS_CUBE.length_scale, 1.0, *np.zeros(9)])
    parts: list[Array] = []
    spans: list[tuple[int, int]] = []
    frames = 0
    for release in release_states(count, rng):
        motion = motion_to_rest(release)
        hand = carried(lying, release)
        spans.append((frames + len(hand), len(motion)))
        frames += len(hand) + len(motion)
        parts += [hand, motion]
        lying = motion[-1]
    parts.append(np.tile(lying, (STANDING, 1)))
    return seen(with_noise(np.concatenate(parts), RIG_NOISE, rng)[:, :7], spans)


def carried(lying: Array, release: Array) -> Array:
    """States (T, 13), velocities zero, of a body that a hand takes from where it lies to just before its release."""
    standing = np.tile(lying[:7], (STANDING, 1))
    top = lying[:3] + np.array([0.0, 0.0, LIFT])
    zero = np.zeros(3)
    lifted = np.tile(lying[:7], (LIFTING, 1))
    lifted[:, :3] = smooth((lying[:3], zero), (top, zero), LIFTING)
    swung = np.empty((SWINGING, 7))
    swung[:, :3] = smooth((top, zero), (release[:3], release[7:10]), SWINGING)
    share = smooth((np.zeros(1), np.zeros(1)), (np.ones(1), np.zeros(1)), SWINGING)
    spinning = smooth((np.zeros(1), np.zeros(1)), (np.zeros(1), np.ones(1)), SWINGING)
    turn = quaternions.log(quaternions.multiply(quaternions.conjugate(lying[3:7]), release[3:7]))
    turned = quaternions.multiply(lying[3:7], quaternions.exp(share * turn))
    swung[:, 3:] = quaternions.multiply(turned, quaternions.exp(spinning * release[10:]))
    poses = np.concatenate([standing, lifted, swung])
    return np.concatenate([poses, np.zeros((len(poses), 6))], axis=1)


def smooth(start: tuple[Array, Array], end: tuple[Array, Array], frames: int) -> Array:
    """Values (frames, D) from value and rate `start` to `end`, one frame after the last; no acceleration at either."""
    bounds = [np.stack([value, rate, np.zeros_like(value)]) for value, rate in (start, end)]
    curve = BPoly.from_derivatives([0.0, frames * FRAME_PERIOD], bounds)
    return np.asarray(curve(np.arange(frames) * FRAME_PERIOD), dtype=float)


def seen(poses: Array, spans: list[tuple[int, int]]) -> Session:
    """What the tracker gives of poses (T, 7), tosses at `spans` of first frame and number of frames: with its faults."""
    stamps = stamps_ns(len(poses), FIRST_STAMP_NS)
    poses = poses.copy()
    kept = np.ones(len(poses), dtype=bool)
    tosses = []
    for index, (first, frames) in enumerate(spans):
        fault = FAULTS.get(index, "")
        at = first + frames // 2
        if fault == "spike":
            poses[at, :3] += SPIKE
        elif fault == "gap":
            kept[at : at + LOST_FRAMES] = False
        elif fault == "drift":
            at = first + 10
            poses[at:, 2] -= sinking(len(poses) - at, first + frames + STANDING - at)
        release, end = int(stamps[first]), int(stamps[first + frames - 1])
        tosses.append(PlannedToss(release, end, frames, fault, int(stamps[at]) if fault else 0))
    return Session(stamps[kept], poses[kept], tuple(tosses))


def sinking(frames: int, back_at: int) -> Array:
    """How deep (frames,) the body seems to be: grows over DRIFTING frames, and goes back while the body is lifted again."""
    down, up = (
        np.clip((np.arange(frames) - start) / length, 0.0, 1.0) for start, length in ((0, DRIFTING), (back_at, LIFTING))
    )
    return SINKING * (down**2 * (3.0 - 2.0 * down) - up**2 * (3.0 - 2.0 * up))


def in_map(poses: Array) -> Array:
    """Poses (T, 7) given in the board's frame, in the map's, rounded."""
    positions = BOARD.position + quaternions.rotate(BOARD.orientation_wxyz, poses[:, :3])
    orientations = quaternions.multiply(BOARD.orientation_wxyz, poses[:, 3:])
    rounded = [np.rint(positions / POSITION_GRID) * POSITION_GRID, np.rint(orientations / ORIENTATION_GRID) * ORIENTATION_GRID]
    return np.concatenate(rounded, axis=1)


def write_bag(path: Path, recorded: Session) -> None:
    """Writes the session as TagSLAM would publish it: the body as odometry in the map, the board only as a static transform."""
    store = get_typestore(Stores.ROS2_JAZZY)
    rng = np.random.default_rng(SEED)
    late = np.rint((LATENCY + LATENCY_JITTER * rng.random(len(recorded.stamps_ns))) * NANOSECONDS).astype(np.int64)
    with BagWriter(path, store) as bag:
        first = int(recorded.stamps_ns[0])
        bag.write("/tf_static", board_transform(store, first), first, latched=True)
        for message, log_time in zip(odometry(store, recorded), recorded.stamps_ns + late):
            bag.write(TOPIC, message, int(log_time))


def board_transform(store: Typestore, stamp: int) -> Any:
    """The board in the map, as tf2_msgs/TFMessage."""
    types = store.types
    vector = types["geometry_msgs/msg/Vector3"](*BOARD.position.tolist())
    transform = types["geometry_msgs/msg/Transform"](vector, quaternion(store, BOARD.orientation_wxyz))
    stamped = types["geometry_msgs/msg/TransformStamped"](header(store, stamp), BOARD_FRAME, transform)
    return types["tf2_msgs/msg/TFMessage"]([stamped])


def odometry(store: Typestore, recorded: Session) -> Iterator[Any]:
    """The nav_msgs/Odometry; the twist is empty and the covariances are filled, as TagSLAM has it."""
    types = store.types
    variances = [RIG_NOISE.position**2] * 3 + [RIG_NOISE.orientation**2] * 3
    covariance = np.diag(variances).ravel()
    nothing = types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
    twist = types["geometry_msgs/msg/TwistWithCovariance"](types["geometry_msgs/msg/Twist"](nothing, nothing), covariance)
    for stamp, row in zip(recorded.stamps_ns.tolist(), in_map(recorded.poses)):
        point = types["geometry_msgs/msg/Point"](*row[:3].tolist())
        pose = types["geometry_msgs/msg/Pose"](point, quaternion(store, row[3:]))
        with_covariance = types["geometry_msgs/msg/PoseWithCovariance"](pose, covariance)
        yield types["nav_msgs/msg/Odometry"](header(store, stamp), BODY_FRAME, with_covariance, twist)


def header(store: Typestore, stamp: int) -> Any:
    """In the map at a time."""
    time = store.types["builtin_interfaces/msg/Time"](stamp // NANOSECONDS, stamp % NANOSECONDS)
    return store.types["std_msgs/msg/Header"](time, MAP_FRAME)


def quaternion(store: Typestore, wxyz: Array) -> Any:
    """In ROS order."""
    w, x, y, z = wxyz.tolist()
    return store.types["geometry_msgs/msg/Quaternion"](x, y, z, w)


def contents(recorded: Session) -> dict[str, object]:
    """What golden.json says."""
    return {
        "seed": SEED,
        "body": CONTACTNETS_CUBE.name,
        "friction": CONTACTNETS_CUBE.friction,
        "topic": TOPIC,
        "map_frame": MAP_FRAME,
        "body_frame": BODY_FRAME,
        "board_frame": BOARD_FRAME,
        "frame_period": FRAME_PERIOD,
        "messages": len(recorded.stamps_ns),
        "position_noise": RIG_NOISE.position,
        "orientation_noise": RIG_NOISE.orientation,
        "tosses": [asdict(toss) for toss in recorded.tosses],
    }


def make(folder: Path) -> None:
    """Writes both files into `folder`."""
    recorded = session()
    write_bag(folder / "golden.mcap", recorded)
    (folder / "golden.json").write_text(json.dumps(contents(recorded), indent=1) + "\n")


if __name__ == "__main__":
    make(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parent)
