"""The numbers that a user gives for a record, checked and copied: nobody can change the record's own afterwards."""

from collections.abc import Mapping
from types import NoneType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array

LONGEST = 60
"""Characters of a value that a message shows."""


def frozen[Number: np.generic](array: NDArray[Number]) -> NDArray[Number]:
    """A copy that cannot be written to, row after row in memory."""
    copy = np.array(array, order="C")
    copy.flags.writeable = False
    return copy


def numbers(name: str, value: Any) -> Array:
    """A copy of numbers, which cannot be written to; truth values, dates and None are none.

    Raises:
        InvalidValueError: something else, rows of different lengths, or a number that no computer holds.
    """
    try:
        if has_other(value):
            raise ValueError
        return frozen(np.asarray(value, dtype=float))
    except (TypeError, ValueError) as error:
        raise InvalidValueError(name, shortened(value), "numbers") from error
    except OverflowError as error:
        raise InvalidValueError(name, "an integer of over 300 digits", "numbers") from error


def number(name: str, value: Any) -> float:
    """One number; the rest as of `numbers`."""
    found = numbers(name, value)
    if found.shape != ():
        raise InvalidValueError(name, shortened(value), "one number")
    return float(found)


def has_other(value: Any) -> bool:
    """Whether there is a truth value, a mapping or None somewhere in nested lists."""
    if isinstance(value, list | tuple):
        return any(map(has_other, value))
    return isinstance(value, bool | np.bool_ | Mapping | NoneType)


def shortened(value: Any) -> str:
    """The value for a message."""
    shown = str(value)
    return shown if len(shown) <= LONGEST else f"{shown[: LONGEST - 3]}..."
