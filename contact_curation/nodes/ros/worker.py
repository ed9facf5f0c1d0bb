"""One thread for the heavy work of a node, so that its callbacks return at once and no pose is dropped."""

import threading
from collections import deque
from collections.abc import Callable
from queue import SimpleQueue

PATIENCE = 0.5
"""[s] between looks whether waiting for room in an inbox still makes sense."""


class Worker:
    """Does jobs one after the other, in the order they came, on a thread of its own.

    Args:
        fail: called on the worker's thread with what a job raised; the worker then ends, because its state is not known.
    """

    def __init__(self, fail: Callable[[BaseException], None]) -> None:
        self._fail = fail
        self._jobs: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._work, name="worker", daemon=True)
        self._thread.start()

    def do(self, job: Callable[[], None]) -> None:
        """Puts a job in the queue."""
        self._jobs.put(job)

    @property
    def waiting(self) -> int:
        """How many jobs are in the queue."""
        return self._jobs.qsize()

    def stop(self) -> None:
        """Lets the worker finish the jobs it has, and waits for that."""
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
    """A job that always works on the newest state: asked for again while it waits, it is done once.

    Args:
        worker: worker that does it.
        job: what to do.
    """

    def __init__(self, worker: Worker, job: Callable[[], None]) -> None:
        self._worker = worker
        self._job = job
        self._wanted = threading.Event()

    def want(self) -> None:
        """Has the job done after everything that is in the queue now."""
        if not self._wanted.is_set():
            self._wanted.set()
            self._worker.do(self._do)

    def _do(self) -> None:
        self._wanted.clear()
        self._job()


class Inbox[Item]:
    """A bounded queue of what waits for the worker: a callback that brings more waits, and nothing is lost.

    Args:
        limit: largest number of items that wait.
        goes_on: says whether anything will be taken any more.
    """

    def __init__(self, limit: int, goes_on: Callable[[], bool]) -> None:
        self._items: deque[Item] = deque()
        self._room = threading.Semaphore(limit)
        self._goes_on = goes_on

    def __len__(self) -> int:
        return len(self._items)

    def put(self, item: Item) -> None:
        """Adds an item; waits for room as long as things go on."""
        while not self._room.acquire(timeout=PATIENCE):
            if not self._goes_on():
                return
        self._items.append(item)

    def take(self, most: int) -> list[Item]:
        """The oldest items, up to `most`."""
        taken = [self._items.popleft() for _ in range(min(most, len(self._items)))]
        if taken:
            self._room.release(len(taken))
        return taken
