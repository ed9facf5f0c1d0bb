"""How far the joints of an arm go from home, as shares of what they are told: carried from throw to throw, and corrected."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.simulation.arm.path import JointPath

PRIOR = (2e-3 / 0.02) ** 2
"""Weight of the prior of a gain, in sums of squares of a joint's way: 2 mrad of error in a joint state, against gains that are
2 % off 1 [rad^2]."""

REMEMBERED = 0.8
"""Weight that what is known keeps at each throw."""

LARGEST_CORRECTION = 0.05
"""Of a gain, from 1."""


class Following(NamedTuple):
    """How an arm of J joints follows.

    Attributes:
        lag: time by which it passes places later than planned [s].
        error: largest distance of a joint from the path that is late by this [rad].
        joint: number of that joint, from 1.
        gains: (J,) how far each joint goes from home, as a share of what it was told.
        weights: (J,) of these gains: sums of squares of the ways that were told [rad^2].
    """

    lag: float
    error: float
    joint: int
    gains: Array
    weights: Array


@dataclass(frozen=True)
class JointGains:
    """How far J joints go from home, as shares of what they are told.

    Attributes:
        gains: of the joints; empty before the first throw.
        weights: of the gains [rad^2].

    Raises:
        InvalidValueError: a gain is further from 1 than `LARGEST_CORRECTION`, or does not have one weight of 0 or more.
    """

    gains: tuple[float, ...] = ()
    weights: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not all(abs(gain - 1.0) <= LARGEST_CORRECTION + 1e-9 for gain in self.gains):
            raise InvalidValueError("gains of joints", self.gains, f"numbers at most {LARGEST_CORRECTION:g} from 1")
        if len(self.weights) != len(self.gains) or not all(0.0 <= weight < np.inf for weight in self.weights):
            raise InvalidValueError("weights of gains", self.weights, "a number of 0 or more for each gain")

    def after(self, found: Following) -> "JointGains":
        """What is known after a throw that showed this."""
        before = REMEMBERED * np.array(self.weights or np.zeros_like(found.weights))
        weights = before + found.weights + PRIOR  # of at least the prior's, so that a mean exists
        known = np.array(self.gains or np.ones_like(found.gains))
        gains = (before * known + (found.weights + PRIOR) * found.gains) / weights
        gains = np.clip(gains, 1.0 - LARGEST_CORRECTION, 1.0 + LARGEST_CORRECTION)
        return JointGains(tuple(gains.tolist()), tuple(weights.tolist()))

    def told(self, path: JointPath, home: Array) -> JointPath:
        """What to tell the joints so that they follow a path; `home` (J,) [rad]."""
        if not self.gains:
            return path
        gains = np.array(self.gains)
        return JointPath(home + (path.positions - home) / gains, path.speeds / gains, path.accelerations / gains)


UNKNOWN_GAINS = JointGains()
