"""Releases in their heading frame: what is left of a release when its place on the board and its heading are taken away.

The heading frame is level and its x axis points along the horizontal part of the velocity. Where a body is thrown from and
whither changes nothing of its motion, so 9 of 12 numbers remain (METHOD 5): height, speed along and up, spin (3), orientation.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array

MOTION = ("height", "speed along", "speed up", "spin along", "spin across", "spin up")
"""The columns of `Releases.motion`."""


@dataclass(frozen=True)
class Placement:
    """Where the thrower stands: what the physics leave open.

    Attributes:
        place: (2,) x and y of the release on the board [m]; by default as far before its middle as the published throws began.
        heading: direction of the throw from the board's x axis [rad].
    """

    place: tuple[float, float] = (-0.307, 0.0)
    heading: float = 0.0

    def __post_init__(self) -> None:
        if np.shape(self.place) != (2,) or not np.isfinite(self.place).all():
            raise InvalidValueError("placement.place", self.place, "2 finite numbers [m]")
        if not np.isfinite(self.heading):
            raise InvalidValueError("placement.heading", self.heading, "a finite number [rad]")


@dataclass(frozen=True, eq=False)
class Releases:
    """K releases in their heading frames, SI units.

    Attributes:
        motion: (K, 6) height [m], speed along and up [m/s], spin in the heading frame [rad/s], see `MOTION`.
        orientations_wxyz: (K, 4) body to heading frame.
    """

    motion: Array
    orientations_wxyz: Array

    def __post_init__(self) -> None:
        count = len(self.motion)
        if self.motion.shape != (count, len(MOTION)) or self.orientations_wxyz.shape != (count, 4):
            found = f"shapes {self.motion.shape} and {self.orientations_wxyz.shape}"
            raise InvalidValueError("releases", found, f"(K, {len(MOTION)}) and (K, 4)")

    def __len__(self) -> int:
        return len(self.motion)

    @staticmethod
    def of_states(states: ArrayLike) -> "Releases":
        """From states (K, 13) in SI units: position, orientation, velocity (board's frame), angular velocity (body's)."""
        given = np.asarray(states, dtype=float)
        velocities = given[:, 7:10]
        back = _yaw(-headings(velocities))
        spins = quaternions.rotate(back, quaternions.rotate(given[:, 3:7], given[:, 10:]))
        along = np.hypot(velocities[:, 0], velocities[:, 1])
        motion = np.column_stack([given[:, 2], along, velocities[:, 2], spins])
        return Releases(motion, quaternions.multiply(back, given[:, 3:7]))

    def states(self, placement: Placement) -> Array:
        """(K, 13) states in SI units of the releases at a place."""
        to_board = _yaw(np.full(len(self), placement.heading))
        height, along, up = self.motion[:, :3].T
        zero = np.zeros(len(self))
        places = np.column_stack([np.broadcast_to(placement.place, (len(self), 2)), height])
        velocities = quaternions.rotate(to_board, np.column_stack([along, zero, up]))
        spins = quaternions.rotate(quaternions.conjugate(self.orientations_wxyz), self.motion[:, 3:])
        return np.column_stack([places, quaternions.multiply(to_board, self.orientations_wxyz), velocities, spins])

    def taken(self, indices: ArrayLike) -> "Releases":
        """Some of them."""
        chosen = np.asarray(indices, dtype=np.int64)
        return Releases(self.motion[chosen], self.orientations_wxyz[chosen])

    def moved(self, steps: Array) -> "Releases":
        """Each moved by steps (K, 9): in `motion` by the first 6, turned about its own axes by a rotation vector [rad]."""
        turned = quaternions.multiply(self.orientations_wxyz, quaternions.exp(steps[:, 6:]))
        return Releases(self.motion + steps[:, :6], quaternions.normalized(turned))

    @staticmethod
    def joined(parts: list["Releases"]) -> "Releases":
        """One after the other."""
        return Releases(
            np.concatenate([part.motion for part in parts]), np.concatenate([part.orientations_wxyz for part in parts])
        )


def headings(velocities: Array) -> Array:
    """(K,) directions of velocities (K, 3) from the board's x axis [rad]; 0 of those that go straight up or down."""
    return np.arctan2(velocities[:, 1], velocities[:, 0])


def _yaw(angles: Array) -> Array:
    """Rotations (K, 4) about the vertical."""
    return quaternions.exp(np.column_stack([np.zeros(len(angles)), np.zeros(len(angles)), angles]))
