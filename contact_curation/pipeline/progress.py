"""Who wants to hear how far long work is: a bar on a terminal, a widget in a notebook, nobody."""

from contextlib import AbstractContextManager, nullcontext
from typing import Protocol


class Bar(Protocol):
    """One piece of work under way."""

    def advance(self, count: int = 1, note: str = "") -> None:
        """So many more are done; `note` says how it goes."""


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
    def advance(self, count: int = 1, note: str = "") -> None:
        pass


def silent(what: str, unit: str, total: int | None = None, done: int = 0) -> AbstractContextManager[Bar]:
    """Progress that nobody hears of."""
    return nullcontext(_Silent())
