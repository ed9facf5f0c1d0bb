"""What has arrived and waits for the worker: in order, and bounded, so that whoever brings more waits and loses nothing."""

import threading
from collections import deque
from collections.abc import Callable

PATIENCE = 0.5
"""[s] between looks whether waiting still makes sense."""


class Inbox[Item]:
    """A queue from one thread to another.

    Args:
        limit: so many items wait at most.
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
