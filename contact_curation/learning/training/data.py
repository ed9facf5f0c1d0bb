"""Training data: checked transitions, as rows of a model, with a digest, names, and batches."""

import hashlib
import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact_curation.contact.models.model import Rows
from contact_curation.contact.time_step import checked_states, checked_time_steps
from contact_curation.errors import InvalidValueError
from contact_curation.motion.transitions import Transitions


def rows_of(data: Transitions) -> Rows:
    """Transitions as models take them."""
    return Rows(data.before, data.after, data.dt)


def digest_of(data: Transitions) -> str:
    """Equal ids, states and periods in equal order, equal digest."""
    state = hashlib.sha256(json.dumps(data.toss_ids).encode())
    for values in (data.starts, data.before, data.after, data.dt):
        state.update(np.ascontiguousarray(values).tobytes())
    return state.hexdigest()


def transition_name(data: Transitions, row: int) -> str:
    """How messages name a row."""
    toss = int(np.searchsorted(data.starts, row, side="right")) - 1
    return f"toss {data.toss_ids[toss]}, transition {row - int(data.starts[toss])}"


def checked(data: Transitions) -> Transitions:
    """The transitions, after a check that a training can use them.

    Raises:
        InvalidValueError: there are none, a state is not finite or turned by no unit quaternion, or a period is not positive.
    """
    if not len(data.dt):
        raise InvalidValueError("transitions", "none", "at least one")
    finite = np.isfinite(data.before).all(axis=1) & np.isfinite(data.after).all(axis=1) & np.isfinite(data.dt)
    if not finite.all():
        row = int(np.argmin(finite))
        raise InvalidValueError(transition_name(data, row), "a state that is not finite", "finite numbers")
    for states in (data.before, data.after):
        checked_states(states)
    checked_time_steps(data.dt, len(data.dt))
    return data


class Batches:
    """An endless row of batches, each epoch in a new shuffle and cut into nearly equal sizes. It remembers where it is.

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
