"""Releases in their heading frame, and where they are drawn from (method.md 5).

The heading frame is level and its x axis points along the horizontal part of the velocity. Where a body is thrown from and
whither changes nothing of its motion, so 9 of 12 numbers remain: height, speed along and up, spin (3), orientation.

Releases are drawn like those that were made: a normal over height, speed along and up and spin, in the heading frame;
orientations are those that were seen, each blurred by a few degrees. Fitted in the board's frame instead, a normal would put
its mean where nobody throws: headings lie on a ring, and orientations have no mean.
"""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from contact_curation.configs import check_positive, ranged
from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array

MOTION = ("height", "speed along", "speed up", "spin along", "spin across", "spin up")
"""The columns of `Releases.motion`."""


@dataclass(frozen=True)
class Placement:
    """Place and heading of releases, which the physics does not determine.

    Attributes:
        place: (2,) x and y of the release on the board [m]; the default is as far from the middle as in the published throws.
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


LEAST_RELEASES = 8
"""From fewer a covariance of 6 numbers says nothing."""


class ReleasePrior(Protocol):
    """A distribution of releases."""

    def draw(self, count: int, rng: np.random.Generator) -> Releases:
        """So many releases."""


@dataclass(frozen=True, eq=False)
class ThrowPrior:
    """Releases in the heading frame.

    Attributes:
        mean: (6,) of `MOTION`.
        covariance: (6, 6).
        orientations_wxyz: (M, 4) seen, body to heading frame; none where every orientation is as likely as any other.
        blur: standard deviation about each axis of the turn from a seen orientation [rad].
    """

    mean: Array
    covariance: Array
    orientations_wxyz: Array
    blur: float = float(np.radians(9.0))

    def __post_init__(self) -> None:
        size = len(MOTION)
        if self.mean.shape != (size,) or self.covariance.shape != (size, size):
            found = f"shapes {self.mean.shape} and {self.covariance.shape}"
            raise InvalidValueError("throw prior", found, f"({size},) and ({size}, {size})")
        if np.linalg.eigvalsh(self.covariance)[0] < 0.0:
            raise InvalidValueError("covariance of the throw prior", "a negative eigenvalue", "a covariance")

    def draw(self, count: int, rng: np.random.Generator) -> Releases:
        """So many releases; speeds along are never negative."""
        motion = rng.multivariate_normal(self.mean, self.covariance, count, method="eigh")
        motion[:, 1] = np.abs(motion[:, 1])
        return Releases(motion, self._orientations(count, rng))

    def _orientations(self, count: int, rng: np.random.Generator) -> Array:
        if not len(self.orientations_wxyz):
            return quaternions.normalized(rng.standard_normal((count, 4)))
        seen = self.orientations_wxyz[rng.integers(len(self.orientations_wxyz), size=count)]
        return quaternions.multiply(seen, quaternions.exp(self.blur * rng.standard_normal((count, 3))))


PUBLISHED_PRIOR = ThrowPrior(
    mean=np.array([0.141, 1.14, -0.03, -0.85, 3.41, -0.15]),
    covariance=np.diag([0.016, 0.085, 0.16, 1.16, 1.60, 0.88]) ** 2,
    orientations_wxyz=np.zeros((0, 4)),
)
"""The releases of ContactNets' 570 published tosses (Pfrommer, Halm and Posa 2020; DAIRLab/contact-nets): means and standard
deviations in the heading frame (method.md 3), every orientation as likely as any other."""


@dataclass(frozen=True)
class PriorConfig:
    """How fast throws are drawn, compared with the published ones; an arm may not reach those.

    Attributes:
        speed: share of the published speeds.
        spin: share of the published spins.
    """

    speed: float = ranged(1.0, 0.0, 2.0)
    spin: float = ranged(1.0, 0.0, 2.0)

    def __post_init__(self) -> None:
        check_positive(self, ("speed", "spin"), "prior.")


def published_prior(config: PriorConfig) -> ThrowPrior:
    """`PUBLISHED_PRIOR` at a share of its speeds and spins."""
    shares = np.repeat([1.0, config.speed, config.spin], [1, 2, 3])
    return replace(
        PUBLISHED_PRIOR, mean=shares * PUBLISHED_PRIOR.mean, covariance=np.outer(shares, shares) * PUBLISHED_PRIOR.covariance
    )


def fitted_prior(states: ArrayLike) -> ThrowPrior:
    """The prior of releases (K, 13) in SI units that were made.

    Raises:
        InvalidValueError: fewer than `LEAST_RELEASES`.
    """
    releases = Releases.of_states(checked_releases(states))
    covariance = np.cov(releases.motion, rowvar=False)
    return ThrowPrior(releases.motion.mean(axis=0), covariance, releases.orientations_wxyz)


@dataclass(frozen=True, eq=False)
class RawPrior:
    """The prior of the paper: one normal distribution over the 13 numbers of a release in the board's frame. It is a baseline.

    Attributes:
        mean: (13,).
        covariance: (13, 13).
    """

    mean: Array
    covariance: Array

    def states(self, count: int, rng: np.random.Generator) -> Array:
        """States (count, 13) in SI units, orientations brought to unit norm."""
        drawn = rng.multivariate_normal(self.mean, self.covariance, count, method="eigh")
        drawn[:, 3:7] = quaternions.normalized(drawn[:, 3:7])
        return drawn

    def draw(self, count: int, rng: np.random.Generator) -> Releases:
        """So many releases, seen in their heading frames: place and heading do not change their information."""
        return Releases.of_states(self.states(count, rng))


def raw_prior(states: ArrayLike) -> RawPrior:
    """The paper's prior of releases (K, 13) in SI units that were made; errors as `fitted_prior`."""
    given = checked_releases(states)
    return RawPrior(given.mean(axis=0), np.cov(given, rowvar=False))


def published_releases(count: int, rng: np.random.Generator) -> Array:
    """States (count, 13) as if they were tossed by `PUBLISHED_PRIOR` in all directions, for those who have no tosses."""
    releases = PUBLISHED_PRIOR.draw(count, rng)
    around = [
        releases.taken([k]).states(_thrown_towards(heading)) for k, heading in enumerate(rng.uniform(-np.pi, np.pi, count))
    ]
    return np.concatenate(around)


def _thrown_towards(heading: float) -> Placement:
    along = Placement().place[0]
    return Placement((along * float(np.cos(heading)), along * float(np.sin(heading))), heading)


def checked_releases(states: ArrayLike) -> Array:
    """The states, if there are enough to fit a prior to."""
    given = np.asarray(states, dtype=float)
    if given.ndim != 2 or given.shape[1] != 13 or len(given) < LEAST_RELEASES:
        raise InvalidValueError("releases to fit a prior to", f"shape {given.shape}", f"(K, 13) with K >= {LEAST_RELEASES}")
    return given
