"""Ctrl-C and SIGTERM: noted, so that the work can end in order, or turned into the same KeyboardInterrupt."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType, TracebackType
from typing import Any, Never, Self

STOPPING = (signal.SIGINT, signal.SIGTERM)
ENDINGS = (signal.SIGTERM, signal.SIGHUP)


class StopSignals:
    """Notes the first signal; a second one interrupts at once. Use it as a context manager in the main thread.

    Attributes:
        wanted: whether a signal has come.
    """

    def __init__(self) -> None:
        self.wanted = False
        self._before: dict[signal.Signals, Any] = {}

    def __enter__(self) -> Self:
        self._before = {each: signal.signal(each, self._note) for each in STOPPING}
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        for each, handler in self._before.items():
            signal.signal(each, handler)

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self.wanted:
            raise KeyboardInterrupt
        self.wanted = True


@contextmanager
def endings_as_interrupt() -> Iterator[None]:
    """Makes SIGTERM and SIGHUP (a closed terminal) raise KeyboardInterrupt like Ctrl-C, so that no half-written file remains.

    Signals that are ignored (`nohup`) stay ignored. Use it in the main thread.
    """
    taken = [each for each in ENDINGS if signal.getsignal(each) is not signal.SIG_IGN]
    before = {each: signal.signal(each, _interrupt) for each in taken}
    try:
        yield
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)


def _interrupt(number: int, frame: FrameType | None) -> Never:
    raise KeyboardInterrupt
