"""Damage inside a bag: caught by the reader, which goes on behind it and says what was lost."""

from collections.abc import Hashable

from contact_curation.errors import ContactCurationError


class DamagedBagError(ContactCurationError):
    """A part of a bag cannot be read; the message says why."""


class UndecodableTypeError(ContactCurationError):
    """Messages of a type cannot be decoded; the message says why."""


class Losses:
    """What was lost while reading, one line per cause; saying the same cause again replaces its line."""

    def __init__(self) -> None:
        self._lines: dict[Hashable, str] = {}

    def say(self, cause: Hashable, line: str) -> None:
        self._lines[cause] = " ".join(line.split())

    @property
    def lines(self) -> tuple[str, ...]:
        return tuple(self._lines.values())
