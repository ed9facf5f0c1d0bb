"""The errors this package raises on purpose: one class per cause, one line per message.

Each says what was found and what was expected. Only the entry points of the command line and of the nodes catch them.
"""

from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from itertools import islice
from pathlib import Path

MOST_LISTED = 30
"""Names that a message lists."""


CONTROLS = {code: f"\\u{code:04x}" for code in (*range(0x20), *range(0x7F, 0xA0)) if chr(code) not in "\t\n\r"}
"""Control characters, and how they are shown (as in JSON): a name in a recording may contain commands to a terminal."""


class ContactCurationError(Exception):
    """Base of every error that a user can cause; `str()` of it is one line.

    Errors of worker processes are pickled. Python would call `__init__` again with the message alone, so this class says how an
    error is made from its message and attributes.
    """

    def __str__(self) -> str:
        return " ".join(super().__str__().split()).translate(CONTROLS)

    def __reduce__(self) -> tuple[object, ...]:
        return _uninitialised, (type(self), *self.args), self.__dict__


def _uninitialised(kind: type[ContactCurationError], *args: object) -> ContactCurationError:
    return kind.__new__(kind, *args)


class InvalidValueError(ContactCurationError):
    """A value is outside what is accepted."""

    def __init__(self, name: str, found: object, expected: str) -> None:
        super().__init__(f"{name}: found {found}, expected {expected}")
        self.name = name


class UnwritableOutputError(InvalidValueError):
    """An output cannot be written: its disk is full or broken, or its folder is not there."""

    def __init__(self, path: object, reason: str) -> None:
        super().__init__("output", path, f"a path that can be written ({reason})")
        self.reason = reason


MOST_ENTRIES = 1000
"""Entries of a folder that a misspelt file name is compared with."""


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """What to do about an unknown name: "did you mean vertices?", or the list of known names where none is near.

    Args:
        name: as its user wrote it.
        known: the names that are accepted, as they shall be shown (with quotes, where `name` has them).
    """
    accepted = sorted(known)
    lowered = {one.lower(): one for one in accepted}
    near = get_close_matches(name.lower(), lowered, n=1)
    more = ["..."] if len(accepted) > MOST_LISTED else []
    return f"did you mean {lowered[near[0]]}?" if near else f"expected one of {', '.join([*accepted[:MOST_LISTED], *more])}"


def near_name(name: str, known: Iterable[str]) -> str:
    """What to add to a message that lists the known names already: "; did you mean OTHER?", or nothing."""
    meant = did_you_mean(name, known)
    return f"; {meant}" if meant.startswith("did") else ""


class UnknownNameError(InvalidValueError):
    """A key, a field or an option that does not exist; the message names the nearest one that does."""

    def __init__(self, kind: str, name: object, known: Iterable[str]) -> None:
        """Builds the message "unknown KIND NAME: did you mean OTHER?".

        Args:
            kind: what the name is of, such as "key" or "field".
            name: as its user wrote it, perhaps no text.
            known: the names that are accepted.
        """
        ContactCurationError.__init__(self, f"unknown {kind} {name}: {did_you_mean(str(name), known)}")
        self.name = str(name)


class UnreadableInputError(ContactCurationError):
    """A file or folder cannot be read as what it should be."""

    def __init__(self, path: Path | str, why: str) -> None:
        super().__init__(f"{path}: {why}")
        self.path = Path(path)


class ChangedTossError(UnreadableInputError):
    """A toss is another one when it is read from a part of its recording."""

    def __init__(self, path: Path | str, toss_id: str) -> None:
        found = f"found toss {toss_id} changed when read from a part of it, expected the same"
        why = "(header stamps that jitter are made even by all poses before them)"
        super().__init__(path, f"{found} {why}: export to another --format")


def why_unreadable(path: Path, error: OSError) -> str:
    """Why the system does not read a file, and where there is none of the name, the nearest name in its folder.

    Of a link to nothing, as in a folder whose data were not fetched, where it leads.
    """
    why = error.strerror or str(error)
    if not isinstance(error, FileNotFoundError):
        return why
    if not path.parent.is_dir():
        return f"{why}; there is no folder {path.parent}"
    if path.is_symlink():
        return f"{why}; it is a link to {path.readlink()}"
    return why + near_name(path.name, (entry.name for entry in islice(path.parent.iterdir(), MOST_ENTRIES)))


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


class UnloadableLibraryError(ContactCurationError):
    """A library is installed, but the system cannot load it."""

    def __init__(self, path: str, why: object) -> None:
        super().__init__(f"{path}: cannot be loaded: {why}; expected the system packages of the README, and memory enough")


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
