"""What happens in a session, one JSON object a line: `{"time": 12.3, "event": "died", "node": "curator", ...}`."""

import json
import time
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from contact_curation.session.supervisor import Incident


class EventLog:
    """Writes events, and keeps them; use it as a context manager.

    Args:
        path: of the file; an older one is replaced.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open("w", encoding="utf-8")
        self._began = time.monotonic()
        self.events: list[dict[str, Any]] = []

    @property
    def seconds(self) -> float:
        """Since the session began."""
        return time.monotonic() - self._began

    def note(self, event: str, **more: Any) -> dict[str, Any]:
        """Something happened, now."""
        entry = {"time": round(self.seconds, 3), "wall_time": round(time.time(), 3), "event": event, **more}
        self._file.write(json.dumps(entry, ensure_ascii=False) + "\n")
        self._file.flush()
        self.events.append(entry)
        return entry

    def incident(self, incident: Incident) -> None:
        """Something happened to a node."""
        detail = {"detail": incident.detail} if incident.detail else {}
        self.note(incident.what, node=incident.program, pid=incident.pid, **detail)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._file.close()
