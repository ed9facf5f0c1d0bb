"""Made-up tosses, made as ContactNets' files were: jittering stamps, a filter, then a turn about the vertical."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.scalars import ScalarPose
from contact_curation.motion.body_tracker import BodyPose
from contact_curation.motion.smoothing import median_of_three
from contact_curation.motion.toss import NANOSECONDS, Toss
from test.motion.streams import stream

PERIOD = 1.0 / 148.0
EPOCH = 1_580_000_000.0
"""Unix time of the first frame [s]: differences of later ones are multiples of 2^-22 s."""


@dataclass(frozen=True, eq=False)
class Recorded:
    """What the tracker saw, and what the file says; T frames.

    Attributes:
        periods: (T - 1,) true ones [s].
        yaw: by which the file is turned [rad].
        positions: (T, 3) of the tracker.
        velocities: (T, 3) on the tracker's board.
        toss: the file's, with even stamps.
    """

    periods: Array
    yaw: float
    positions: Array
    velocities: Array
    toss: Toss


def recorded(seed: int, frames: int = 100, yaw: float = 0.0, epoch: float = EPOCH, heading: float = 0.0) -> Recorded:
    """A shaken body, seen from one frame before the file to one after it."""
    rng = np.random.default_rng(seed)
    times = epoch + np.cumsum(PERIOD * (1.0 + rng.uniform(-0.03, 0.03, frames + 2)))
    periods = np.diff(times)  # in float64, as the stamps are
    positions = drift(periods, heading) + 2e-4 * rng.normal(size=(frames + 2, 3))
    turns = np.outer(np.arange(frames + 2) * PERIOD, [1.5, -0.7, 2.0]) + 4e-3 * rng.normal(size=(frames + 2, 3))
    orientations = quaternions.exp(turns)
    steps = quaternions.log(quaternions.multiply(quaternions.conjugate(orientations[:-1]), orientations[1:]))
    linear = median_of_three(np.diff(positions, axis=0) / periods[:, np.newaxis])[:-1]
    angular = median_of_three(steps / periods[:, np.newaxis])[:-1]
    toss = Toss(
        toss_id=str(seed),
        body="cube",
        source=f"{seed}.pt",
        frame_period=PERIOD,
        stamps_ns=np.arange(frames, dtype=np.int64),
        positions=positions[1:-1],
        orientations_wxyz=orientations[1:-1],
        linear_velocities=linear,
        angular_velocities=angular,
    )
    return Recorded(periods[1:-1], yaw, positions[1:-1], linear, turned(toss, yaw))


def drift(periods: Array, heading: float) -> Array:
    """Positions (T, 3) of a body that slows down, and hops."""
    times = np.concatenate([[0.0], np.cumsum(periods)])
    along = 1.1 * times - 0.3 * times**2
    return np.stack([np.cos(heading) * along, np.sin(heading) * along, 0.2 + 0.05 * np.cos(9.0 * times)], axis=1)


def shaken(seed: int) -> Sequence[BodyPose]:
    """A tracker's stream: stamps jitter by 0.3 %, and poses by a hundredth of a millimetre and a milliradian."""
    rng = np.random.default_rng(seed)
    poses = stream()
    late_ns = (rng.uniform(-0.003, 0.003, len(poses)) * PERIOD * NANOSECONDS).astype(np.int64).tolist()
    noise, turns = 1e-5 * rng.normal(size=(len(poses), 3)), 1e-3 * rng.normal(size=(len(poses), 3))
    return [
        BodyPose(one.stamp_ns + late, moved(one.pose, shift, turn))
        for one, late, shift, turn in zip(poses, late_ns, noise, turns, strict=True)
    ]


def moved(pose: ScalarPose, shift: Array, turn: Array) -> ScalarPose:
    """A pose beside another."""
    x, y, z = (np.array(pose.position) + shift).tolist()
    w, a, b, c = quaternions.multiply(pose.orientation_wxyz, quaternions.exp(turn)).tolist()
    return ScalarPose((x, y, z), (w, a, b, c))


def turned(toss: Toss, yaw: float) -> Toss:
    """The toss as a file has it: turned about the vertical, with even stamps."""
    turn = quaternions.exp(np.array([0.0, 0.0, yaw]))
    return replace(
        toss,
        frame_period=PERIOD,
        stamps_ns=np.round(np.arange(toss.frames) * PERIOD * NANOSECONDS).astype(np.int64),
        positions=quaternions.rotate(turn, toss.positions),
        orientations_wxyz=quaternions.multiply(turn, toss.orientations_wxyz),
        linear_velocities=quaternions.rotate(turn, toss.linear_velocities),
    )
