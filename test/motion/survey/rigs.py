"""Bodies that fly freely and then lie on a face, as a rig with known errors tracks them. No contact is simulated."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from contact_curation.geometry import quaternions
from contact_curation.geometry.polytopes import Polytope
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.survey.rests import faces
from contact_curation.motion.survey.series import PoseSeries

GRAVITY, RATE = 9.81, 148.0
FLYING, RESTING = 40, 30
"""Frames."""


@dataclass(frozen=True)
class Rig:
    """What is wrong with a rig, in the words of `RigCalibration`, and how much it scatters.

    Attributes:
        tilt: of the board about x and y of the frame of the poses [rad].
        height: of its surface there [m].
        scale: what corrects its lengths.
        marker_turn, marker_offset: of the described body seen from the tracked frame [rad, m].
        noise: of positions [m]; of orientations ten times as much [rad].
        uneven: what a rest is beside flat [rad], and its height beside the board's [m].
    """

    tilt: tuple[float, float] = (0.0, 0.0)
    height: float = 0.0
    scale: float = 1.0
    marker_turn: tuple[float, float, float] = (0.0, 0.0, 0.0)
    marker_offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    noise: float = 2e-5
    uneven: tuple[float, float] = (5e-4, 1e-4)

    @property
    def up(self) -> Array:
        """(3,) the board's normal."""
        across = np.sin(self.tilt)
        return np.array([*across, np.sqrt(1.0 - across @ across)])

    def tracked(self, positions: Array, orientations: Array, rng: np.random.Generator) -> tuple[Array, Array]:
        """True poses on the board as the rig gives them: what `calibrated_poses` undoes, about the frame's origin."""
        offset, turn = np.array(self.marker_offset), quaternions.exp(np.array(self.marker_turn))
        marked = positions - quaternions.rotate(orientations, offset)
        axis = np.cross([0.0, 0.0, 1.0], self.up)
        length = float(np.linalg.norm(axis))
        leaning = quaternions.exp(axis * (np.arcsin(length) / length if length else 0.0))
        raised = marked + np.array([0.0, 0.0, self.height])
        seen = quaternions.rotate(leaning, raised / self.scale)
        turned = quaternions.multiply(leaning, quaternions.multiply(orientations, turn))
        scattered = quaternions.exp(10.0 * self.noise * rng.standard_normal((len(seen), 3)))
        return seen + self.noise * rng.standard_normal(seen.shape), quaternions.multiply(turned, scattered)


@dataclass(frozen=True)
class Throws:
    """How a body is thrown.

    Attributes:
        count: how often.
        spin: standard deviation per axis [rad/s].
        spread: of the places of rest [m].
        faces: so many different ones at most.
        one_heading: whether the body lies under the same one always.
    """

    count: int = 40
    spin: float = 4.0
    spread: float = 0.15
    faces: int = 99
    one_heading: bool = False


MANY = Throws()


def recorded(polytope: Polytope, rig: Rig, throws: Throws = MANY, seed: int = 0) -> list[PoseSeries]:
    """A series for each throw."""
    rng = np.random.default_rng(seed)
    normals, depths = faces(polytope)
    return [_one(normals[: throws.faces], depths, rig, throws, rng, number) for number in range(throws.count)]


def _one(normals: Array, depths: Array, rig: Rig, throws: Throws, rng: np.random.Generator, number: int) -> PoseSeries:
    times = np.arange(FLYING) / RATE
    start = np.array([*rng.uniform(-0.3, 0.3, 2), 0.3])
    velocity = np.array([*rng.uniform(-1.0, 1.0, 2), rng.uniform(0.0, 0.5)])
    flown = start + np.outer(times, velocity) - np.outer(0.5 * GRAVITY * times**2, [0.0, 0.0, 1.0])
    spun = quaternions.multiply(
        quaternions.normalized(rng.standard_normal(4)), quaternions.exp(np.outer(times, throws.spin * rng.standard_normal(3)))
    )
    face = int(rng.integers(len(normals)))
    heading = 1.0 if throws.one_heading else rng.uniform(0.0, 2.0 * np.pi)
    off, higher = rig.uneven[0] * rng.standard_normal(3), rig.uneven[1] * rng.standard_normal()
    lying = quaternions.multiply(quaternions.exp(np.array([0.0, 0.0, heading])), _downwards(normals[face]))
    lying = quaternions.multiply(quaternions.exp(off), lying)
    place = np.array([*(throws.spread * rng.standard_normal(2)), depths[face] + higher])
    positions = np.concatenate([flown, np.tile(place, (RESTING, 1))])
    orientations = np.concatenate([spun, np.tile(lying, (RESTING, 1))])
    stamps = np.rint((np.arange(FLYING + RESTING) / RATE + 10.0 * number) * 1e9).astype(np.int64)
    return PoseSeries(stamps, *rig.tracked(positions, orientations, rng))


def _downwards(normal: ArrayLike) -> Array:
    """(4,) a turn that brings a body's direction to -z."""
    first = np.asarray(normal, dtype=float)
    axis = np.cross(first, [0.0, 0.0, -1.0])
    length = float(np.linalg.norm(axis))
    if length < 1e-9:
        return quaternions.exp(np.array([np.pi if first[2] > 0.0 else 0.0, 0.0, 0.0]))
    return quaternions.exp(axis / length * np.arctan2(length, -first[2]))
