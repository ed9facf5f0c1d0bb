"""Colours that people tell apart whatever colours they see, those of Okabe and Ito, and greys for what is there anyway.

Masataka Okabe and Kei Ito, "Color Universal Design", 2008. Their yellow is left out: it is hardly seen on white.
"""

from typing import NamedTuple


class Colour(NamedTuple):
    """Shares of 255, as Rerun takes them."""

    red: int
    green: int
    blue: int

    @property
    def web(self) -> str:
        """The same as matplotlib and pages take it."""
        return f"#{self.red:02x}{self.green:02x}{self.blue:02x}"


BLACK = Colour(0, 0, 0)
ORANGE = Colour(230, 159, 0)
SKY_BLUE = Colour(86, 180, 233)
GREEN = Colour(0, 158, 115)
BLUE = Colour(0, 114, 178)
VERMILION = Colour(213, 94, 0)
PURPLE = Colour(204, 121, 167)

INK = Colour(34, 34, 34)
"""Of what was measured, and of lines to compare with."""

LEVEL = Colour(68, 68, 68)
"""Of a level in a figure of curves."""

GREY = Colour(153, 153, 153)
"""Of a curve among coloured ones."""

PALE = Colour(184, 184, 184)
"""Of areas that others stand out from."""
