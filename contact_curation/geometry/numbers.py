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

OTHER_KINDS = "bmMc"
"""Of arrays that NumPy would convert to numbers: truth values, times and complex numbers."""


def frozen[Number: np.generic](array: NDArray[Number]) -> NDArray[Number]:
    """A copy that cannot be written to, row after row in memory."""
    copy = np.array(array, order="C")
    copy.flags.writeable = False
    return copy


def read_only[Number: np.generic](array: NDArray[Number]) -> NDArray[Number]:
    """The same array, which cannot be written to."""
    view = array.view()
    view.flags.writeable = False
    return view


def numbers(name: str, value: Any) -> Array:
    """A copy of numbers, which cannot be written to; truth values, times, complex, masked and None are none.

    Raises:
        InvalidValueError: something else, rows of different lengths, or a number that no computer holds.
    """
    try:
        return frozen(plain(value).astype(float))
    except (TypeError, ValueError) as error:
        raise InvalidValueError(name, shortened(value), "numbers") from error
    except RuntimeError as error:
        raise InvalidValueError(name, "a tensor that NumPy cannot read", "numbers, such as tensor.detach().cpu()") from error
    except OverflowError as error:
        raise InvalidValueError(name, "an integer of over 300 digits", "numbers") from error


def number(name: str, value: Any) -> float:
    """One number; the rest as of `numbers`."""
    found = numbers(name, value)
    if found.shape != ():
        raise InvalidValueError(name, shortened(value), "one number")
    return float(found)


def plain(value: Any) -> NDArray[Any]:
    """The value as an array.

    Raises:
        ValueError: it has truth values, times, complex numbers, masked ones or None, or rows of different lengths.
        TypeError, RuntimeError: it is a tensor of a GPU, or with gradients.
    """
    if has_other(value):
        raise ValueError
    array = np.asarray(value)
    if array.dtype.kind in OTHER_KINDS or (array.dtype.kind == "O" and has_other(array.tolist())):
        raise ValueError
    return array


def has_other(value: Any) -> bool:
    """Whether there is a truth value, a mapping, None or a masked number somewhere in nested lists."""
    if isinstance(value, list | tuple):
        return any(map(has_other, value))
    return isinstance(value, bool | np.bool_ | Mapping | NoneType) or (
        isinstance(value, np.ma.MaskedArray) and bool(np.ma.is_masked(value))
    )


def shortened(value: Any) -> str:
    """The value for a message."""
    masked, other = isinstance(value, np.ma.MaskedArray), isinstance(value, np.ndarray) and value.dtype.kind in OTHER_KINDS
    shown = f"{'masked ' if masked else f'{value.dtype} ' if other else ''}{value}"
    return shown if len(shown) <= LONGEST else f"{shown[: LONGEST - 3]}..."
