"""Where throws are drawn from: releases like those that were made (METHOD 5).

A normal over height, speed along and up and spin, in the heading frame; orientations are those that were seen, each blurred by
a few degrees. Fitted in the board's frame instead, a normal would put its mean where nobody throws: headings lie on a ring,
and orientations have no mean.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from contact_curation.design.releases import MOTION, Placement, Releases
from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array

LEAST_RELEASES = 8
"""From fewer a covariance of 6 numbers says nothing."""


class ReleasePrior(Protocol):
    """What releases are drawn from."""

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
deviations in the heading frame (METHOD 3), every orientation as likely as any other."""


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
    """The paper's: one normal over the 13 numbers of a release in the board's frame. A baseline, not a suggestion.

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
        """So many releases, seen in their heading frames: place and heading change nothing of what they teach."""
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
