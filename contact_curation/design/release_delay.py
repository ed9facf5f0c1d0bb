"""How late a gripper lets go, learned from releases that were tracked.

A delay d_k is the time from the command to open to the beginning of the fall. Delays scatter about a mean m by the gripper's
jitter j and by the tracker's error s_k:

    d_k ~ m + sqrt((c j)^2 + s_k^2) * Student's t with 4 degrees of freedom

(c makes j the standard deviation of delays that are normal). Mean and jitter have priors (a guess and its uncertainty), so that
the first throw can be planned, too. The heavy tails are those of a gripper that sticks once. A change is noticed by the last
two or three delays alone: each of them is off, and their mean is further from the mean before than chance explains. Then the
delays before it are forgotten.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from contact_curation.configs import check_positive
from contact_curation.errors import InvalidValueError

TAILS = 4.0
"""Degrees of freedom of the delays' distribution."""

NORMAL = 0.831
"""Scale of that distribution which fits numbers of a standard normal distribution best (by maximum likelihood)."""

REWEIGHTINGS = 20
RECENT = (2, 3)
"""So many last delays may show a change."""

LEAST_SHARE = 0.5
"""Each of them shows at least this share of the change: one late release is none."""

SURE = 0.95
"""Probability that a gripper's jitter is at least `least_jitter`."""

KEPT = 100
"""Delays that are remembered."""


@dataclass(frozen=True)
class DelayConfig:
    """What is assumed of a gripper before it was seen.

    Attributes:
        guess: delay from the command to the release [s].
        guess_sd: standard deviation of that guess [s].
        jitter: guess of the jitter [s].
        jitter_weight: number of throws that this guess counts like.
        false_alarms: probability that a throw reports a change where there was none.
    """

    guess: float = 0.04
    guess_sd: float = 0.03
    jitter: float = 0.008
    jitter_weight: float = 3.0
    false_alarms: float = 0.001

    def __post_init__(self) -> None:
        check_positive(self, ("guess_sd", "jitter", "jitter_weight"), "delay.")
        if not (np.isfinite(self.guess) and self.guess >= 0.0):
            raise InvalidValueError("delay.guess", self.guess, "0 s or more")
        if not 0.0 < self.false_alarms < 0.5:
            raise InvalidValueError("delay.false_alarms", self.false_alarms, "a probability in (0, 0.5)")


DEFAULT_DELAY = DelayConfig()


class Seen(NamedTuple):
    """A delay [s] and its standard deviation [s], as the tracker saw it."""

    delay: float
    deviation: float


@dataclass(frozen=True)
class Delay:
    """What is known of a gripper.

    Attributes:
        mean: delay [s].
        mean_sd: its standard deviation [s].
        jitter: standard deviation of single delays [s].
        least_jitter: what the jitter is at least, with probability `SURE` [s].
        throws: number of releases that it follows from.
    """

    mean: float
    mean_sd: float
    jitter: float
    least_jitter: float
    throws: int


def learned_delay(seen: tuple[Seen, ...], config: DelayConfig = DEFAULT_DELAY) -> Delay:
    """The delay that releases show, on top of what was assumed."""
    from scipy.special import chdtri  # with scipy over half a second to import, which every node would pay

    delays, errors = np.array([one.delay for one in seen]), np.array([one.deviation for one in seen])
    mean, mean_sd, first = config.guess, config.guess_sd, NORMAL * config.jitter
    scale, count = first, config.jitter_weight + max(len(seen) - 1, 0)
    for _ in range(REWEIGHTINGS if len(seen) else 0):
        spread = scale**2 + errors**2
        weights = (TAILS + 1.0) / (TAILS + (delays - mean) ** 2 / spread)
        precision = 1.0 / config.guess_sd**2 + (weights / spread).sum()
        mean = (config.guess / config.guess_sd**2 + (weights * delays / spread).sum()) / precision
        mean_sd = (1.0 / config.guess_sd**2 + (TAILS + 1.0) / (TAILS + 3.0) * (1.0 / spread).sum()) ** -0.5
        own = (scale**2 / spread) * weights * (delays - mean) ** 2
        scale = float(np.sqrt((config.jitter_weight * first**2 + own.sum()) / count))
    jitter = scale / NORMAL
    return Delay(float(mean), float(mean_sd), jitter, jitter * float(np.sqrt(count / chdtri(count, 1.0 - SURE))), len(seen))


def with_release(seen: tuple[Seen, ...], new: Seen, config: DelayConfig = DEFAULT_DELAY) -> tuple[tuple[Seen, ...], str]:
    """Takes in a release.

    Returns:
        The delays that count from now on, and one line if the delay has changed; else nothing.
    """
    from scipy.special import stdtrit

    every = (*seen, new)[-KEPT:]
    for count in RECENT:
        older, recent = every[:-count], every[-count:]
        if len(older) < 2:
            continue
        before = learned_delay(older, config)
        off = np.array([one.delay for one in recent]) - before.mean
        error = np.sqrt(before.mean_sd**2 + (before.jitter**2 + np.mean([one.deviation**2 for one in recent])) / count)
        freedom = config.jitter_weight + len(older) - 1.0
        limit = float(stdtrit(freedom, 1.0 - 0.25 * config.false_alarms))  # two sides, two counts
        if abs(off.mean()) > limit * error and (off / off.mean() > LEAST_SHARE).all():
            mean = float(np.mean([one.delay for one in recent]))
            return recent, f"the gripper's delay changed from {1e3 * before.mean:.0f} to {1e3 * mean:.0f} ms"
    return every, ""
