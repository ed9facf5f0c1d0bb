"""The order in which transitions are trained on: each epoch a new shuffle, cut into batches of nearly equal size."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact_curation.errors import InvalidValueError


class Batches:
    """An endless row of batches. It remembers where it is.

    Args:
        count: rows of the data, at least one.
        size: of a batch at most. All batches of an epoch are nearly equal, so that none is left with a few loud rows.
        generator: shuffles; nothing else draws from it.
    """

    def __init__(self, count: int, size: int, generator: np.random.Generator) -> None:
        self._generator = generator
        pieces = -(-count // size)
        self._edges = np.linspace(0, count, pieces + 1).astype(np.int64)
        self._order: NDArray[np.int64] = generator.permutation(count)
        self._taken = 0

    def take(self) -> NDArray[np.int64]:
        """The next batch's rows."""
        if self.at_epoch_end:
            self._shuffle()
        first, last = self._edges[self._taken : self._taken + 2]
        self._taken += 1
        return self._order[first:last]

    def ahead(self, count: int) -> NDArray[np.int64]:
        """Rows of the next batches, up to `count` of them, as far as their epoch goes; they are not taken yet."""
        if self.at_epoch_end:
            self._shuffle()
        first, last = self._taken, min(self._taken + count, len(self._edges) - 1)
        return self._order[self._edges[first] : self._edges[last]]

    def skip(self, count: int) -> None:
        """Takes so many of the batches ahead."""
        self._taken += count

    @property
    def left(self) -> int:
        """Batches to the end of the epoch that the next one is of."""
        return len(self._edges) - 1 - (0 if self.at_epoch_end else self._taken)

    @property
    def at_epoch_end(self) -> bool:
        """Whether the last batch of an epoch was taken."""
        return self._taken == len(self._edges) - 1

    @property
    def order(self) -> NDArray[np.int64]:
        """(N,) this epoch's order."""
        return self._order

    def state(self) -> dict[str, Any]:
        """What `restore` needs beside the order, as JSON takes it."""
        return {"taken": self._taken, "generator": self._generator.bit_generator.state}

    def _shuffle(self) -> None:
        self._order = self._generator.permutation(len(self._order))
        self._taken = 0

    def restore(self, order: NDArray[np.int64], state: dict[str, Any]) -> None:
        """Goes on where another one of the same data and size was.

        Raises:
            InvalidValueError: an order that is no permutation, or a state that is none.
        """
        if order.shape != self._order.shape or not np.array_equal(np.sort(order), np.arange(len(order))):
            raise InvalidValueError("order", f"shape {order.shape}", f"a permutation of {len(self._order)} rows")
        taken = state.get("taken")
        if type(taken) is not int or not 0 <= taken < len(self._edges):
            raise InvalidValueError("batches taken", taken, f"a number from 0 to {len(self._edges) - 1}")
        self._generator.bit_generator.state = state["generator"]
        self._order, self._taken = order, taken
