"""The readiness check: whether theta is good enough to choose throws (method.md 0.6, 2.4).

At a theta that training has not brought near the truth a ranking of throws is noise: two random initialisations rank them
with a correlation of -0.01. Three things are asked, none of which needs the truth: enough tosses are known; theta predicted the
newest of them, by the losses they had when they were first scored, before anybody learned from them; and thetas that should be
alike (the newest and the one before it, or several particles) say the same of the same reference throws. Losses of tosses that
theta learned from would tell nothing: few tosses are fitted well by many thetas.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from contact_curation.configs import ranged, set_whole_numbers
from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.smoothing import QUIET_PERIOD, kinematic_noise_growth

CUBE_LOSS = 0.15
"""Largest loss of ContactNets' cube, characteristic units."""

NOISE_LOSS = 0.007
"""The part of it that the noise of its rig may have at 150 frames a second: four times what it has in simulated tosses."""


@dataclass(frozen=True)
class ReadinessConfig:
    """When theta passes the readiness check.

    Attributes:
        enabled: whether the readiness check is made; if not, any theta passes.
        least_tosses: number of scored tosses that theta needs at least.
        recent: number of newest tosses whose losses are checked.
        largest_loss: largest median loss of the newest tosses, each when it was first scored, in characteristic units
            (method.md 1.2); by default that of a velocity that no impulse explains, the same for all bodies [m/s]: 0.15 for
            ContactNets' cube, whose real tosses have 0.03 at the true parameters. Noise adds what it makes of velocities over
            150 frames a second, or with a noisier tracker than ContactNets'.
        tracker_noise: noise of the poses as a multiple of that of ContactNets' rig, as in pose_ingest's
            segmenter.tracker_noise.
        least_agreement: smallest Spearman correlation of the reference throws' information between two thetas.
        most_tosses: from this many scored tosses on agreement is no longer required, only the loss; 0 requires it always.
    """

    enabled: bool = True
    least_tosses: int = 4
    recent: int = 3
    largest_loss: float | None = None
    tracker_noise: float = ranged(1.0, 1.0, 1e3)
    least_agreement: float = 0.5
    most_tosses: int = 6

    def __post_init__(self) -> None:
        set_whole_numbers(self, ("least_tosses", "most_tosses"), prefix="readiness.")
        set_whole_numbers(self, ("recent",), 1, prefix="readiness.")
        if self.largest_loss is not None and not self.largest_loss > 0.0:
            raise InvalidValueError("readiness.largest_loss", self.largest_loss, "a positive number")
        if not 1.0 <= self.tracker_noise < np.inf:
            expected = "1 or more, in multiples of that of ContactNets' rig"
            raise InvalidValueError("readiness.tracker_noise", self.tracker_noise, expected)
        if not -1.0 <= self.least_agreement <= 1.0:
            raise InvalidValueError("readiness.least_agreement", self.least_agreement, "a correlation")

    def of_body(self, body: Body, frame_period: float = QUIET_PERIOD) -> "ReadinessConfig":
        """The same with a loss for the body and its tracker's frame period [s], where its user has set none."""
        cube = CONTACTNETS_CUBE
        of_cube = CUBE_LOSS + NOISE_LOSS * (kinematic_noise_growth(frame_period, self.tracker_noise) ** 2 - 1.0)
        loss = of_cube * (cube.length_scale / body.length_scale) ** 2
        return replace(self, largest_loss=self.largest_loss or loss)


def unready_reason(config: ReadinessConfig, losses: Sequence[float], scores: Sequence[Array]) -> str | None:
    """Why theta does not pass the readiness check, in one line; None when it does.

    Args:
        config: when it does (`ReadinessConfig.of_body`).
        losses: mean loss of each known toss when it was first scored, oldest first.
        scores: of the same reference throws at each theta, (R,) each; with less than two thetas nothing can agree.
    """
    if len(losses) < config.least_tosses:
        return f"tosses: found {len(losses)}, expected at least {config.least_tosses}"
    loss, largest = float(np.median(losses[-config.recent :])) if losses else 0.0, config.largest_loss or CUBE_LOSS
    if not loss <= largest:
        return f"loss: found a median of {loss:.3g}, expected at most {largest:.3g}"
    if config.most_tosses and len(losses) >= config.most_tosses:
        return None
    if len(scores) < 2:
        return f"thetas: found {len(scores)}, expected two that agree"
    agreement = min(spearman(one, other) for one, other in pairwise(scores))
    if not agreement >= config.least_agreement:
        return f"agreement: found a rank correlation of {agreement:.2f}, expected at least {config.least_agreement:g}"
    return None


def spearman(one: Array, other: Array) -> float:
    """Rank correlation of two rows (R,); ties go by place. Not a number where there are fewer than two."""
    if len(one) < 2:
        return float("nan")
    ranks = np.array([np.argsort(np.argsort(values, kind="stable"), kind="stable") for values in (one, other)], dtype=float)
    return float(np.corrcoef(ranks)[0, 1])
