"""The same work for each of several inputs, in this process or in several; the results come in the order of the inputs."""

import multiprocessing
import multiprocessing.connection
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import partial

from contact_curation.errors import ContactCurationError

Advance = Callable[[int], None]
"""Told how many tosses more are done."""


def unheard(count: int) -> None:
    """For who wants to hear of no progress."""


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
        for one in inputs:
            yield work(one, advance)
        return
    # Forking a process whose libraries have threads can hang: start fresh ones.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=context, initializer=_end_with_the_parent) as executor:
        try:
            for result, count in executor.map(partial(_counted, work), inputs):
                advance(count)
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

    def advance(more: int) -> None:
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
