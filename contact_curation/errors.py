"""The errors this package raises on purpose: one class per cause, one line per message.

Each says what was found and what was expected. Only the door of the command line and the door of the nodes catch them.
"""

from collections.abc import Sequence
from pathlib import Path


class ContactCurationError(Exception):
    """Base of every error that a user can cause; `str()` of it is one line."""

    def __str__(self) -> str:
        return " ".join(super().__str__().split())


class InvalidValueError(ContactCurationError):
    """A value is outside what is accepted."""

    def __init__(self, name: str, found: object, expected: str) -> None:
        super().__init__(f"{name}: found {found}, expected {expected}")
        self.name = name


class UnreadableInputError(ContactCurationError):
    """A file or folder cannot be read as what it should be."""

    def __init__(self, path: Path | str, why: str) -> None:
        super().__init__(f"{path}: {why}")
        self.path = Path(path)


class NewerVersionError(UnreadableInputError):
    """A file was written by a later release, in a version of its format that this one does not know."""

    def __init__(self, path: Path | str, what: str, found: int, newest: int) -> None:
        super().__init__(path, f"found version {found} of {what}, expected at most {newest}: update contact_curation")


class MissingTopicError(ContactCurationError):
    """A bag or graph lacks the topic that was asked for."""

    def __init__(self, where: Path | str, wanted: str, available: list[str]) -> None:
        listed = ", ".join(available) if available else "no topics at all"
        super().__init__(f"{where}: found {listed}; expected {wanted}")


class MissingDependencyError(ContactCurationError):
    """Something that must be installed or built is not there."""

    def __init__(self, what: str, remedy: str) -> None:
        super().__init__(f"{what} is missing: {remedy}")


class NotScoredError(ContactCurationError):
    """No transition of a toss could be scored."""

    def __init__(self, toss_id: str, why: str) -> None:
        super().__init__(f"toss {toss_id} was not scored: {why}")


class NothingFoundError(ContactCurationError):
    """No input gave anything that could be used.

    Attributes:
        warnings: what is wrong with the inputs and is not in the message, one line each.
    """

    def __init__(self, message: str, warnings: Sequence[str] = ()) -> None:
        super().__init__(message)
        self.warnings = tuple(warnings)
