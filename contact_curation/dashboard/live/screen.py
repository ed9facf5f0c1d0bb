"""Where a dashboard's views write: a Rerun recording, and the moment that what is written belongs to.

Two timelines: `toss`, the number of tosses so far, which every view follows by default, and `ros_time`, the tosses' own stamps.
Only stamps that come from tosses move time: nodes stamp their diagnostics by other clocks, and a recording that is played, or a
simulation, lives in another time than the wall's. Stamps of a simulation count from zero; they are durations, not dates.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import isnan
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from contact_curation.dashboard.live.recorded_file import RecordedFile
from contact_curation.dashboard.live.web_viewer import WebViewer
from contact_curation.dashboard.style import Colour
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.toss import NANOSECONDS

WHOLE, LARGE = 100.0, 1e6
"""Numbers between these are shown without decimals and exponent."""

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


TOSS, ROS_TIME = "toss", "ros_time"

FIRST_DATE_NS = 946_684_800 * NANOSECONDS
"""2000-01-01: earlier stamps are no dates."""


@dataclass(frozen=True, order=True)
class Moment:
    """A place on both timelines.

    Attributes:
        toss: how many tosses there were.
        stamp_ns: stamp [ns] of the newest.
    """

    toss: int = 0
    stamp_ns: int = 0


class Screen:
    """A recording to write views to.

    Args:
        stream: stream of Rerun.
        viewer: page that shows it; None where none is served.
        file: file that it is written to; None for none.
    """

    def __init__(self, stream: rr.RecordingStream, viewer: WebViewer | None = None, file: RecordedFile | None = None) -> None:
        self.stream = stream
        self.viewer = viewer
        self.file = file
        self._dates: bool | None = None

    def at(self, moment: Moment) -> None:
        """Everything that is logged from now on belongs to this moment."""
        self.stream.reset_time()
        self.stream.set_time(TOSS, sequence=moment.toss)
        if moment.stamp_ns:
            (column,) = self._times(np.array([moment.stamp_ns])).values()
            self.stream.set_time(ROS_TIME, **{self._kind: column[0]})

    def log(self, path: str, *what: rr.AsComponents) -> None:
        """Logs to an entity at the moment."""
        self.stream.log(path, *what)

    def always(self, path: str, *what: rr.AsComponents) -> None:
        """Logs what holds at all times."""
        self.stream.log(path, *what, static=True)

    def frames(self, path: str, toss: int, stamps_ns: NDArray[np.int64], columns: Any) -> None:
        """Logs T rows of an entity at stamps (T,) of one toss."""
        times = [
            rr.TimeColumn(TOSS, sequence=np.full(len(stamps_ns), toss)),
            rr.TimeColumn(ROS_TIME, **self._times(stamps_ns)),
        ]
        self.stream.send_columns(path, times, columns)

    def text(self, path: str, markdown: str) -> None:
        """Logs a page."""
        self.log(path, rr.TextDocument(markdown, media_type=rr.MediaType.MARKDOWN))

    def values(self, path: str, values: dict[str, float]) -> None:
        """Logs one point of several curves, those that are finite, each to an entity of its own below `path`."""
        for name, value in values.items():
            if np.isfinite(value):
                self.log(f"{path}/{name}", rr.Scalars(float(value)))

    def curve(self, path: str, name: str, colour: Colour) -> None:
        """Says how a curve looks."""
        self.always(path, rr.SeriesLines(colors=colour, names=name, widths=2.0))
        self.always(path, rr.SeriesPoints(colors=colour, names=name, marker_sizes=3.0))

    @property
    def _kind(self) -> str:
        return "timestamp" if self._dates else "duration"

    def _times(self, stamps_ns: NDArray[np.int64]) -> dict[str, Any]:
        """Stamps as dates or as durations, as the first stamp was: a timeline has one kind."""
        if self._dates is None:
            self._dates = bool(stamps_ns[0] >= FIRST_DATE_NS)
        return {self._kind: stamps_ns.astype("datetime64[ns]" if self._dates else "timedelta64[ns]")}


def quaternions_xyzw(orientations_wxyz: Array) -> Array:
    """Quaternions (..., 4) in Rerun's order."""
    return np.roll(orientations_wxyz, -1, axis=-1)
