"""Progress of long work on stderr: a bar on a terminal, a plain line every few seconds elsewhere.

Both show how much is done, the rate, and the remaining time if it is known.
"""

import sys
import time
from types import TracebackType
from typing import Any, Self

SECONDS_BETWEEN_LINES = 10.0
UNITS_OF_TIME = ((3600.0, "h"), (60.0, "min"), (1.0, "s"))


class Progress:
    """Counts what is done; use it as a context manager.

    Args:
        what: name of the work, e.g. "reading".
        unit: name of what is counted, e.g. "tosses".
        total: total number; None if it is not known.
        done: number that was done before.
    """

    def __init__(self, what: str, unit: str, total: int | None = None, done: int = 0) -> None:
        self._what, self._unit, self._total = what, unit, total
        self._before = self._done = done
        self._share: float | None = None
        self._note = ""
        self._bar: Any = None
        self._began = time.monotonic()
        self._next_line = self._began + SECONDS_BETWEEN_LINES

    def advance(self, count: int = 1, note: str = "", share: float | None = None) -> None:
        """Counts `count` more as done; see `pipeline.workers.Bar`. With a total, that gives the share."""
        self._done += count
        self._share, self._note = share or self._share, note or self._note
        now = time.monotonic()
        if self._bar is not None:
            left = self._left(now) if self._total is None else ""
            self._bar.set_postfix_str(", ".join(filter(None, (left, self._note))), refresh=False)
            self._bar.update(count)
        elif now >= self._next_line:
            self._next_line = now + SECONDS_BETWEEN_LINES
            print(self._line(now), file=sys.stderr, flush=True)

    def _line(self, now: float) -> str:
        of = "" if self._total is None else f" of {self._total}"
        rate = (self._done - self._before) / (now - self._began)
        parts = (f"{self._done}{of} {self._unit}", f"{rate:.3g} {self._unit}/s", self._left(now), self._note)
        return f"{self._what}: {', '.join(filter(None, parts))}"

    def _left(self, now: float) -> str:
        """The remaining time at the rate so far; empty if it is not known."""
        share = self._share or 0.0
        if self._total is not None and self._total > self._before:
            share = min((self._done - self._before) / (self._total - self._before), 1.0)
        return f"{in_words((now - self._began) * (1.0 - share) / share)} left" if share else ""

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


def in_words(seconds: float) -> str:
    """A duration in words: ``42 s``, ``3 min``, ``2.5 h``."""
    size, unit = next(((size, unit) for size, unit in UNITS_OF_TIME if seconds >= size), UNITS_OF_TIME[-1])
    return f"{seconds / size:.{1 if unit == 'h' else 0}f} {unit}"
