"""A figure becomes a PNG file."""

from pathlib import Path
from typing import TYPE_CHECKING

from contact_curation.errors import InvalidValueError

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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
