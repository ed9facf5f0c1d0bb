"""Runs the same work for several inputs, in one process or several, and reports progress."""

import multiprocessing
import multiprocessing.connection
import multiprocessing.context
import os
import signal
import sys
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import NamedTuple, Protocol

from contact_curation.configs import whole_number
from contact_curation.errors import ContactCurationError, InvalidValueError
from contact_curation.storage.addresses import Address


class Advance(Protocol):
    """A function that work calls to report its progress."""

    def __call__(self, count: int, /, *, note: str = "", share: float | None = None) -> None:
        """Reports progress.

        Args:
            count: number of tosses done since the last call.
            note: how far the work is, in other units; empty where it is as before.
            share: finished share of the whole work, from 0 to 1; None where it is not known.
        """


def unheard(count: int, /, *, note: str = "", share: float | None = None) -> None:
    """Ignores progress."""


class Bar(Protocol):
    """The progress of one piece of work."""

    def advance(self, count: int = 1, note: str = "", share: float | None = None) -> None:
        """Counts `count` more as done; `note` describes the state, `share` is the finished share of all, from 0 to 1.

        What is left out is as before.
        """


class Progress(Protocol):
    """Makes a bar for each piece of work."""

    def __call__(self, what: str, unit: str, total: int | None = None, done: int = 0, /) -> AbstractContextManager[Bar]:
        """Makes a bar.

        Args:
            what: name of the work, e.g. "reading".
            unit: name of what is counted, e.g. "tosses".
            total: total number; None if it is not known.
            done: number that was done before.
        """


class _Silent:
    def advance(self, count: int = 1, note: str = "", share: float | None = None) -> None:
        pass


def silent(what: str, unit: str, total: int | None = None, done: int = 0) -> AbstractContextManager[Bar]:
    """Progress that is not shown."""
    return nullcontext(_Silent())


BYTES_PER_PROCESS = 8 << 20
"""Size of recordings that a process reads and scores in about the time that the start of a process takes."""


def processes_for(paths: Sequence[Path], jobs: int | None) -> int:
    """The number of processes for recordings: `jobs`, or for None one per processor, as long as starting them saves time.

    A daemonic process, such as a worker of `multiprocessing.Pool`, may have no children and does all by itself.
    """
    if jobs is not None:
        whole_number("jobs", jobs, 1)
    if multiprocessing.current_process().daemon:
        return 1
    if jobs is not None:
        return max(1, min(jobs, len(paths)))
    paying = max(1, sum(map(_size_of, paths)) // BYTES_PER_PROCESS)
    return max(1, min(os.cpu_count() or 1, len(paths), paying))


def _size_of(path: Path) -> int:
    """Size of a recording [bytes]: `BYTES_PER_PROCESS` if it is on a server, which is not asked; 0 if it cannot be read."""
    if isinstance(path, Address):
        return BYTES_PER_PROCESS
    try:
        return sum(entry.stat().st_size for entry in path.iterdir()) if path.is_dir() else path.stat().st_size
    except OSError:
        return 0


class Finished:
    """Reports the inputs that are done: how many, and if their sizes are known how much of them.

    Args:
        inputs: all there are.
        advance: told for each of them.
    """

    def __init__(self, inputs: Sequence[object], advance: Advance) -> None:
        self._sizes = [_known_size(one) for one in inputs]
        self._advance = advance
        self._done, self._done_bytes = 0, 0

    def add(self, place: int, tosses: int) -> None:
        """Reports the input at `place`, and how many of its tosses were not reported yet."""
        self._done, self._done_bytes = self._done + 1, self._done_bytes + self._sizes[place]
        number, total = len(self._sizes), sum(self._sizes)
        note, share = f"{self._done} of {number} recordings", self._done / number
        if all(self._sizes):
            unit, name = (1e9, "GB") if total >= 1e9 else (1e6, "MB")
            note, share = f"{note}, {self._done_bytes / unit:.1f} of {total / unit:.1f} {name}", self._done_bytes / total
        self._advance(tosses, note=note if number > 1 else "", share=share)


def _known_size(one: object) -> int:
    """Size of a recording [bytes]; 0 if it is not known without asking a server, or not a path."""
    if isinstance(one, Address):
        return one.known_size
    return _size_of(one) if isinstance(one, Path) else 0


class WorkerDiedError(ContactCurationError):
    """A worker process ended before its work did."""

    def __init__(self, jobs: int) -> None:
        super().__init__(f"one of {jobs} worker processes was killed, perhaps because memory ran out: try fewer with --jobs")


class Unfinished(NamedTuple):
    """The inputs without a result after a worker process has died; both empty if none died.

    Attributes:
        suspects: places of the inputs that were being worked on; one of them may have caused the death.
        waiting: places of the inputs that had not begun.
    """

    suspects: list[int]
    waiting: list[int]


class Counted[Result](NamedTuple):
    """The result of some work.

    Attributes:
        result: the value that the work returned.
        tosses: number of tosses that it reported as done.
    """

    result: Result
    tosses: int


@dataclass(frozen=True)
class Broken:
    """Replaces the result of an input whose worker process died twice.

    Attributes:
        why: the reason, in one line.
    """

    why: str


class Engine(Protocol):
    """Runs the same work for many inputs."""

    @property
    def jobs(self) -> int:
        """Number of pieces of work that share the processors of a machine."""

    def as_done[Input, Result](
        self, work: Callable[[Input, Advance], Result], inputs: Sequence[Input], advance: Advance
    ) -> Iterator[tuple[int, Result | Broken]]:
        """Yields the place of each input in `inputs` with its result, in the order in which they are done."""


@dataclass(frozen=True)
class LocalEngine:
    """Runs work in processes of this machine; with one job, in this process.

    Attributes:
        jobs: number of processes.
    """

    jobs: int = 1

    def __post_init__(self) -> None:
        whole_number("jobs", self.jobs, 1)

    def as_done[Input, Result](
        self, work: Callable[[Input, Advance], Result], inputs: Sequence[Input], advance: Advance
    ) -> Iterator[tuple[int, Result | Broken]]:
        """As in `Engine`; with several processes `work` and `inputs` are pickled, and progress is reported once per input."""
        if min(self.jobs, len(inputs)) > 1:
            yield from _in_processes(work, inputs, min(self.jobs, len(inputs)), advance)
            return
        finished = Finished(inputs, advance)
        for place, one in enumerate(inputs):
            result = work(one, advance)
            finished.add(place, 0)
            yield place, result


def each[Input, Result](
    work: Callable[[Input, Advance], Result], inputs: Sequence[Input], jobs: int, advance: Advance
) -> Iterator[Result]:
    """Yields the result of `work` for each of `inputs`, in their order.

    With several processes `work` and `inputs` are pickled, and `advance` is called when an input is done.

    Raises:
        WorkerDiedError: the process that worked on an input died twice, e.g. because memory ran out.
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
    """Runs all inputs in parallel. If a process dies, each input that was being worked on is tried once more, alone."""
    waiting, finished = list(range(len(inputs))), Finished(inputs, advance)
    while waiting:
        suspects, waiting = yield from _in_parallel(work, inputs, waiting, jobs, finished)
        for place in suspects:
            if (yield from _in_parallel(work, inputs, [place], 1, finished)).suspects:
                finished.add(place, 0)
                yield place, Broken("its worker process died twice, perhaps because memory ran out: left out")


def _in_parallel[Input, Result](
    work: Callable[[Input, Advance], Result],
    inputs: Sequence[Input],
    places: Sequence[int],
    jobs: int,
    finished: Finished,
) -> Generator[tuple[int, Result], None, Unfinished]:
    """Yields the place and the result of each input, until all are done or a process dies; returns those without a result."""
    coming = deque(places)
    with _executor(jobs) as executor:
        under_way: dict[Future[Counted[Result]], int] = {}
        try:
            while coming or under_way:
                while coming and len(under_way) <= jobs:
                    future = executor.submit(counted_work, work, inputs[coming[0]])
                    under_way[future] = coming.popleft()
                done = wait(under_way, return_when=FIRST_COMPLETED).done
                for future in [one for one in done if not isinstance(one.exception(), BrokenProcessPool)]:
                    result, count = future.result()
                    place = under_way.pop(future)
                    finished.add(place, count)
                    yield place, result
                if any(isinstance(one.exception(), BrokenProcessPool) for one in done):
                    return Unfinished(sorted(under_way.values()), list(coming))
        except BrokenProcessPool:  # when the next one was to be submitted
            return Unfinished(sorted(under_way.values()), list(coming))
        except KeyboardInterrupt:  # of this process alone: workers would end their inputs first
            for worker in list(executor._processes.values()):
                worker.terminate()
            raise
        finally:
            executor.shutdown(wait=False, cancel_futures=True)
    return Unfinished([], [])


def _executor(jobs: int) -> ProcessPoolExecutor:
    """Fresh processes: to fork one whose libraries have threads can hang.

    Raises:
        InvalidValueError: the system refuses what they would share, as in a container without /dev/shm.
    """
    try:
        return ProcessPoolExecutor(jobs, mp_context=_WorkerContext(), initializer=_end_with_the_parent)
    except OSError as error:
        expected = f"1, because processes cannot share locks here ({error.strerror or error}): may /dev/shm be written?"
        raise InvalidValueError("jobs", jobs, expected) from error


_START = threading.Lock()


class _Worker(multiprocessing.context.SpawnProcess):
    """A fresh process that does not begin with the user's script, which may have no `if __name__ == "__main__"`."""

    def start(self) -> None:
        with _START:  # of several threads, each would put back what another one had put there
            script = sys.modules["__main__"]
            sys.modules["__main__"] = ModuleType("__main__")
            try:
                super().start()
            finally:
                sys.modules["__main__"] = script


class _WorkerContext(multiprocessing.context.SpawnContext):
    Process = _Worker


def counted_work[Input, Result](work: Callable[[Input, Advance], Result], one: Input) -> Counted[Result]:
    """Does the work for one input, and counts the tosses that it reports as done."""
    count = 0

    def advance(more: int, /, *, note: str = "", share: float | None = None) -> None:
        nonlocal count
        count += more

    return Counted(work(one, advance), count)


def _end_with_the_parent() -> None:
    """Makes a worker end silently at an interrupt, and when its parent dies, for whose next input it would wait forever."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_after, args=(parent.sentinel,), daemon=True).start()


def _end_after(sentinel: int) -> None:
    multiprocessing.connection.wait([sentinel])
    os._exit(1)
