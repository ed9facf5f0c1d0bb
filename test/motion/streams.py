"""Made-up pose streams: a cube is carried, flies, bounces flat on its face, slides and rests. No data; chance is seeded."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, hypot, sin

import numpy as np

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.body_values import STANDARD_GRAVITY
from contact_curation.geometry.poses import Pose
from contact_curation.geometry.scalars import Quaternion, ScalarPose, Vector, compose
from contact_curation.motion.body_tracker import BodyPose
from contact_curation.motion.pose_stream import FramePose
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.simulation.tracker_noise import TrackerNoise, TrackerNoiseConfig

CUBE = CONTACTNETS_CUBE
HALF_WIDTH = CONTACTNETS_CUBE.length_scale
PERIOD_NS = round(NANOSECONDS / 148)
BOARD = ScalarPose((0.4, -1.3, 0.7), (cos(0.9), 0.6 * sin(0.9), 0.0, -0.8 * sin(0.9)))
SUBSTEPS = 50


@dataclass(frozen=True)
class Throw:
    """How the cube is let go, and for how many frames it is seen before and after.

    Attributes:
        position: of release [m].
        velocity: of release [m/s].
        spin: about the vertical, until the first impact [rad/s].
        restitution: of impacts.
        friction: Coulomb coefficient.
        carried: frames before the release, at the velocity of the release.
        seen: frames from the release on.
    """

    position: Vector = (0.1, 0.2, 0.20)
    velocity: Vector = (0.9, 0.3, 0.3)
    spin: float = 3.0
    restitution: float = 0.2
    friction: float = 0.18
    carried: int = 20
    seen: int = 150


def yawed(angle: float) -> Quaternion:
    return cos(0.5 * angle), 0.0, 0.0, sin(0.5 * angle)


def stream(throw: Throw = Throw(), start_ns: int = 5 * NANOSECONDS, period_ns: int = PERIOD_NS) -> list[BodyPose]:
    """The cube's poses in the board's frame."""
    poses = carried_frames(throw, period_ns) + flown_frames(throw, period_ns)
    return [BodyPose(start_ns + number * period_ns, pose) for number, pose in enumerate(poses)]


def carried_frames(throw: Throw, period_ns: int) -> list[ScalarPose]:
    """At constant velocity up to one frame before the release."""
    times = [-number * period_ns / NANOSECONDS for number in range(throw.carried, 0, -1)]
    (x, y, z), (u, v, w) = throw.position, throw.velocity
    return [ScalarPose((x + u * t, y + v * t, z + w * t), yawed(throw.spin * t)) for t in times]


def flown_frames(throw: Throw, period_ns: int) -> list[ScalarPose]:
    """From the release on, by small explicit steps."""
    step = period_ns / NANOSECONDS / SUBSTEPS
    (x, y, z), (u, v, w) = throw.position, throw.velocity
    angle, spin = 0.0, throw.spin
    poses = []
    for substep in range(throw.seen * SUBSTEPS):
        if substep % SUBSTEPS == 0:
            poses.append(ScalarPose((x, y, z), yawed(angle)))
        w -= STANDARD_GRAVITY * step
        if z + w * step < HALF_WIDTH and w < 0.0:
            rebound = -throw.restitution * w if w < -0.05 else 0.0
            speed = hypot(u, v)
            slowed = max(0.0, 1.0 - throw.friction * (rebound - w) / speed) if speed > 0.0 else 0.0
            u, v, w, spin = slowed * u, slowed * v, rebound, 0.0
        x, y, z, angle = x + u * step, y + v * step, z + w * step, angle + spin * step
    return poses


def noisy(poses: Sequence[BodyPose], multiple: float, seed: int = 3) -> list[BodyPose]:
    """The same poses by a tracker `multiple` times as noisy as that of ContactNets' rig."""
    rig, told = TrackerNoiseConfig(), []
    tracker = TrackerNoise(TrackerNoiseConfig(multiple * rig.position, multiple * rig.turn), seed)
    for one in poses:
        seen = tracker.seen(one.stamp_ns, Pose(np.array(one.pose.position), np.array(one.pose.orientation_wxyz)))
        assert seen is not None
        (x, y, z), (a, b, c, d) = seen.position.tolist(), seen.orientation_wxyz.tolist()
        told.append(BodyPose(one.stamp_ns, ScalarPose((x, y, z), (a, b, c, d))))
    return told


def in_map(poses: Sequence[BodyPose], board: ScalarPose = BOARD, child: str = "body_cube") -> list[FramePose]:
    """The same poses as a tracker gives them, in the frame `map` where the board stands at `board`."""
    return [FramePose(one.stamp_ns, "map", child, compose(board, one.pose)) for one in poses]


def board_in_map(board: ScalarPose = BOARD) -> FramePose:
    return FramePose(0, "map", "body_surface", board, static=True)
