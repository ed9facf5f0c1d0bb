"""Ctrl-C and SIGTERM: as a wish, so that what runs comes to a good end, or as the same interrupt, which tidies up and ends."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType, TracebackType
from typing import Any, Never, Self

STOPPING = (signal.SIGINT, signal.SIGTERM)
ENDINGS = (signal.SIGTERM, signal.SIGHUP)


class StopSignals:
    """Notes the signals; a second one does not wait. Use it as a context manager in the main thread.

    Attributes:
        wanted: whether one has come.
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
    """SIGTERM, and SIGHUP of a terminal that is closed, raise KeyboardInterrupt as Ctrl-C does: nothing half written stays.

    What is ignored stays so (`nohup`). For the main thread.
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
