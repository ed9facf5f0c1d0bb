"""One thread for the long computations of a node, so that its callbacks return at once and no pose is dropped."""

import threading
from collections import deque
from collections.abc import Callable
from queue import SimpleQueue

PATIENCE = 0.5
"""Time between checks whether an inbox that is full will still be emptied [s]."""


class Worker:
    """Runs jobs one after the other, in the order in which they were queued, on a thread of its own.

    Args:
        fail: called on the worker's thread with the exception of a job; the worker then ends, because its state is not known.
    """

    def __init__(self, fail: Callable[[BaseException], None]) -> None:
        self._fail = fail
        self._jobs: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._work, name="worker", daemon=True)
        self._thread.start()

    def do(self, job: Callable[[], None]) -> None:
        """Queues a job."""
        self._jobs.put(job)

    @property
    def waiting(self) -> int:
        """Number of jobs in the queue."""
        return self._jobs.qsize()

    def stop(self) -> None:
        """Waits until the worker has finished all queued jobs, and ends it."""
        self._jobs.put(None)
        self._thread.join()

    def _work(self) -> None:
        while (job := self._jobs.get()) is not None:
            try:
                job()
            except BaseException as error:  # noqa: BLE001  (passed on to the main thread, never ignored)
                self._fail(error)
                return


class Latest:
    """A job that works on the newest state: however often it is requested while it waits in the queue, it runs once.

    Args:
        worker: worker that runs the job.
        job: the job.
    """

    def __init__(self, worker: Worker, job: Callable[[], None]) -> None:
        self._worker = worker
        self._job = job
        self._wanted = threading.Event()

    def want(self) -> None:
        """Queues the job after all present jobs, unless it waits in the queue already."""
        if not self._wanted.is_set():
            self._wanted.set()
            self._worker.do(self._do)

    def _do(self) -> None:
        self._wanted.clear()
        self._job()


class Inbox[Item]:
    """A bounded queue of items for the worker. If it is full, the callback that adds an item waits, so that nothing is lost.

    Args:
        limit: largest number of waiting items.
        goes_on: returns whether items will still be taken.
    """

    def __init__(self, limit: int, goes_on: Callable[[], bool]) -> None:
        self._items: deque[Item] = deque()
        self._room = threading.Semaphore(limit)
        self._goes_on = goes_on

    def __len__(self) -> int:
        return len(self._items)

    def put(self, item: Item) -> None:
        """Adds an item; waits for room as long as items are still taken."""
        while not self._room.acquire(timeout=PATIENCE):
            if not self._goes_on():
                return
        self._items.append(item)

    def take(self, most: int) -> list[Item]:
        """Removes and returns the oldest items, up to `most`."""
        taken = [self._items.popleft() for _ in range(min(most, len(self._items)))]
        if taken:
            self._room.release(len(taken))
        return taken
