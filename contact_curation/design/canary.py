"""Whether theta can be trusted with choosing throws (METHOD 0.6, 2.4).

At a theta that training has not brought near the truth a ranking of throws is noise: two random initialisations rank them
with a correlation of -0.01. Three things are asked, none of which needs the truth: enough tosses are known; they fit theta, by
the median of their mean losses; and thetas that should be alike (the newest and the one before it, or several particles) rank
the same reference throws alike.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array


@dataclass(frozen=True)
class CanaryConfig:
    """When theta is trusted.

    Attributes:
        enabled: whether it is asked at all; without, any theta is trusted.
        least_tosses: known at it.
        largest_loss: median over the tosses of their mean loss (METHOD 1.2), characteristic units; real tosses have 0.02 at the
            true parameters.
        least_agreement: Spearman correlation of the reference throws' gains between thetas.
    """

    enabled: bool = True
    least_tosses: int = 4
    largest_loss: float = 0.1
    least_agreement: float = 0.5

    def __post_init__(self) -> None:
        if self.least_tosses < 0:
            raise InvalidValueError("canary.least_tosses", self.least_tosses, "at least 0")
        if not self.largest_loss > 0.0:
            raise InvalidValueError("canary.largest_loss", self.largest_loss, "a positive number")
        if not -1.0 <= self.least_agreement <= 1.0:
            raise InvalidValueError("canary.least_agreement", self.least_agreement, "a correlation")


def distrust(config: CanaryConfig, losses: Sequence[float], gains: Sequence[Array]) -> str | None:
    """Why theta is not to be trusted, in one line; None when it is.

    Args:
        config: when it is.
        losses: mean loss of each known toss.
        gains: of the same reference throws at each theta, (R,) each; with less than two thetas nothing can agree.
    """
    if len(losses) < config.least_tosses:
        return f"tosses: found {len(losses)}, expected at least {config.least_tosses}"
    loss = float(np.median(losses)) if losses else 0.0
    if not loss <= config.largest_loss:
        return f"loss: found a median of {loss:.3g}, expected at most {config.largest_loss:g}"
    if len(gains) < 2:
        return f"thetas: found {len(gains)}, expected two that agree"
    agreement = min(spearman(one, other) for one, other in pairwise(gains))
    if not agreement >= config.least_agreement:
        return f"agreement: found a rank correlation of {agreement:.2f}, expected at least {config.least_agreement:g}"
    return None


def spearman(one: Array, other: Array) -> float:
    """Rank correlation of two rows (R,); ties go by place. Not a number where there are fewer than two."""
    if len(one) < 2:
        return float("nan")
    ranks = np.array([np.argsort(np.argsort(values, kind="stable"), kind="stable") for values in (one, other)], dtype=float)
    return float(np.corrcoef(ranks)[0, 1])
