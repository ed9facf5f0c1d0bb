"""Types of options; argparse refuses other values as bad usage."""

import argparse
import math
from pathlib import Path

Arguments = argparse.Namespace


def positive_integer(text: str) -> int:
    """Reads a whole number of at least 1, for argparse."""
    return _at_least(text, 1)


def natural_number(text: str) -> int:
    """Reads a whole number of at least 0, for argparse."""
    return _at_least(text, 0)


def positive_number(text: str) -> float:
    """Reads a finite number above 0, for argparse."""
    number = _number(text)
    if not (math.isfinite(number) and number > 0.0):
        raise argparse.ArgumentTypeError(f"found {text}, expected a number above 0")
    return number


def number_from_zero(text: str) -> float:
    """Reads a finite number of at least 0, for argparse."""
    number = _number(text)
    if not (math.isfinite(number) and number >= 0.0):
        raise argparse.ArgumentTypeError(f"found {text}, expected a number of at least 0")
    return number


def place(text: str) -> tuple[float, float, float]:
    """Reads three finite numbers with commas between them, for argparse."""
    numbers = [_number(part) for part in text.split(",")]
    if len(numbers) != 3 or not all(map(math.isfinite, numbers)):
        raise argparse.ArgumentTypeError(f"found {text}, expected three numbers like 0,0.001,-0.002")
    x, y, z = numbers
    return x, y, z


class PathEndingIn:
    """A path that must have one of the given endings."""

    def __init__(self, *endings: str) -> None:
        self._endings = endings

    def __call__(self, text: str) -> Path:
        path = Path(text)
        if path.suffix not in self._endings:
            raise argparse.ArgumentTypeError(f"found {text}, expected a name ending in {' or '.join(self._endings)}")
        return path


def _at_least(text: str, least: int) -> int:
    try:
        number = int(text)
    except ValueError:
        number = least - 1
    if number < least:
        raise argparse.ArgumentTypeError(f"found {text}, expected a whole number of at least {least}")
    return number


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
