"""Runs the same work for several inputs, in one process or several, and reports progress."""

import multiprocessing
import multiprocessing.connection
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from contact_curation.errors import ContactCurationError
from contact_curation.storage.addresses import Address


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


BYTES_PER_PROCESS = 8 << 20
"""Of recordings: one process reads and scores so much in about the time in which another one starts."""


def processes_for(paths: Sequence[Path], jobs: int | None) -> int:
    """How many processes work on recordings: as many as asked for, else one per processor as far as starting them pays."""
    if jobs is not None:
        return max(1, min(jobs, len(paths)))
    paying = max(1, sum(map(_size_of, paths)) // BYTES_PER_PROCESS)
    return max(1, min(os.cpu_count() or 1, len(paths), paying))


def _size_of(path: Path) -> int:
    """Size of a recording [bytes]; of one on a server, which is not asked, that for one process; 0 if it cannot be read."""
    if isinstance(path, Address):
        return BYTES_PER_PROCESS
    try:
        return sum(entry.stat().st_size for entry in path.iterdir()) if path.is_dir() else path.stat().st_size
    except OSError:
        return 0


class WorkerDiedError(ContactCurationError):
    """A worker process ended before its work did."""

    def __init__(self, jobs: int) -> None:
        super().__init__(f"one of {jobs} worker processes was killed, perhaps for want of memory: try fewer with --jobs")


@dataclass(frozen=True)
class Broken:
    """In place of the result of an input that broke its worker twice.

    Attributes:
        why: one line.
    """

    why: str


class Engine(Protocol):
    """Schedules the same work for many inputs."""

    @property
    def jobs(self) -> int:
        """How many pieces of work share the processors of a machine."""

    def as_done[Input, Result](
        self, work: Callable[[Input, Advance], Result], inputs: Sequence[Input], advance: Advance
    ) -> Iterator[tuple[int, Result | Broken]]:
        """The place of each input and its result, in the order in which they are done."""


@dataclass(frozen=True)
class LocalEngine:
    """Processes of this machine; with one job, this process.

    Attributes:
        jobs: how many processes.
    """

    jobs: int = 1

    def as_done[Input, Result](
        self, work: Callable[[Input, Advance], Result], inputs: Sequence[Input], advance: Advance
    ) -> Iterator[tuple[int, Result | Broken]]:
        """The same as in `Engine`; with several processes `work` and `inputs` are pickled, and progress is told by input."""
        if min(self.jobs, len(inputs)) > 1:
            yield from _in_processes(work, inputs, min(self.jobs, len(inputs)), advance)
            return
        for place, one in enumerate(inputs):
            result = work(one, advance)
            advance(0, share=(place + 1) / len(inputs))
            yield place, result


def each[Input, Result](
    work: Callable[[Input, Advance], Result], inputs: Sequence[Input], jobs: int, advance: Advance
) -> Iterator[Result]:
    """The results of `work` for each of `inputs`, in their order.

    With several processes `work` and `inputs` are pickled, and `advance` is told of an input when it is done.

    Raises:
        WorkerDiedError: an input broke its process twice, e.g. for want of memory.
    """
    early: dict[int, Result] = {}
    following = 0
    for place, result in LocalEngine(jobs).as_done(work, inputs, advance):
        if isinstance(result, Broken):
            raise WorkerDiedError(jobs)
        early[place] = result
        while following in early:
            yield early.pop(following)
            following += 1


def _in_processes[Input, Result](
    work: Callable[[Input, Advance], Result], inputs: Sequence[Input], jobs: int, advance: Advance
) -> Iterator[tuple[int, Result | Broken]]:
    """All inputs side by side; of those under way when a process dies, which may have broken it, each once more, alone."""
    coming, done = list(range(len(inputs))), 0

    def tell(count: int) -> None:
        nonlocal done
        done += 1
        advance(count, share=done / len(inputs))

    while coming:
        suspects, coming = yield from _side_by_side(work, inputs, coming, jobs, tell)
        for place in suspects:
            again, _ = yield from _side_by_side(work, inputs, [place], 1, tell)
            if again:
                tell(0)
                yield (
                    place,
                    Broken("broke its worker process twice, perhaps for want of memory: left out"),
                )


def _side_by_side[Input, Result](
    work: Callable[[Input, Advance], Result],
    inputs: Sequence[Input],
    places: Sequence[int],
    jobs: int,
    tell: Callable[[int], None],
) -> Generator[tuple[int, Result], None, tuple[list[int], list[int]]]:
    """Results by place until a process dies; returns which inputs were under way then, and which had not begun."""
    coming = deque(places)
    # Forking a process whose libraries have threads can hang: start fresh ones.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=context, initializer=_end_with_the_parent) as executor:
        under_way: dict[Future[tuple[Result, int]], int] = {}
        try:
            while coming or under_way:
                while coming and len(under_way) <= jobs:
                    future = executor.submit(counted_work, work, inputs[coming[0]])
                    under_way[future] = coming.popleft()
                finished = wait(under_way, return_when=FIRST_COMPLETED).done
                for future in [one for one in finished if not isinstance(one.exception(), BrokenProcessPool)]:
                    result, count = future.result()
                    tell(count)
                    yield under_way.pop(future), result
                if any(isinstance(one.exception(), BrokenProcessPool) for one in finished):
                    return sorted(under_way.values()), list(coming)
        except BrokenProcessPool:  # when the next one was to be submitted
            return sorted(under_way.values()), list(coming)
        except KeyboardInterrupt:  # of this process alone: workers would end their inputs first
            for worker in multiprocessing.active_children():
                worker.terminate()
            raise
        finally:
            executor.shutdown(wait=False, cancel_futures=True)
    return [], []


def counted_work[Input, Result](work: Callable[[Input, Advance], Result], one: Input) -> tuple[Result, int]:
    """The result of some work, and how many tosses it told of."""
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
