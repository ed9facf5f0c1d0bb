"""Style of all figures: colours that colour-blind people can distinguish, ticks, titles, and writing of files.

The colours are those of Okabe and Ito ("Color Universal Design", 2008), and greys for what is there anyway. Their yellow is
left out: it is hardly seen on white. Each panel says in its title what is seen in it, its legend stands above it, and its ticks
are plain numbers. matplotlib is imported when something is drawn.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from math import log10
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from contact_curation.files import write_atomically

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
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
"""Colour of what was measured, and of lines to compare with."""

LEVEL = Colour(68, 68, 68)
"""Colour of a level in a figure of curves."""

GREY = Colour(153, 153, 153)
"""Colour of a curve among coloured ones."""

PALE = Colour(184, 184, 184)
"""Colour of areas in the background."""


def save_figure(figure: "Figure", path: Path) -> Path:
    """Writes a figure as PNG and returns its path.

    Raises:
        InvalidValueError: no PNG can be written there.
    """
    content = BytesIO()
    with _settings():
        figure.savefig(content, format="png", metadata={"Software": "contact_curation"})  # by which it is known again
    write_atomically(path, content.getvalue())
    return path


STYLE: Any = {
    "font.size": 11,
    "text.parse_math": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 12,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "legend.frameon": False,
}
"""Settings of every figure, as matplotlib calls them. Names of files and parameters are text, never formulas."""

TITLE_ABOVE_LEGEND, TICK_SIZE, LEGEND_SIZE = 24.0, 10.0, 10.0
"""[points]"""

FEW_DECADES, SOME_DECADES, MANY_DECADES = 0.45, 1.3, 2.6
"""Numbers of decades on a logarithmic axis: below these it shows the steps 1-2-3-5 and 1-2-5, above them decades alone."""

PLAIN_FROM, PLAIN_TO = 1e-3, 1e5
"""Numbers between these are shown without a power of ten."""

SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@contextmanager
def new_figure(width: float, height: float, dots: int) -> "Iterator[Figure]":
    """A figure to draw into within the context, in the style of all figures.

    Args:
        width, height: [inch].
        dots: per inch.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with _settings(STYLE):
        figure = Figure(figsize=(width, height), dpi=dots, layout="constrained")
        FigureCanvasAgg(figure)
        yield figure


@contextmanager
def _settings(style: Any = ()) -> "Iterator[None]":
    """Draws with the defaults of matplotlib and `style`, in place of the user's settings, such as text by LaTeX."""
    from matplotlib import rc_context, rcdefaults, rcParams

    with rc_context():
        rcdefaults()
        rcParams.update(style)
        yield


def entitle(axes: "Axes", message: str, columns: int = 0) -> None:
    """Writes the title above a panel, with the legend between them, where it covers nothing.

    Args:
        axes: panel into which everything is drawn.
        message: one line, or a few.
        columns: number of columns of the legend; 0: there is none.
    """
    axes.tick_params(labelsize=TICK_SIZE)
    axes.set_title(message, pad=TITLE_ABOVE_LEGEND if columns else 6.0)
    if columns:
        axes.legend(
            loc="lower left",
            bbox_to_anchor=(0.0, 1.0),
            ncols=columns,
            fontsize=LEGEND_SIZE,
            columnspacing=1.4,
            handlelength=1.8,
            borderaxespad=0.2,
            borderpad=0.1,
        )


def logarithmic(axis: "Axis") -> None:
    """Gives an axis, once everything is drawn, the ticks of a logarithmic one, in plain numbers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter, NullLocator

    axis.axes.set(**{f"{axis.axis_name}scale": "log"})  # type: ignore[attr-defined]
    low, high = axis.get_view_interval()
    decades = float(log10(high / low))
    if decades < FEW_DECADES:
        axis.set_major_locator(MaxNLocator(5))
        axis.set_minor_locator(NullLocator())
    else:
        steps = (1.0, 2.0, 3.0, 5.0) if decades < SOME_DECADES else (1.0, 2.0, 5.0) if decades < MANY_DECADES else (1.0,)
        axis.set_major_locator(LogLocator(subs=steps, numticks=12))
    axis.set_major_formatter(FuncFormatter(plain_number))
    axis.set_minor_formatter(NullFormatter())


def plain_number(value: float, _place: float | None = None) -> str:
    """A number as a tick shows it, without formulas: 0.02, 300, 2·10⁶."""
    if value == 0.0 or PLAIN_FROM <= abs(value) < PLAIN_TO:
        return f"{value:.6g}"
    mantissa, power = f"{value:.3e}".split("e")
    shown, ten = f"{float(mantissa):g}", f"10{str(int(power)).translate(SUPERSCRIPTS)}"
    return {"1": ten, "-1": f"-{ten}"}.get(shown, f"{shown}·{ten}")
