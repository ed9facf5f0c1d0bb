"""Tosses made bad on purpose, in six ways that trackers have, to see who falls for them (method.md 2.1).

Each takes a good toss and gives what the tracker would have recorded of it. Poses that change get velocities as the pipeline
makes them, backward differences and a median of three; a spike gets its raw differences, as it would without the median.
Sizes are those of a rig like ContactNets': millimetres and degrees that nobody would see in a plot of the whole toss.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.smoothing import kinematics
from contact_curation.motion.toss import NANOSECONDS, Toss


class Fault(StrEnum):
    """What is wrong with a toss."""

    SPIKE = "spike"
    BURST = "burst"
    DRIFT = "drift"
    BOARD = "board"
    TAGS = "tags"
    TIME = "time"


@dataclass(frozen=True)
class FaultConfig:
    """How wrong.

    Attributes:
        spike: length of the jump of one frame [m].
        burst: length of the jump of a few successive frames [m].
        burst_frames: fewest and most frames of such a burst.
        drift: length of the way that the position drifts from the first frame to the last [m].
        board_tilt: angle of the board's pose about a horizontal axis [rad].
        board_height: what the board is too high or too low [m].
        tags_turn: by which the body's orientation is wrong from some frame on, where other tags come into sight [rad].
        time_frames: by which orientations are late.
    """

    spike: float = 0.005
    burst: float = 0.005
    burst_frames: tuple[int, int] = (2, 3)
    drift: float = 0.010
    board_tilt: float = np.radians(2.0)
    board_height: float = 0.003
    tags_turn: float = 0.5 * np.pi
    time_frames: int = 2


def check_share(share: float) -> None:
    """Raises InvalidValueError where the share of bad tosses is not within 0 and 1."""
    if not 0.0 <= share <= 1.0:
        raise InvalidValueError("share of bad tosses", share, "a number from 0 to 1")


def with_faults(tosses: Sequence[Toss], fault: Fault, share: float, seed: int) -> tuple[tuple[Toss, ...], frozenset[str]]:
    """The tosses, a share of them bad, and the ids of those; as many for every fault at one seed, and the same ones.

    Raises:
        InvalidValueError: the share is not within 0 and 1.
    """
    check_share(share)
    choice, noise = (np.random.default_rng(each) for each in np.random.SeedSequence(seed).spawn(2))
    bad = frozenset(choice.choice([toss.toss_id for toss in tosses], round(share * len(tosses)), replace=False).tolist())
    return made_bad(tosses, bad, fault, noise, FaultConfig()), bad


def made_bad(
    tosses: Sequence[Toss], bad: Collection[str], fault: Fault, noise: np.random.Generator, config: FaultConfig
) -> tuple[Toss, ...]:
    """The tosses, those of the ids in `bad` with a fault."""
    return tuple(MAKERS[fault](toss, noise, config) if toss.toss_id in bad else toss for toss in tosses)


def spiked(toss: Toss, noise: np.random.Generator, config: FaultConfig) -> Toss:
    """One frame is off, and so are the two velocities that it is in."""
    at = int(noise.integers(1, toss.frames - 1))
    off = config.spike * _direction(noise)
    positions, velocities = toss.positions.copy(), toss.linear_velocities.copy()
    positions[at] += off
    velocities[at] += off / _seconds(toss, at)
    velocities[at + 1] -= off / _seconds(toss, at + 1)
    return replace(toss, positions=positions, linear_velocities=velocities)


def with_burst(toss: Toss, noise: np.random.Generator, config: FaultConfig) -> Toss:
    """A few successive frames are displaced by the same vector, which a median filter does not remove."""
    count = int(noise.integers(config.burst_frames[0], config.burst_frames[1] + 1))
    at = int(noise.integers(1, max(toss.frames - count, 2)))
    positions = toss.positions.copy()
    positions[at : at + count] += config.burst * _direction(noise)
    return _tracked(toss, positions, toss.orientations_wxyz)


def drifting(toss: Toss, noise: np.random.Generator, config: FaultConfig) -> Toss:
    """The position creeps away."""
    share = np.linspace(0.0, 1.0, toss.frames)[:, np.newaxis]
    return _tracked(toss, toss.positions + config.drift * share * _direction(noise), toss.orientations_wxyz)


def on_another_board(toss: Toss, noise: np.random.Generator, config: FaultConfig) -> Toss:
    """The board's pose is wrong, so that all of the toss is tilted and lifted."""
    angle = noise.uniform(0.0, 2.0 * np.pi)
    tilt = quaternions.exp(config.board_tilt * np.array([np.cos(angle), np.sin(angle), 0.0]))
    middle = np.array([*toss.positions[:, :2].mean(axis=0), 0.0])
    lift = np.array([0.0, 0.0, config.board_height * noise.choice([-1.0, 1.0])])
    return replace(
        toss,
        positions=quaternions.rotate(tilt, toss.positions - middle) + middle + lift,
        orientations_wxyz=quaternions.multiply(tilt, toss.orientations_wxyz),
        linear_velocities=quaternions.rotate(tilt, toss.linear_velocities),
    )


def swapped(toss: Toss, noise: np.random.Generator, config: FaultConfig) -> Toss:
    """From some frame on tags are taken for others: the body seems to be turned about one of its axes."""
    at = int(noise.integers(1, toss.frames))
    axis = np.eye(3)[noise.integers(3)] * noise.choice([-1.0, 1.0])
    orientations = toss.orientations_wxyz.copy()
    orientations[at:] = quaternions.multiply(orientations[at:], quaternions.exp(config.tags_turn * axis))
    return _tracked(toss, toss.positions, orientations)


def late(toss: Toss, noise: np.random.Generator, config: FaultConfig) -> Toss:
    """Orientations come later than the positions with which they are paired."""
    shown = np.maximum(np.arange(toss.frames) - config.time_frames, 0)
    return _tracked(toss, toss.positions, toss.orientations_wxyz[shown])


MAKERS: dict[Fault, Callable[[Toss, np.random.Generator, FaultConfig], Toss]] = {
    Fault.SPIKE: spiked,
    Fault.BURST: with_burst,
    Fault.DRIFT: drifting,
    Fault.BOARD: on_another_board,
    Fault.TAGS: swapped,
    Fault.TIME: late,
}


def _tracked(toss: Toss, positions: Array, orientations_wxyz: Array) -> Toss:
    """A toss of other poses: its velocities change as much as those that the pipeline makes of the poses.

    Its own velocities stay in, since the first ones were made with poses from before the toss.
    """
    before = kinematics(toss.stamps_ns, toss.positions, toss.orientations_wxyz)
    after = kinematics(toss.stamps_ns, positions, orientations_wxyz)
    return replace(
        toss,
        positions=positions,
        orientations_wxyz=orientations_wxyz,
        linear_velocities=toss.linear_velocities + after.linear_velocities - before.linear_velocities,
        angular_velocities=toss.angular_velocities + after.angular_velocities - before.angular_velocities,
    )


def _direction(noise: np.random.Generator) -> Array:
    """(3,) of length 1, uniform."""
    vector = noise.standard_normal(3)
    return np.asarray(vector / np.linalg.norm(vector))


def _seconds(toss: Toss, frame: int) -> float:
    """From the frame before to this one [s]."""
    return float(toss.stamps_ns[frame] - toss.stamps_ns[frame - 1]) / NANOSECONDS
