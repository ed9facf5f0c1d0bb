"""Tables as Markdown, which Rerun's text view sets as tables."""

from collections.abc import Iterable, Sequence
from math import isnan

WHOLE, LARGE = 100.0, 1e6
"""Between these a number is shown without decimals or an exponent."""

STRUCTURE = str.maketrans({"|": "\\|", "\n": " ", "\r": " "})
"""What would end a cell."""


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table; what is in a cell stays in it."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(cell.translate(STRUCTURE) for cell in line) + " |" for line in lines)


def number(value: float) -> str:
    """A number in at most six characters or so; a dash where there is none."""
    if isnan(value):
        return "-"
    return f"{value:.0f}" if WHOLE <= abs(value) < LARGE else f"{value:.3g}"
