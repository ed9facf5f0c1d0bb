"""Faults of a tracker put into good tosses and streams, the same for the same seed.

An outlier shifts the positions of a few frames by one vector. What it does to the velocities depends on the tracker, hence the
three kinds:

    raw       backward differences of the positions with outlier, unfiltered: v_j gains d/dt, the next frame loses it.
              method.md's check 11 ("28 caught, 0 false alarms") is this one.
    filtered  a median of three over those differences, which hides the outlier in the velocities.
    hidden    velocities from elsewhere, which know nothing of it.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.motion.smoothing import median_of_three
from contact_curation.motion.toss import Toss

OUTLIER = 0.005
"""Length of the shift [m]."""


def with_outliers(
    toss: Toss, rng: np.random.Generator, *, frames: int = 1, velocities: str = "raw", size: float = OUTLIER
) -> Toss:
    """The toss with a shift of `size` in a random direction at `frames` successive frames, not at its ends."""
    start = int(rng.integers(2, toss.frames - frames - 2))
    direction = rng.normal(size=3)
    shift = np.zeros((toss.frames, 3))
    shift[start : start + frames] = size * direction / np.linalg.norm(direction)
    changed = {"raw": _raw, "filtered": _filtered, "hidden": _hidden}[velocities](toss, shift)
    return replace(toss, positions=toss.positions + shift, linear_velocities=changed)


def contaminated(tosses: Sequence[Toss], number: int, seed: int, **kind: object) -> tuple[list[Toss], set[int]]:
    """All tosses, `number` of them with outliers; and which."""
    rng = np.random.default_rng(seed)
    chosen = set(rng.choice(len(tosses), number, replace=False).tolist())
    return [with_outliers(toss, rng, **kind) if index in chosen else toss for index, toss in enumerate(tosses)], chosen  # type: ignore[arg-type]


def _raw(toss: Toss, shift: Array) -> Array:
    return toss.linear_velocities + _quotients(shift, toss.frame_period, np.zeros(3))


def _filtered(toss: Toss, shift: Array) -> Array:
    return median_of_three(_quotients(toss.positions + shift, toss.frame_period, toss.linear_velocities[0]))


def _hidden(toss: Toss, shift: Array) -> Array:
    return toss.linear_velocities


def _quotients(positions: Array, frame_period: float, first: Array) -> Array:
    return np.concatenate([first[np.newaxis], np.diff(positions, axis=0) / frame_period])
