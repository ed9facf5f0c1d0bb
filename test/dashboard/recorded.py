"""Reading back what a dashboard wrote, from its .rrd file."""

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
from rerun.chunk import RrdReader
from rerun.error_utils import RerunWarning

from contact_curation.dashboard.live.screen import Screen

ROW_ID = "rerun.controls.RowId"


class Recorded:
    """A recording.

    Args:
        path: of an .rrd file that is closed.
    """

    def __init__(self, path: Path) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RerunWarning)  # that there is no footer, as is meant
            reader = RrdReader(path)
            self.blueprints = len(reader.blueprints())
        self._chunks = [(chunk.entity_path, chunk.to_record_batch()) for chunk in reader.stream().to_chunks()]

    def column(self, entity: str, name: str) -> list[Any]:
        """All values of a component of an entity, in the order they were written."""
        return self._ordered(entity, name, lambda values: values.to_pylist())

    def times(self, entity: str, timeline: str) -> list[int]:
        """Where an entity's rows are on a timeline, in the order they were written; stamps in ns."""
        return self._ordered(entity, timeline, lambda values: values.cast("int64").to_pylist())

    def _ordered(self, entity: str, name: str, plain: Callable[[Any], list[Any]]) -> list[Any]:
        """Chunks come as they were filled; the ids of their rows count up as they were logged."""
        rows: list[tuple[bytes, Any]] = []
        for batch in self._batches(entity, name):
            rows += zip(batch.column(ROW_ID).to_pylist(), plain(batch.column(name)), strict=True)
        return [value for _, value in sorted(rows, key=lambda row: row[0])]

    def _batches(self, entity: str, name: str) -> list[Any]:
        return [batch for path, batch in self._chunks if path == entity and name in batch.schema.names]

    def kind(self, entity: str, timeline: str) -> str:
        """Of a timeline, as Arrow calls it."""
        return str(self._batches(entity, timeline)[0].schema.field(timeline).type)

    def rows(self, entity: str) -> int:
        """How many rows an entity has that are not there at all times."""
        return sum(batch.num_rows for path, batch in self._chunks if path == entity and "toss" in batch.schema.names)

    def texts(self, entity: str) -> list[str]:
        """Pages or lines of an entity."""
        return [text for name in ("TextDocument:text", "TextLog:text") for (text,) in self.column(entity, name)]

    def scalars(self, entity: str) -> list[float]:
        """Points of a curve."""
        return [value for (value,) in self.column(entity, "Scalars:scalars")]


def recording_screen(path: Path) -> Screen:
    """A screen that writes to a file."""
    stream = rr.RecordingStream("test")
    stream.set_sinks(rr.FileSink(path))
    return Screen(stream)


def recorded(screen: Screen, path: Path) -> Recorded:
    """What was written, once the screen is closed."""
    screen.stream.flush()
    screen.stream.disconnect()
    return Recorded(path)


def finite(values: Any) -> bool:
    """Whether there are numbers, all finite."""
    array = np.asarray(values, dtype=float)
    return array.size > 0 and bool(np.isfinite(array).all())
