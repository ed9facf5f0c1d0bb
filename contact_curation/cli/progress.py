"""How far long work has come: a bar on a terminal, a plain line now and then elsewhere; on stderr, never between results."""

import sys
import time
from types import TracebackType
from typing import Any, Self

SECONDS_BETWEEN_LINES = 10.0


class Progress:
    """Counts what is done; use it as a context manager.

    Args:
        what: is being done, e.g. "reading".
        unit: of what is counted, e.g. "tosses".
        total: how many there will be; None where nobody knows.
        done: how many of them were done before.
    """

    def __init__(self, what: str, unit: str, total: int | None = None, done: int = 0) -> None:
        self._what, self._unit, self._total = what, unit, total
        self._done = done
        self._bar: Any = None
        self._next_line = time.monotonic() + SECONDS_BETWEEN_LINES

    def advance(self, count: int = 1, note: str = "") -> None:
        """So many more are done; `note` says how it goes."""
        self._done += count
        if self._bar is not None:
            self._bar.set_postfix_str(note, refresh=False)
            self._bar.update(count)
        elif time.monotonic() >= self._next_line:
            self._next_line = time.monotonic() + SECONDS_BETWEEN_LINES
            of = "" if self._total is None else f" of {self._total}"
            how = f", {note}" if note else ""
            print(f"{self._what}: {self._done}{of} {self._unit}{how}", file=sys.stderr, flush=True)

    def __enter__(self) -> Self:
        if sys.stderr.isatty():
            from tqdm import tqdm

            self._bar = tqdm(
                total=self._total, initial=self._done, desc=self._what, unit=f" {self._unit}", file=sys.stderr, leave=False
            )
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self._bar is not None:
            self._bar.close()
