"""What the criteria should say, by definition: plain loops over dense matrices, with nothing clever."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.information.record import TossInformation


def log_det_value(infos: Sequence[TossInformation], prior: Array) -> float:
    """Log-det of prior and tosses together, relative to the prior."""
    total = prior + sum(info.fisher() for info in infos)
    return float(np.linalg.slogdet(total)[1] - np.linalg.slogdet(prior)[1])


def smallest_eigenvalue(infos: Sequence[TossInformation], prior: Array) -> float:
    """Smallest eigenvalue of prior and tosses together."""
    return float(np.linalg.eigvalsh(prior + sum(info.fisher() for info in infos))[0])


def naive_greedy(infos: Sequence[TossInformation], prior: Array, top: int) -> list[tuple[str, float]]:
    """Greedy log-det: every toss is evaluated in every step; ids and gains."""
    left = sorted(infos, key=lambda info: info.toss_id)
    kept: list[TossInformation] = []
    picks = []
    for _ in range(min(top, len(left))):
        value = log_det_value(kept, prior)
        gains = [log_det_value([*kept, info], prior) - value for info in left]
        best = next(i for i, gain in enumerate(gains) if gain >= max(gains) - 1e-9 * abs(max(gains)) - 1e-12)
        picks.append((left[best].toss_id, gains[best]))
        kept.append(left.pop(best))
    return picks


def best_log_det(infos: Sequence[TossInformation], prior: Array, top: int) -> float:
    """Largest log-det of all sets of `top` tosses."""
    return max(log_det_value(chosen, prior) for chosen in combinations(infos, top))


def mean_toss(infos: Sequence[TossInformation]) -> Array:
    """Mean Fisher matrix of the tosses."""
    return np.asarray(sum(info.fisher() for info in infos) / len(infos))
