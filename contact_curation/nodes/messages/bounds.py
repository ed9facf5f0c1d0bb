"""What numbers in messages may be: checked once, before anything is computed from them.

Anybody on the network can publish. A number far outside of what a thrown object does would overflow in the mathematics, and an
array far larger than any toss would take all memory: both are refused in one line, and the node goes on.
"""

from collections.abc import Sized

import numpy as np

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array

LARGEST_POSITION = 1e4
"""[m]"""
LARGEST_SPEED = 1e4
"""[m/s]"""
LARGEST_SPIN = 1e5
"""[rad/s]"""
MOST_FRAMES = 100_000
"""Most frames of a toss: over a minute at 1 kHz."""
MOST_NUMBERS = 1 << 20
"""Most numbers of a factor: 8 MiB."""
LARGEST_INFORMATION = 1e60
"""Largest score or entry of a factor, in characteristic units: its fourth power is still finite."""
MOST_IDS = 1 << 16
"""Most ids of selected tosses."""


def check_size(name: str, values: Sized, most: int) -> None:
    """Refuses an array that is longer than any sound one.

    Raises:
        InvalidValueError: it is.
    """
    if len(values) > most:
        raise InvalidValueError(name, f"{len(values)} entries", f"at most {most}")


def check_numbers(name: str, values: Array | float, largest: float) -> None:
    """Refuses numbers that are not finite or larger in magnitude than any sound one.

    Raises:
        InvalidValueError: there is one.
    """
    numbers = np.atleast_1d(np.asarray(values, dtype=float))
    bad = ~(np.abs(numbers) <= largest)
    if bad.any():
        raise InvalidValueError(name, f"{numbers[bad].ravel()[0]:.3g}", f"finite numbers of at most {largest:g}")
