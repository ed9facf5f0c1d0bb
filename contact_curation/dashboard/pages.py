"""Tables as Markdown, which Rerun's text view sets as tables."""

from collections.abc import Iterable, Sequence
from math import isnan

STRUCTURE = str.maketrans({"|": "\\|", "\n": " ", "\r": " "})
"""What would end a cell."""


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table; what is in a cell stays in it."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(cell.translate(STRUCTURE) for cell in line) + " |" for line in lines)


def number(value: float, digits: int = 3) -> str:
    """A number, short; a dash where there is none."""
    return "-" if isnan(value) else f"{value:.{digits}g}"
