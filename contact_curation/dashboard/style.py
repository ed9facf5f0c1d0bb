"""How everything is drawn: colours that people tell apart whatever colours they see, and how a figure becomes a file.

The colours are those of Okabe and Ito ("Color Universal Design", 2008), and greys for what is there anyway. Their yellow is
left out: it is hardly seen on white.
"""

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from contact_curation.errors import InvalidValueError

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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


def save_figure(figure: "Figure", path: Path) -> Path:
    """Writes it, and gives the path.

    Raises:
        InvalidValueError: no PNG can be written there.
    """
    try:
        figure.savefig(path, format="png")
    except OSError as error:
        raise InvalidValueError("file of the figure", path, f"a place where a PNG can be written ({error.strerror})") from error
    return path
