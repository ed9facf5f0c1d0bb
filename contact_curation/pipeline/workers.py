"""Runs the same work for several inputs, in one process or several, and reports progress."""

import multiprocessing
import multiprocessing.connection
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from typing import Protocol

from contact_curation.errors import ContactCurationError


class Advance(Protocol):
    """Called with the number of tosses done since the last call, and sometimes the share of all work."""

    def __call__(self, count: int, /, *, share: float | None = None) -> None:
        """So many more are done; `share` of the whole work, from 0 to 1, where that is known."""


def unheard(count: int, /, *, share: float | None = None) -> None:
    """Ignores progress."""


class Bar(Protocol):
    """One piece of work under way."""

    def advance(self, count: int = 1, note: str = "", share: float | None = None) -> None:
        """So many more are done; `note` says how it goes, `share` how much of all, from 0 to 1."""


class Progress(Protocol):
    """Makes a bar for each piece of work."""

    def __call__(self, what: str, unit: str, total: int | None = None, done: int = 0, /) -> AbstractContextManager[Bar]:
        """A bar.

        Args:
            what: is being done, e.g. "reading".
            unit: of what is counted, e.g. "tosses".
            total: how many there will be; None where nobody knows.
            done: how many of them were done before.
        """


class _Silent:
    def advance(self, count: int = 1, note: str = "", share: float | None = None) -> None:
        pass


def silent(what: str, unit: str, total: int | None = None, done: int = 0) -> AbstractContextManager[Bar]:
    """Progress that is not shown."""
    return nullcontext(_Silent())


class WorkerDiedError(ContactCurationError):
    """A worker process ended before its work did."""

    def __init__(self, jobs: int) -> None:
        super().__init__(f"one of {jobs} worker processes was killed, perhaps for want of memory: try fewer with --jobs")


def each[Input, Result](
    work: Callable[[Input, Advance], Result], inputs: Sequence[Input], jobs: int, advance: Advance
) -> Iterator[Result]:
    """The results of `work` for each of `inputs`, in their order.

    With several processes `work` and `inputs` are pickled, and `advance` is told of an input when it is done.

    Raises:
        WorkerDiedError: a process died, e.g. for want of memory.
    """
    jobs = min(jobs, len(inputs))
    if jobs <= 1:
        for place, one in enumerate(inputs, start=1):
            yield work(one, advance)
            advance(0, share=place / len(inputs))
        return
    # Forking a process whose libraries have threads can hang: start fresh ones.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=context, initializer=_end_with_the_parent) as executor:
        try:
            for place, (result, count) in enumerate(executor.map(partial(_counted, work), inputs), start=1):
                advance(count, share=place / len(inputs))
                yield result
        except BrokenProcessPool as error:
            raise WorkerDiedError(jobs) from error
        except KeyboardInterrupt:  # of this process alone: workers would end their inputs first
            for worker in multiprocessing.active_children():
                worker.terminate()
            raise
        finally:
            executor.shutdown(wait=False, cancel_futures=True)


def _counted[Input, Result](work: Callable[[Input, Advance], Result], one: Input) -> tuple[Result, int]:
    count = 0

    def advance(more: int, /, *, share: float | None = None) -> None:
        nonlocal count
        count += more

    return work(one, advance), count


def _end_with_the_parent() -> None:
    """An interrupt ends a worker without a word, and so does the death of its parent, which it would otherwise wait for."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_after, args=(parent.sentinel,), daemon=True).start()


def _end_after(sentinel: int) -> None:
    multiprocessing.connection.wait([sentinel])
    os._exit(1)
