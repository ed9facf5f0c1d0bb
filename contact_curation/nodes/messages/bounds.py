"""Bounds of numbers and sizes in messages, checked once, before anything is computed from them.

Anybody on the network can publish. Numbers far beyond those of a thrown object would overflow in later computations, and an
array far larger than any toss would take all memory. Both are refused in one line, and the node continues.
"""

from collections.abc import Sized

import numpy as np

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array

LARGEST_POSITION = 1e4
"""Largest coordinate [m]."""
LARGEST_SPEED = 1e4
"""Largest linear velocity [m/s]."""
LARGEST_SPIN = 1e5
"""Largest angular velocity [rad/s]."""
MOST_FRAMES = 100_000
"""Largest number of frames of a toss: over a minute at 1 kHz."""
MOST_NUMBERS = 1 << 20
"""Largest number of entries of a factor: 8 MiB."""
LARGEST_INFORMATION = 1e60
"""Largest score or entry of a factor, in characteristic units; its fourth power does not overflow."""
MOST_IDS = 1 << 16
"""Largest number of selected tosses."""


def check_size(name: str, values: Sized, most: int) -> None:
    """Refuses an array with more than `most` entries.

    Raises:
        InvalidValueError: the array is longer.
    """
    if len(values) > most:
        raise InvalidValueError(name, f"{len(values)} entries", f"at most {most}")


def check_numbers(name: str, values: Array | float, largest: float) -> None:
    """Refuses numbers that are not finite or larger in magnitude than `largest`.

    Raises:
        InvalidValueError: there is such a number.
    """
    numbers = np.atleast_1d(np.asarray(values, dtype=float))
    bad = ~(np.abs(numbers) <= largest)
    if bad.any():
        raise InvalidValueError(name, f"{numbers[bad].ravel()[0]:.3g}", f"finite numbers of at most {largest:g}")
