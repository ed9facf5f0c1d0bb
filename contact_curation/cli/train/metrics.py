"""The metrics of a training, one line of JSON each: its start, selections and evaluations in their order, its end.

A training that was stopped and resumed has the same metrics as an uninterrupted one.
"""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TextIO

from contact_curation.errors import InvalidValueError
from contact_curation.files import write_atomically
from contact_curation.learning.checkpoints.selection_document import document_of
from contact_curation.learning.training.curated import CuratedTraining
from contact_curation.learning.training.progress import Evaluated, Progress
from contact_curation.learning.training.reranking import Selected
from contact_curation.pipeline.wording import json_line


class TrainingMetrics:
    """Writes to one file; use it as a context manager.

    Args:
        path: path of the file; it is replaced, except for lines of the same training up to its checkpoint.
        curated: the training.
        start: content of the first line.

    Raises:
        InvalidValueError: the file cannot be written.
    """

    def __init__(self, path: Path, curated: CuratedTraining, start: Mapping[str, Any]) -> None:
        self._curated = curated
        steps = curated.training.progress.gradient_steps
        lines = (_lines_until(path, steps) if steps else []) or [json_line({"event": "start", **start}), *_told(curated)]
        self._steps = steps
        self._selections = len(curated.selections)
        write_atomically(path, "".join(f"{line}\n" for line in lines).encode())  # so that earlier lines are never lost
        self._file = _opened(path)

    def follow(self) -> None:
        """Writes the lines that are new since the last call."""
        told = self._curated
        fresh = [one for one in told.training.history[-1:] if one.gradient_steps > self._steps]
        chosen = told.selections[self._selections :]
        if fresh or chosen:
            self._write([*map(_evaluation, fresh), *map(_selection, chosen)])
        self._steps = told.training.counters.gradient_steps
        self._selections = len(told.selections)

    def end(self, progress: Progress) -> None:
        """Writes the last line of a training that has ended."""
        self._write([json_line({"event": "end", **json.loads(progress.json_line())})])

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._file.close()

    def _write(self, lines: Iterable[str]) -> None:
        self._file.writelines(f"{line}\n" for line in lines)
        self._file.flush()


def _opened(path: Path) -> TextIO:
    try:
        return path.open("a", encoding="utf-8")
    except OSError as error:
        raise InvalidValueError("--metrics", path, f"a path that can be written ({error.strerror})") from error


def _lines_until(path: Path, steps: int) -> list[str]:
    """The lines of an earlier run up to a gradient step, without the line of its end."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        return []
    return [line for line in lines if _still_holds(line, steps)]


def _still_holds(line: str, steps: int) -> bool:
    try:
        entry = json.loads(line)
        return bool(entry["event"] != "end" and entry["gradient_steps"] <= steps)
    except (ValueError, KeyError, TypeError):
        return False


def _told(curated: CuratedTraining) -> list[str]:
    """All lines of a training so far that its history contains."""
    lines = [(one.gradient_steps, 0, _evaluation(one)) for one in curated.training.history]
    lines += [(one.gradient_steps, 1, _selection(one)) for one in curated.selections]
    return [line for _, _, line in sorted(lines)]


def _evaluation(one: Evaluated) -> str:
    losses = {"training_loss": one.training_loss, "held_out_loss": one.held_out_loss}
    return json_line({"event": "evaluation", "gradient_steps": one.gradient_steps, "epochs": one.epochs, **losses})


def _selection(one: Selected) -> str:
    return json_line({"event": "selection", **document_of(one)})
