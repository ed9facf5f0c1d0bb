"""What happens in a session, one JSON object a line: `{"time": 12.3, "event": "died", "node": "curator", ...}`."""

import json
import time
from collections import Counter
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from contact_curation.errors import InvalidValueError, UnreadableInputError
from contact_curation.session.supervisor import Incident


class EventLog:
    """Writes events, and keeps them; use it as a context manager.

    Args:
        path: of the file; an older one is replaced.
        resume: whether an older one is gone on with instead: its time, too. A line that was cut is removed.

    Raises:
        UnreadableInputError: what is to be gone on with is no such file.
    """

    def __init__(self, path: Path, *, resume: bool = False) -> None:
        self._path = path
        self.events: list[dict[str, Any]] = _events_of(path) if resume else []
        self._file = path.open("r+" if resume else "w", encoding="utf-8")
        if resume:
            self._file.truncate(len(_whole_lines(path)))
            self._file.seek(0, 2)
        self._began = time.monotonic() - max((one["time"] for one in self.events), default=0.0)

    @property
    def seconds(self) -> float:
        """Since the session began; the time between its end and its resumption does not count."""
        return time.monotonic() - self._began

    @property
    def restarts(self) -> dict[str, int]:
        """How often each node was started again after a death."""
        return dict(Counter(one["node"] for one in self.events if one["event"] == "restarted"))

    def count(self, event: str) -> int:
        """How often something happened."""
        return sum(one["event"] == event for one in self.events)

    def note_body(self, body: str) -> None:
        """Notes the session's body, once; another one's throws, tosses and model would be mixed with its own.

        Raises:
            InvalidValueError: the session that is gone on with throws another one.
        """
        before = next((one["body"] for one in self.events if one["event"] == "body"), None)
        if before is None:
            self.note("body", body=body)
        elif before != body:
            raise InvalidValueError("--body", body, f"{before}, which the session throws, or a new folder for --record")

    def note(self, event: str, **more: Any) -> dict[str, Any]:
        """Something happened, now.

        Raises:
            InvalidValueError: the file cannot be written, as where the disk is full.
        """
        entry = {"time": round(self.seconds, 3), "wall_time": round(time.time(), 3), "event": event, **more}
        try:
            self._file.write(json.dumps(entry, ensure_ascii=False) + "\n")
            self._file.flush()
        except OSError as error:
            raise InvalidValueError("--record", self._path, f"a file that can be written ({error.strerror})") from error
        self.events.append(entry)
        return entry

    def incident(self, incident: Incident) -> None:
        """Something happened to a node."""
        detail = {"detail": incident.detail} if incident.detail else {}
        self.note(incident.what, node=incident.program, pid=incident.pid, **detail)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        with suppress(OSError):  # what could not be written has been said
            self._file.close()


def _whole_lines(path: Path) -> bytes:
    """The file without a line that was cut."""
    data = path.read_bytes()
    return data[: data.rfind(b"\n") + 1]


def _events_of(path: Path) -> list[dict[str, Any]]:
    try:
        events = [json.loads(line) for line in _whole_lines(path).splitlines()]
        if all(isinstance(one, dict) and {"time", "event"} <= one.keys() for one in events):
            return events
    except ValueError as error:
        raise UnreadableInputError(path, f"expected the events of a session ({error})") from error
    raise UnreadableInputError(path, "expected the events of a session, each with its time")
